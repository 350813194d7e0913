// SPDX-License-Identifier: LGPL-2.1-or-later
// How far the page's sound is from its picture. The sender claps at whole 2 s of capture time (tests/pipelines/clap.cpp).
import assert from 'node:assert/strict';
import os from 'node:os';
import path from 'node:path';
import { build } from './support.js';

export const CLAPS = { CLAP_SEND: '1', LD_PRELOAD: path.join (build, 'tests/pipelines/libclap.so'), ASAN_OPTIONS: 'verify_asan_link_order=0' };
export const withoutPolicy = (page) => page.setBypassCSP (true); // for the listener below
const median = (values) => values.toSorted ((a, b) => a - b)[values.length >> 1];

// Turns the sound on, and asserts that it is heard within 40 ms of when the picture of the same moment is seen.
export const assertInSync = async (page, t) => {
  await page.click ('>>> #sound');
  await page.evaluate (async () => {
    const { player, meter } = window.rangecastView, { seen } = meter, { context } = player.speech;
    window.heard = []; // for each clap: when it was heard (ms), and how late the pictures of the four seconds before were seen (ms)
    const pictures = [];
    let shown;
    player.addEventListener ('frame', ({ detail }) => { shown = detail; });
    meter.seen = function (latency) {
      pictures.push ({ time: performance.timeOrigin + performance.now (), age: shown.due + latency - shown.captureTime });
      return seen.call (this, latency);
    };
    const listener = `registerProcessor ('onsets', class extends AudioWorkletProcessor {
      process ([[samples]]) {
        const at = samples?.findIndex ((value) => Math.abs (value) > 0.2) ?? -1;
        if (at >= 0 && !(currentTime < this.next)) { // a clap in which a packet is lost begins twice
          this.port.postMessage (currentTime + at / sampleRate);
          this.next = currentTime + 1;
        }
        return true;
      }
    });`;
    await context.audioWorklet.addModule (URL.createObjectURL (new Blob ([listener], { type: 'text/javascript' })));
    const onsets = new AudioWorkletNode (context, 'onsets');
    onsets.port.onmessage = ({ data }) => {
      const { contextTime, performanceTime } = context.getOutputTimestamp ();
      const time = performance.timeOrigin + performanceTime + 1000 * (data - contextTime);
      window.heard.push ({ ages: pictures.filter ((one) => one.time > time - 4000 && one.time < time + 100).map (({ age }) => age), time });
    };
    player.speech.destination.connect (onsets);
  });
  // A busy machine shows pictures unevenly, which no sound can follow: claps count where four fifths are late by the same, within 40 ms. The
  // first one is heard before the sound has found its place.
  let heard = [], differences = [];
  const isEven = ({ ages }) => {
    const sorted = ages.toSorted ((a, b) => a - b);
    return ages.length > 20 && sorted[Math.floor (0.9 * ages.length)] - sorted[Math.floor (0.1 * ages.length)] < 40;
  };
  while (differences.length < 5 && heard.length < 15) {
    await page.waitForFunction ((before) => window.heard.length > before + 1, {}, heard.length);
    heard = (await page.evaluate (() => window.heard)).slice (1);
    differences = heard.filter (isEven).map (({ ages, time }) => (time - median (ages.slice (-15)) + 1000) % 2000 - 1000);
  }
  console.log (`sound after picture, ms: ${differences.map ((value) => value.toFixed (0)).join (' ')}`);
  if (differences.length < 5 && os.loadavg ()[0] > os.availableParallelism ())
    return t.skip (`the machine is too busy: ${differences.length} of ${heard.length} claps count`);
  assert.ok (differences.length >= 5 && Math.abs (median (differences)) < 40);
};

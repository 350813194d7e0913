// SPDX-License-Identifier: LGPL-2.1-or-later
// How far the page's sound is from its picture. The sender claps at whole 2 s of capture time (tests/pipelines/clap.cpp).
import assert from 'node:assert/strict';
import path from 'node:path';
import { build } from './support.js';

export const CLAPS = { CLAP_SEND: '1', LD_PRELOAD: path.join (build, 'tests/pipelines/libclap.so'), ASAN_OPTIONS: 'verify_asan_link_order=0' };
export const withoutPolicy = (page) => page.setBypassCSP (true); // for the listener below
const median = (values) => values.toSorted ((a, b) => a - b)[values.length >> 1];

// Turns the sound on, and asserts that it is heard within 40 ms of when the picture of the same moment is seen.
export const assertInSync = async (page) => {
  await page.click ('>>> #sound');
  await page.evaluate (async () => {
    const { player, meter } = window.rangecastView, { seen } = meter, { context } = player.speech;
    window.heard = []; // for each clap that is heard: capture times of pictures that were seen just before, ms
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
        if (at >= 0 && !this.loud)
          this.port.postMessage (currentTime + at / sampleRate);
        this.loud = at >= 0;
        return true;
      }
    });`;
    await context.audioWorklet.addModule (URL.createObjectURL (new Blob ([listener], { type: 'text/javascript' })));
    const onsets = new AudioWorkletNode (context, 'onsets');
    onsets.port.onmessage = ({ data }) => {
      const { contextTime, performanceTime } = context.getOutputTimestamp ();
      const time = performance.timeOrigin + performanceTime + 1000 * (data - contextTime);
      window.heard.push (pictures.filter ((one) => Math.abs (one.time - time) < 500).map (({ age }) => time - age));
    };
    player.speech.destination.connect (onsets);
  });
  let differences = [];
  // A busy machine shows pictures late and interrupts the sound, by chance: the median of more claps tells, of up to thirty.
  while ((differences.length < 5 || Math.abs (median (differences)) >= 40) && differences.length < 30) {
    await page.waitForFunction ((before) => window.heard.length > before + 1, {}, differences.length);
    const heard = await page.evaluate (() => window.heard);
    differences = heard.slice (1).map ((times) => (median (times) + 1000) % 2000 - 1000);
  }
  console.log (`sound after picture, ms: ${differences.map ((value) => value.toFixed (0)).join (' ')}`);
  assert.ok (Math.abs (median (differences)) < 40);
};

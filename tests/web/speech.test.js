// SPDX-License-Identifier: LGPL-2.1-or-later
// Speech beside the frame sets: claps (tests/pipelines/clap.cpp) tell when the page plays what.
import assert from 'node:assert/strict';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { framesShown, launch, openPage, sleep } from './browser.js';
import { client, killServers, serve } from './serving.js';
import { build } from './support.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

const serveSpeech = () => serve (['port=0', 'name=web', 'audiotestsrc', 'is-live=true', 'wave=silence', '!', 'audioconvert', '!', 'audioresample', '!',
  'audio/x-raw,format=S16LE,rate=48000,channels=1', '!', 'opusenc', 'audio-type=voice', '!', 'web.audio'], [], undefined,
{ CLAP_SEND: '1', LD_PRELOAD: path.join (build, 'tests/pipelines/libclap.so'), ASAN_OPTIONS: 'verify_asan_link_order=0' });
const median = (values) => values.toSorted ((a, b) => a - b)[values.length >> 1];

test ('clients that want to hear are sent every packet, others none', async () => {
  const server = await serveSpeech ();
  const deaf = client (server.address), hears = client (server.address, { hello: { type: 'hello', version: 1, want: ['stream', 'audio'] } });
  await hears.until (({ speech }) => speech.length >= 100, '100 packets');
  await deaf.until (({ frames }) => frames.length >= 10, '10 frame sets');
  assert.equal (deaf.speech.length, 0);
  assert.equal (hears.texts[0].audio, true);
  const [first] = hears.speech, monotonic = Number (process.hrtime.bigint ()) / 1e6;
  hears.speech.forEach (({ number, captured, bytes }, i) => {
    assert.equal (number, first.number + i);
    assert.ok (Math.abs (captured - first.captured - 20 * i) < 10, `${captured - first.captured} ms at packet ${i}`);
    assert.ok (bytes > 0 && bytes < 1500);
  });
  assert.ok (monotonic - hears.speech.at (-1).captured < 2000 && monotonic > first.captured);
  hears.socket.close ();
  deaf.socket.close ();
  await server.stop ();
});

test ('a client that does not acknowledge frame sets is sent no more speech', async () => {
  const server = await serveSpeech ();
  const stalled = client (server.address, { hello: { type: 'hello', version: 1, want: ['stream', 'audio'] }, acknowledges: false });
  await stalled.until (({ frames }) => frames.length >= 1, 'a frame set');
  await sleep (3000);
  const { length } = stalled.speech;
  await sleep (1000);
  assert.equal (stalled.speech.length, length);
  assert.ok (length < 120, `${length} packets`);
  stalled.socket.close ();
  await server.stop ();
});

test ('speech is heard within 40 ms of when the picture of the same moment is seen', async () => {
  const server = await serveSpeech (), page = await openPage (browser, `${server.address}/`, undefined, (one) => one.setBypassCSP (true)); // for the listener below
  await framesShown (page, 20);
  await page.click ('>>> #sound');
  await page.evaluate (async () => {
    const { speech } = window.rangecastView.player, { context } = speech;
    window.heard = []; // beginnings of claps, ms since the epoch
    window.seen = []; // frame sets: { time, latency }
    const { meter: stats } = window.rangecastView, { seen } = stats;
    stats.seen = function (latency) {
      window.seen.push ({ time: performance.timeOrigin + performance.now (), latency });
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
      window.heard.push (performance.timeOrigin + performanceTime + 1000 * (data - contextTime));
    };
    speech.destination.connect (onsets);
  });
  const offset = Date.now () - Number (process.hrtime.bigint ()) / 1e6; // of the epoch's clock and the monotonic one
  let differences = [];
  // A busy machine shows pictures late and interrupts the sound, by chance: the median of more claps tells, of up to thirty.
  while ((differences.length < 5 || Math.abs (median (differences)) >= 40) && differences.length < 30) {
    await page.waitForFunction ((before) => window.heard.length > before + 1, {}, differences.length);
    const { heard, seen } = await page.evaluate (() => ({ heard: window.heard, seen: window.seen }));
    differences = heard.slice (1).map ((time) => {
      const sound = (time - offset) % 2000; // claps are captured at whole 2 s
      return sound - median (seen.filter ((one) => Math.abs (one.time - time) < 500).map (({ latency }) => latency));
    });
  }
  console.log (`sound after picture, ms: ${differences.map ((value) => value.toFixed (0)).join (' ')}`);
  assert.ok (Math.abs (median (differences)) < 40);
  await page.click ('>>> #sound');
  assert.equal (await page.evaluate (() => window.rangecastView.player.speech.context), null);
  await page.click ('>>> #sound'); // and on again
  await page.waitForFunction (() => window.rangecastView.player.speech.next > 1);
  await page.close ();
  await server.stop ();
});

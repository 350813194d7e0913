// SPDX-License-Identifier: LGPL-2.1-or-later
// Speech beside the frame sets of a live stream.
import assert from 'node:assert/strict';
import test, { after, before } from 'node:test';
import { framesShown, launch, openPage, sleep } from './browser.js';
import { assertInSync, CLAPS, withoutPolicy } from './claps.js';
import { client, killServers, serve } from './serving.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

const serveSpeech = (...behind) => serve (['port=0', 'name=web', 'audiotestsrc', 'is-live=true', 'wave=silence', '!', 'audioconvert', '!', 'audioresample', '!',
  'audio/x-raw,format=S16LE,rate=48000,channels=1', '!', 'opusenc', 'audio-type=voice', '!', ...behind, 'web.audio'], [], undefined, CLAPS);

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

test ('speech is heard within 40 ms of when the picture of the same moment is seen, also where packets are lost', async (t) => {
  const server = await serveSpeech ('identity', 'drop-probability=0.05', '!'), page = await openPage (browser, `${server.address}/`, undefined, withoutPolicy);
  await framesShown (page, 20);
  await assertInSync (page, t);
  await page.click ('>>> #sound');
  assert.equal (await page.evaluate (() => window.rangecastView.player.speech.context), null);
  await page.click ('>>> #sound'); // and on again
  await page.waitForFunction (() => window.rangecastView.player.speech.next > 1);
  await page.close ();
  await server.stop ();
});

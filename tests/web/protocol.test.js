// SPDX-License-Identifier: LGPL-2.1-or-later
// The page's side of docs/formats/web-protocol.md, without a network.
import assert from 'node:assert/strict';
import test from 'node:test';
import { parseAudio, parsePlaylist } from '../../pipelines/web/segment-source.js';
import { MAX_FRAME_SET, readFrameSet, readSpeech, ServerClock } from '../../pipelines/web/protocol.js';

// Messages as the page of the protocol defines them, byte by byte.
const frameSet = Uint8Array.of (1, 3, 0, 0, 0xfe, 0xff, 0xff, 0xff, 4, 0, 0, 0, 0xc4, 9, 0, 0, 0xc0, 0xc6, 0x2d, 0, 0, 0, 0, 0, 1, 2);
const speech = Uint8Array.of (2, 0, 0, 0, 7, 0, 0, 0, 0xc0, 0xc6, 0x2d, 0, 0, 0, 0, 0, 5);

test ('a header gives its fields, times in milliseconds', () => {
  const { units, ...fields } = readFrameSet (frameSet.buffer);
  assert.deepEqual (fields, { key: true, discontinuity: true, frameSet: 0xfffffffe, dropped: 4, delay: 2.5, sent: 3000 });
  assert.deepEqual ([...units], [1, 2]);
  const { data, ...rest } = readSpeech (speech.buffer);
  assert.deepEqual (rest, { number: 7, captured: 3000 });
  assert.deepEqual ([...data], [5]);
});

test ('a message that is too short, too long or of another kind is no frame set', () => {
  for (let size = 0; size < 24; size++)
    assert.equal (readFrameSet (frameSet.slice (0, size).buffer), null);
  assert.equal (readFrameSet (speech.buffer), null);
  assert.equal (readFrameSet (Uint8Array.of (1, ...new Uint8Array (30)).buffer).units.length, 7);
  const large = new Uint8Array (MAX_FRAME_SET + 25);
  large[0] = 1;
  assert.equal (readFrameSet (large.buffer), null);
});

test ('an unknown delay counts as none', () => {
  const unknown = frameSet.slice ();
  unknown.fill (0xff, 12, 16);
  assert.equal (readFrameSet (unknown.buffer).delay, 0);
});

test ("the server's clock is that of the shortest exchange", () => {
  const clock = new ServerClock ();
  assert.equal (clock.toLocal (5), undefined);
  clock.add (100, 300, 5400); // 200 ms, apparently 5200 ahead
  clock.add (400, 410, 5405); // 10 ms: 5000 ahead
  clock.add (500, 560, 5600);
  assert.equal (clock.toLocal (6000), 1000);
});

test ('the audio of a segment may begin before it, and end in the middle of a packet', () => {
  const packet = (time, ...data) => { // RFC 4571, RFC 3550
    const bytes = new Uint8Array (14 + data.length), view = new DataView (bytes.buffer);
    view.setUint16 (0, 12 + data.length);
    view.setInt32 (6, time);
    bytes.set (data, 14);
    return [...bytes];
  };
  const bytes = Uint8Array.from ([...packet (-960, 1, 2), ...packet (0, 3), ...packet (960), ...packet (1920, 4, 5)]);
  const times = (size) => parseAudio (bytes.slice (0, size)).map (({ time, data }) => [time, ...data]);
  assert.deepEqual (times (bytes.length), [[-20, 1, 2], [0, 3], [20], [40, 4, 5]]);
  assert.deepEqual (times (bytes.length - 1), [[-20, 1, 2], [0, 3], [20], [40, 4]]);
  assert.deepEqual (times (20), [[-20, 1, 2]]);
  const { segments } = parsePlaylist ('#EXTM3U\n#EXT-X-RANGECAST-AUDIO:1.rtp\n#EXTINF:1,\n1.rcnc\n#EXTINF:1,\n2.rcnc\n', 'http://host/live.m3u8');
  assert.deepEqual (segments.map (({ audio }) => audio), ['http://host/1.rtp', undefined]);
});

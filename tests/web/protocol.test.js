// SPDX-License-Identifier: LGPL-2.1-or-later
// The page's side of docs/formats/web-protocol.md: frame sets from messages that come late, twice, cut off, or not at all.
import assert from 'node:assert/strict';
import test from 'node:test';
import { FrameAssembler, MAX_FRAME_SET, readMessage, ServerClock } from '../../pipelines/web/protocol.js';

// A message as the page of the protocol defines it, byte by byte.
const message = ({ kind = 1, flags = 0, count = 1, frameSet = 0, index = 0, number = 0, dropped = 0, delay = 0xffffffff, sent = 0n, units = [] }) => {
  const bytes = new Uint8Array (32 + units.length), view = new DataView (bytes.buffer);
  view.setUint8 (0, kind);
  view.setUint8 (1, flags);
  view.setUint16 (2, count, true);
  view.setUint32 (4, frameSet, true);
  view.setUint16 (8, index, true);
  view.setUint32 (12, number, true);
  view.setUint32 (16, dropped, true);
  view.setUint32 (20, delay, true);
  view.setBigUint64 (24, sent, true);
  bytes.set (units, 32);
  return bytes.buffer;
};
const assembled = (...messages) => {
  const delivered = [], assembler = new FrameAssembler ((frameSet) => delivered.push (frameSet));
  for (const one of messages)
    assert.ok (assembler.add (message (one)));
  return { delivered, assembler };
};
const bytesOf = (frameSet) => frameSet.units.flatMap ((units) => [...units]);

test ('a header gives its fields, times in milliseconds', () => {
  const { units, ...fields } = readMessage (message ({ flags: 3, count: 7, frameSet: 0xfffffffe, index: 6, number: 9, dropped: 4, delay: 2500, sent: 3000000n,
    units: [1, 2] }));
  assert.deepEqual (fields, { kind: 1, key: true, discontinuity: true, count: 7, frameSet: 0xfffffffe, index: 6, number: 9, dropped: 4, delay: 2.5, sent: 3000 });
  assert.deepEqual ([...units], [1, 2]);
});

test ('a message of another kind is ignored', () => {
  const assembler = new FrameAssembler (() => assert.fail ('delivered'));
  assert.equal (assembler.add (message ({ kind: 2, units: [1] })), true);
});
test ('a message that is too short or has an index beyond its count is refused', () => {
  const whole = message ({ units: [1] });
  for (let size = 0; size < 32; size++)
    assert.equal (readMessage (whole.slice (0, size)), null);
  assert.equal (readMessage (message ({ count: 0 })), null);
  assert.equal (readMessage (message ({ count: 2, index: 2 })), null);
});

test ('an unknown delay counts as none', () => assert.equal (readMessage (message ({})).delay, 0));

test ('a frame set is delivered when all its messages have come, in whatever order', () => {
  const { delivered } = assembled ({ count: 3, index: 2, units: [3] }, { count: 3, index: 0, units: [1] }, { count: 3, index: 1, units: [2] });
  assert.equal (delivered.length, 1);
  assert.deepEqual (bytesOf (delivered[0]), [3, 1, 2]);
});

test ('a later frame set delivers what there is of the one before', () => {
  const { delivered } = assembled ({ count: 2, units: [1] }, { frameSet: 1, units: [2] });
  assert.deepEqual (delivered.map ((one) => [one.frameSet, bytesOf (one)]), [[0, [1]], [1, [2]]]);
});

test ('messages of an earlier frame set are ignored, also beside one that is not complete', () => {
  const { delivered } = assembled ({ frameSet: 5, units: [1] }, { frameSet: 4, units: [2] }, { frameSet: 5, units: [3] }, { frameSet: 7, count: 2, units: [4] },
    { frameSet: 6, units: [5] }, { frameSet: 7, count: 2, index: 1, units: [6] });
  assert.deepEqual (delivered.map (bytesOf), [[1], [4, 6]]);
});

test ('numbers of frame sets go on after 2^32 - 1', () => {
  const { delivered } = assembled ({ frameSet: 0xffffffff }, { frameSet: 0 }, { frameSet: 0xffffffff });
  assert.deepEqual (delivered.map ((one) => one.frameSet), [0xffffffff, 0]);
});

test ('lost messages are those whose numbers are missing, not those that are late', () => {
  assert.equal (assembled ({ number: 0 }, { number: 3 }).assembler.lost, 2);
  assert.equal (assembled ({ number: 1 }, { number: 0 }, { number: 2 }).assembler.lost, 0);
});

test ('a frame set with more bytes than one may have is refused, and the next one is taken', () => {
  const delivered = [], assembler = new FrameAssembler ((frameSet) => delivered.push (frameSet));
  const half = new Uint8Array (MAX_FRAME_SET / 2 + 1);
  assert.ok (assembler.add (message ({ count: 3, units: half })));
  assert.equal (assembler.add (message ({ count: 3, index: 1, units: half })), false);
  assert.ok (assembler.add (message ({ frameSet: 1 })));
  assert.deepEqual (delivered.map ((one) => one.frameSet), [1]);
});

test ("the server's clock is that of the shortest exchange", () => {
  const clock = new ServerClock ();
  assert.equal (clock.toLocal (5), undefined);
  clock.add (100, 300, 5400); // 200 ms, apparently 5200 ahead
  clock.add (400, 410, 5405); // 10 ms: 5000 ahead
  clock.add (500, 560, 5600);
  assert.equal (clock.toLocal (6000), 1000);
});

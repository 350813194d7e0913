// SPDX-License-Identifier: LGPL-2.1-or-later
// The resolution that the page draws at, for GPUs of several speeds.
import assert from 'node:assert/strict';
import test from 'node:test';
import { Resolution } from '../../pipelines/web/resolution.js';

// Frame sets every `interval` ms, on a GPU that needs `fixed` ms and `pixels` ms more at full resolution.
const play = (resolution, { interval, fixed, pixels }, count = 200) => {
  const cost = () => fixed + pixels * resolution.scale ** 2, scales = [];
  for (let i = 0, due = 1e12; i < count; i++) {
    const skipped = Math.max (0, Math.ceil (cost () / interval) - 1);
    due += interval * (1 + skipped);
    resolution.follow ({ due, skipped });
    resolution.record (cost ());
    scales.push (resolution.scale);
  }
  return { cost: cost (), scales: scales.slice (-50) };
};

test ('a GPU that keeps up draws every pixel', () => {
  const resolution = new Resolution ();
  play (resolution, { interval: 66, fixed: 5, pixels: 40 });
  assert.equal (resolution.scale, 1);
});

for (const pixels of [70, 150, 250])
  test (`one that needs ${pixels} ms for all pixels draws fewer, steadily, and keeps up`, () => {
    const resolution = new Resolution (), { cost, scales } = play (resolution, { interval: 66, fixed: 15, pixels });
    assert.ok (cost <= 60 && resolution.scale < 1, `${cost} ms at ${resolution.scale}`);
    assert.equal (Math.min (...scales), Math.max (...scales));
  });

test ('there is a least resolution, and it is left again when the GPU has time', () => {
  const resolution = new Resolution ();
  play (resolution, { interval: 33, fixed: 100, pixels: 100 });
  assert.equal (resolution.scale, 0.4);
  play (resolution, { interval: 33, fixed: 2, pixels: 8 }, 1000);
  assert.equal (resolution.scale, 1);
});

test ('one slow picture changes nothing', () => {
  const resolution = new Resolution ();
  for (let i = 0; i < 100; i++)
    resolution.record (i % 10 === 0 ? 400 : 20);
  assert.equal (resolution.scale, 1);
});

test ('times that make no sense are passed over: the first frame set, a seek back, a pause', () => {
  const resolution = new Resolution ();
  for (const due of [1000, 1066, 500, 60000, 60000, 1])
    resolution.follow ({ due, skipped: 0 });
  assert.equal (resolution.interval, 66);
});

test ('a small window is drawn whole, and none with fewer pixels than 320x240', () => {
  const resolution = new Resolution ();
  resolution.scale = 0.4;
  assert.equal (resolution.scaleOf (300 * 200), 1);
  assert.equal (Math.round (resolution.scaleOf (640 * 480) * 640), 320);
  assert.equal (resolution.scaleOf (1920 * 1080), 0.4);
});

test ('a slow stream is no reason to draw fewer pixels', () => {
  const resolution = new Resolution ();
  play (resolution, { interval: 500, fixed: 20, pixels: 60 });
  assert.equal (resolution.scale, 1);
});

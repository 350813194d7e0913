// SPDX-License-Identifier: LGPL-2.1-or-later
// rangecast.wasm through core.js, as the page uses it. usage: node --test tests/web
import assert from 'node:assert/strict';
import crypto from 'node:crypto';
import fs from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import zlib from 'node:zlib';
import { Core, CoreFailure, DONE, END, FAILED, FATAL, NOTHING } from '../../pipelines/web/core.js';
import { HEAD, LAYER } from '../../pipelines/web/renderer.js';
import { accessUnits, build, byteStream, changedRigView, corpus, isRigView, joined, play, readStream, source, wasm, wasmFile } from './support.js';

// Not damaged: of its last frame set, which is cut off, tests/bitstream decodes what there is.
const STREAMS = ['coarse', 'default', 'entropy', 'exact', 'exact-packed', 'packed', 'temporal-entropy',
  'temporal-lossy', 'temporal-packed'];
const sums = new Map (fs.readFileSync (path.join (source, 'tests/data/SHA256SUMS'), 'utf8').trim ().split ('\n')
  .map ((line) => [line.slice (66), line.slice (0, 64)]));

// Full pictures of a view as tests/bitstream/decode.py writes them.
const fullPictures = (camera, view) => {
  const depth = Buffer.alloc (2 * camera.width * camera.height), colour = Buffer.alloc (3 * camera.width * camera.height);
  for (let y = 0; view && y < view.height; y++)
    for (let x = 0; x < view.width; x++) {
      const from = y * view.width + x, to = (view.y + y) * camera.width + view.x + x;
      if (view.depth[from] === 0)
        continue;
      depth.writeUInt16LE (view.depth[from], 2 * to);
      colour.set (view.colour.subarray (4 * from, 4 * from + 3), 3 * to);
    }
  return { depth, colour };
};

// Adds the pictures of the last frame set to digests by name, "depth-0.raw" and so on.
const addDigests = (core, digests) => {
  const views = core.views ();
  for (const camera of core.rig ())
    for (const [kind, bytes] of Object.entries (fullPictures (camera, views.find ((view) => view.id === camera.id)))) {
      const name = `${kind}-${camera.id}.raw`;
      if (!digests.has (name))
        digests.set (name, crypto.createHash ('sha256'));
      digests.get (name).update (bytes);
    }
};
const digestOfFrame = (core) => {
  const digests = new Map ();
  addDigests (core, digests);
  return [...digests].map (([name, hash]) => `${name} ${hash.digest ('hex')}`).join ('\n');
};

const expectGolden = (stream, digests) => {
  const expected = [...sums.keys ()].filter ((name) => name.startsWith (`${stream}-depth`) || name.startsWith (`${stream}-colour`));
  assert.ok (expected.length >= 2 && expected.length === digests.size, `${stream}: ${digests.size} pictures`);
  for (const [name, hash] of digests)
    assert.equal (hash.digest ('hex'), sums.get (`${stream}-${name}`), `${stream}-${name}`);
};

// All frame sets to the end. @return digests, and the sentence at the end
const playToEnd = (core) => {
  const digests = new Map ();
  let outcome;
  while ((outcome = core.next ()) === DONE)
    addDigests (core, digests);
  return { digests, outcome, message: core.message () };
};

const decodeFirst = (core = new Core (wasm)) => {
  core.pushUnits (joined (accessUnits (readStream ('default'))[0]));
  assert.equal (core.next (), DONE);
  return core;
};
const memoryOf = (core) => core.memory.buffer.byteLength;

for (const stream of STREAMS)
  test (`recording ${stream} decodes to the pictures of the specification`, () => {
    const { digests, outcome } = playToEnd (play (readStream (stream)));
    assert.equal (outcome, END);
    expectGolden (stream, digests);
  });

test ('access units decode as the recording does', () => {
  for (const stream of ['default', 'temporal-entropy', 'temporal-packed']) {
    const core = new Core (wasm), digests = new Map ();
    for (const units of accessUnits (readStream (stream))) {
      core.pushUnits (joined (units));
      assert.equal (core.next (), DONE);
      addDigests (core, digests);
    }
    expectGolden (stream, digests);
  }
});

test ('a lost slice costs its own pixels only', () => {
  const units = accessUnits (readStream ('packed'))[0], core = new Core (wasm);
  const lost = units.findIndex ((unit) => !isRigView (unit));
  core.pushUnits (joined (units.filter ((_, i) => i !== lost)));
  assert.equal (core.next (), DONE);
  const frame = core.frame ();
  assert.ok (frame.missingPixels > 0 && frame.points > 0);
  assert.equal (frame.badSlices, 0);
});

test ('units without a rig are no frame set and no error', () => {
  const core = new Core (wasm);
  core.pushUnits (joined (accessUnits (readStream ('default'))[0].filter ((unit) => !isRigView (unit))));
  assert.equal (core.next (), NOTHING);
  assert.equal (core.stream ().cameras, 0);
});

test ('every prefix of a recording ends with a sentence', () => {
  const bytes = readStream ('default'), core = new Core (wasm);
  let cutOff = 0;
  for (let size = 0; size < bytes.length; size += size < 300 || size > bytes.length - 100 ? 1 : 37) {
    const { outcome, message } = playToEnd (play (bytes.slice (0, size), core));
    if (outcome === END && message !== '') {
      assert.match (message, /^The recording is cut off: its last frame set has \d+ of \d+ bytes\.$/);
      cutOff++;
    }
    if (outcome === FATAL)
      assert.match (message, /^(This is no recording of gst-rangecast|The recording (ends before its first complete frame set|has no rig))/);
    assert.ok (outcome === END || outcome === FATAL);
  }
  assert.ok (cutOff > 20);
  assert.equal (core.renewals, 0);
});

test ('a foreign file is refused in one sentence', () => {
  for (const bytes of [new TextEncoder ().encode ('<!doctype html><title>404</title>'.repeat (200)), crypto.randomBytes (5 << 20), new Uint8Array (0)]) {
    const { outcome, message } = playToEnd (play (bytes));
    assert.equal (outcome, FATAL);
    assert.equal (message, 'This is no recording of gst-rangecast (.rcnc).');
  }
});

test ('a future version is refused in one sentence', () => {
  const bytes = readStream ('default');
  const version = (bytes[0] >> 4) + 1;
  for (let at = 0; at < bytes.length; at++)
    if (bytes[at] === 0 && bytes[at + 1] === 0x52 && bytes[at + 2] === 0x43 && bytes[at + 3] === 0x55)
      bytes[at - 4] = version << 4 | bytes[at - 4] & 15;
  const { outcome, message } = playToEnd (play (bytes));
  assert.equal (outcome, FATAL);
  assert.equal (message, `The recording cannot be read: bitstream version ${version} is not supported, only version ${version - 1}.`);
  const core = decodeFirst ();
  core.pushUnits (joined (accessUnits (readStream ('default'))[0].map ((unit) => { unit[0] = version << 4 | unit[0] & 15; return unit; })));
  assert.equal (core.next (), NOTHING);
});

test ('64 views are refused in one sentence', () => {
  const units = accessUnits (readStream ('default'))[0], view = units.find (isRigView);
  const views = Array.from ({ length: 64 }, (_, i) => changedRigView (view, { number: i, total: 64, id: i }));
  const slices = units.filter ((unit) => !isRigView (unit));
  const { outcome, message } = playToEnd (play (byteStream ([[...views, ...slices], slices])));
  assert.equal (outcome, FAILED);
  assert.equal (message, 'The rig has 64 views; the limit is 16.');
});

test ('a view of 16384 pixels is refused in one sentence', () => {
  const units = accessUnits (readStream ('exact'))[0];
  const made = units.map ((unit) => isRigView (unit) && unit[4] === 0 ? changedRigView (unit, { number: 0, total: unit[5], id: unit[20], width: 16384 }) : unit);
  const { outcome, message } = playToEnd (play (byteStream ([made])));
  assert.equal (outcome, FAILED);
  assert.equal (message, 'View 0 has 16384x36 pixels; the limit is 8192 each way.');
});

test ('seeking comes to the frame sets that playing comes to', () => {
  for (const stream of ['coarse', 'temporal-packed']) {
    const bytes = readStream (stream), core = play (bytes), shown = [];
    while (core.next () === DONE)
      shown.push ({ pts: core.frame ().time, digest: digestOfFrame (core) });
    assert.equal (core.stream ().duration, shown.at (-1).pts);
    for (const { pts, digest } of shown.slice ().reverse ()) {
      assert.equal (core.seek (pts + 0.001), DONE);
      do
        assert.equal (core.next (), DONE);
      while (core.frame ().time < pts);
      assert.equal (core.frame ().time, pts);
      assert.equal (digestOfFrame (core), digest, `${stream} at ${pts} ms`);
    }
  }
});

test ('the corpus of the fuzzers leaves an instance that works', () => {
  const core = new Core (wasm), limit = 64 << 20;
  let inputs = 0;
  for (const { name, bytes } of ['access_unit', 'byte_stream', 'parse', 'rig', 'rtp_depay', 'slice'].flatMap (corpus)) {
    play (bytes, core);
    for (let frames = 0; frames < 100 && core.next () === DONE; frames++)
      core.call ('rc_build', 1, 1, 40, 10, 0, 0, 0, 0, 0, 0);
    decodeFirst (core);
    core.pushUnits (bytes);
    core.next ();
    core.call ('rc_build', 0, 1, 0, 0, 0, 0, 0, 0, 0, 0);
    core.reset ();
    assert.equal (core.renewals, 0, name);
    assert.ok (memoryOf (core) < limit, `${name}: ${memoryOf (core)} bytes`);
    inputs++;
  }
  assert.ok (inputs > 500, `${inputs} inputs`);
});

for (const target of ['access_unit', 'byte_stream', 'rig', 'slice'])
  test (`fuzz target ${target} holds for its corpus`, () => {
    const module = new WebAssembly.Module (fs.readFileSync (path.join (build, 'tests/web', `fuzz_${target}.wasm`)));
    const core = new Core (module);
    let inputs = 0;
    for (const { name, bytes } of corpus (target)) {
      for (let k = 1; k <= 16; k++) {
        const part = bytes.subarray (0, Math.floor (bytes.length * k / 16));
        const at = core.exports.malloc (Math.max (part.length, 1));
        core.bytes (at, part.length).set (part);
        assert.doesNotThrow (() => core.exports.LLVMFuzzerTestOneInput (at, part.length), `${name}, ${part.length} bytes`);
        core.exports.free (at);
      }
      inputs++;
    }
    assert.ok (inputs > 0, `${inputs} inputs`);
  });

test ('an instance that runs out of memory is made anew', () => {
  const core = decodeFirst ();
  const left = (512 << 20) - memoryOf (core);
  core.memory.grow (left / 65536);
  assert.throws (() => core.memory.grow (1), RangeError); // the limit that meson.build states
  assert.throws (() => {
    for (let i = 0; i < 100; i++) {
      const units = joined (accessUnits (readStream ('exact'))[0]);
      core.pushUnits (joined (Array.from ({ length: 60 }, () => units)));
      core.input (new Uint8Array (20 << 20));
    }
  }, CoreFailure);
  assert.equal (core.renewals, 1);
  decodeFirst (core);
});

const buildScene = (core) => assert.equal (core.call ('rc_build', 1, 4 / 3, 0, 0, 0, 0, 0, 0, 0, 0), DONE);
const stateOf = (core) => {
  const state = core.record ('rc_scene_state');
  return core.bytes (state.address, state.size).slice ();
};

test ('each view of a frame set has vertices', () => {
  const core = decodeFirst ();
  buildScene (core);
  assert.equal (core.call ('rc_layers'), 2);
  for (let i = 0; i < 2; i++) {
    const { size } = core.record ('rc_layer', i);
    assert.ok (size > 1200 && size % 12 === 0);
  }
  assert.equal (core.call ('rc_layer', 2), 0);
});

test ('another instance draws the scene of the first', () => {
  const maker = decodeFirst (), camera = new Core (wasm);
  buildScene (maker);
  assert.ok (camera.input (stateOf (maker)));
  assert.equal (camera.call ('rc_camera_scene', stateOf (maker).length), DONE);
  const at = camera.call ('rc_camera_picture', 640, 480, 0), head = camera.floats (at, HEAD).slice ();
  assert.equal (head[17], 2); // layers
  const [x, y, width, height] = head.slice (8, 12);
  assert.ok (x >= 0 && y >= 0 && x + width <= 640 && y + height <= 480);
  assert.ok (height > 0.7 * 480 || width > 0.7 * 640, 'fitted to the person');
  assert.ok (camera.floats (at, HEAD + 2 * LAYER).every (Number.isFinite));
});

test ('another instance draws pictures of the scene in software', () => {
  const maker = decodeFirst (), camera = new Core (wasm), sizes = [];
  buildScene (maker);
  camera.input (stateOf (maker));
  camera.call ('rc_camera_scene', stateOf (maker).length);
  for (let i = 0; i < 2; i++) {
    const { vertices, size } = maker.record ('rc_layer', i);
    camera.bytes (camera.call ('rc_draw_layer', i, size), size).set (maker.bytes (vertices, size));
  }
  assert.equal (camera.call ('rc_draw_layer', 2, 12), 0);
  for (const [width, height] of [[1, 1], [3, 500], [640, 480]]) {
    const pixels = camera.bytes (camera.call ('rc_draw', width, height, 1), 4 * width * height);
    sizes.push (pixels.filter ((value, i) => i % 4 === 3 && value > 0).length);
  }
  assert.ok (sizes[2] > 0.05 * 640 * 480 && sizes[2] < 0.9 * 640 * 480, `${sizes}`);
});

test ('a damaged scene is refused', () => {
  const maker = decodeFirst (), camera = new Core (wasm);
  buildScene (maker);
  const state = stateOf (maker);
  for (const size of [0, 8, 16, 40, state.length - 8, state.length - 1]) {
    camera.input (state.subarray (0, size));
    assert.equal (camera.call ('rc_camera_scene', size), FAILED);
  }
  const many = state.slice ();
  new DataView (many.buffer).setUint32 (4, 0xffffffff, true); // points of the hull
  camera.input (many);
  assert.equal (camera.call ('rc_camera_scene', many.length), FAILED);
  assert.equal (camera.renewals, 0);
});

test ('shaders are for WebGL2', () => {
  const core = new Core (wasm);
  for (let i = 0; i < 12; i++)
    assert.match (core.text (core.call ('rc_shader', i)), /^#version 300 es\n[^]*void main/);
  assert.equal (core.call ('rc_shader', 12), 0);
});

// The dashboard (rig.*) is a page of its own.
test ('page and module are smaller than 150 KB, compressed', () => {
  const folder = path.join (source, 'pipelines/web');
  const page = fs.readdirSync (folder).filter ((name) => /^(?!rig).*\.(js|html|css)$/.test (name)).map ((name) => path.join (folder, name));
  const size = [wasmFile, ...page].reduce ((sum, file) => sum + zlib.gzipSync (fs.readFileSync (file)).length, 0);
  assert.ok (size < 150 * 1024, `${size} bytes`);
});

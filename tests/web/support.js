// SPDX-License-Identifier: LGPL-2.1-or-later
// What the tests of rangecast.wasm share: the module, recordings, and units made of theirs.
import fs from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { Core } from '../../pipelines/web/core.js';

export const source = process.env.RANGECAST_SOURCE ?? path.resolve (path.dirname (fileURLToPath (import.meta.url)), '../..');
export const build = process.env.RANGECAST_BUILD ?? path.join (source, 'build');
export const wasmFile = path.join (build, 'pipelines/web/rangecast.wasm');
export const wasm = new WebAssembly.Module (fs.readFileSync (wasmFile));

export const readStream = (name) => new Uint8Array (fs.readFileSync (path.join (source, 'tests/data', `${name}.rcnc`)));
export const corpus = (name) => {
  const folder = path.join (source, 'tests/fuzz/corpus', name);
  return fs.readdirSync (folder).sort ().map ((file) => ({ name: `${name}/${file}`, bytes: new Uint8Array (fs.readFileSync (path.join (folder, file))) }));
};

// An instance with a recording of these bytes.
export const play = (bytes, core = new Core (wasm)) => {
  core.read = (offset, size) => bytes.subarray (offset, offset + size);
  core.call ('rc_open', bytes.length);
  return core;
};

const u16 = (bytes, at) => bytes[at] | bytes[at + 1] << 8;

// Access units of a sound byte stream, each a list of its units without the access-unit unit.
export const accessUnits = (bytes) => {
  const all = [];
  for (let at = 0; at < bytes.length;) {
    const size = u16 (bytes, at + 2), length = new DataView (bytes.buffer, bytes.byteOffset + at + 8).getUint32 (0, true);
    const units = [];
    for (let unit = at + size; unit < at + size + length; unit += u16 (bytes, unit + 2))
      units.push (bytes.slice (unit, unit + u16 (bytes, unit + 2)));
    all.push (units);
    at += size + length;
  }
  return all;
};

export const joined = (parts) => {
  const whole = new Uint8Array (parts.reduce ((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set (part, at);
    at += part.length;
  }
  return whole;
};

export const isRigView = (unit) => (unit[0] & 15) === 2;

// A rig view unit of another number, id and size (docs/formats/bitstream.md, rig.md).
export const changedRigView = (unit, { number, total, id, width, height }) => {
  const made = unit.slice (), name = made[22], view = new DataView (made.buffer);
  made[4] = number;
  made[5] = total;
  made[20] = id;
  if (width)
    view.setUint16 (23 + name, width, true);
  if (height)
    view.setUint16 (25 + name, height, true);
  return made;
};

// A byte stream of access units that are lists of units.
export const byteStream = (units) => joined (units.flatMap ((list, i) => {
  const header = new Uint8Array (28), view = new DataView (header.buffer);
  header.set ([0x43, 1, 28, 0, 0x00, 0x52, 0x43, 0x55]);
  view.setUint32 (8, list.reduce ((sum, unit) => sum + unit.length, 0), true);
  view.setBigUint64 (12, BigInt (i) * 40000000n, true);
  return [header, ...list];
}));

// SPDX-License-Identifier: LGPL-2.1-or-later
// rangecast.wasm beside the same decoder compiled for this machine without AVX2 (RANGECAST_CPU=scalar), and with it: milliseconds of a
// frame set, medians of rounds in turn, and the median of the rounds' ratios.
// usage: node tests/bench/web/decode.mjs [--rounds N] [FILE.rcnc...]   (default: four views of 320x240, each profile)
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { expect, readArguments } from './arguments.mjs';
import { Core, DONE } from '../../../pipelines/web/core.js';

const { values, positionals: files } = readArguments ({ rounds: { type: 'string', default: '9' } }, true);
const rounds = Number (values.rounds);
expect (Number.isInteger (rounds) && rounds >= 1 && rounds <= 1000, `--rounds: expected 1 to 1000, got '${values.rounds}'`);
for (const file of files)
  expect (fs.existsSync (file), `no file '${file}'`);
const { accessUnits, build, joined, wasm } = await import ('../../web/support.js');

const folder = fs.mkdtempSync (path.join (os.tmpdir (), 'rangecast-'));
process.on ('exit', () => fs.rmSync (folder, { recursive: true }));
const record = (name, ...settings) => {
  const file = path.join (folder, name + '.rcnc');
  execFileSync ('gst-launch-1.0', ['-q', 'avatartestsrc', 'views=4', 'num-buffers=30', 'range-person-only=true', '!', 'video/x-range,width=320,height=240', '!',
    'neighbourcodeenc', ...settings, '!', 'filesink', `location=${file}`],
  { env: { ...process.env, GST_PLUGIN_PATH: path.join (build, 'gst') } });
  return { name, file };
};

const medianOf = (values) => [...values].sort ((a, b) => a - b)[values.length >> 1];
const native = (file, cpu) => Number (execFileSync (path.join (build, 'tests/bench/decode_bench'), [file],
  { env: { ...process.env, ...cpu && { RANGECAST_CPU: cpu } } }));
const core = new Core (wasm);
const decodeAll = (frameSets) => {
  core.reset ();
  return frameSets.reduce ((done, units) => {
    core.pushUnits (units);
    return done + (core.next () === DONE);
  }, 0);
};
const inNode = (file) => {
  const frameSets = accessUnits (new Uint8Array (fs.readFileSync (file))).map (joined);
  decodeAll (frameSets);
  const begin = performance.now (), done = decodeAll (frameSets);
  return (performance.now () - begin) / done;
};

const recordings = files.length > 0 ? files.map ((file) => ({ name: path.basename (file), file }))
  : ['plain', 'packed', 'entropy'].flatMap ((profile) => [record (profile, `profile=${profile}`), record (`${profile}-temporal`, `profile=${profile}`, 'temporal=true')]);
console.log ('| recording | wasm ms | native, scalar ms | ratio | native ms |\n|---|---|---|---|---|');
for (const { name, file } of recordings) {
  const rows = Array.from ({ length: rounds }, () => ({ wasm: inNode (file), scalar: native (file, 'scalar'), best: native (file) }));
  const median = (of) => medianOf (rows.map (of)).toFixed (2);
  console.log (`| ${name} | ${median ((row) => row.wasm)} | ${median ((row) => row.scalar)} | ${median ((row) => row.wasm / row.scalar)} | ${median ((row) => row.best)} |`);
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// What clients cost rangewebsink: CPU time of the server's process per client and second, over that without clients.
// usage: node clients.mjs [--seconds N] [--clients LIST]   (after: tests/web/page.sh has installed ws; RANGECAST_BUILD)
// Clients are WebSockets without a page, which acknowledge at once; with "stalled" every second one never does.
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { expect, readArguments } from './arguments.mjs';

const { values } = readArguments ({ seconds: { type: 'string', default: '10' }, clients: { type: 'string', default: '0,1,10,50' } });
const seconds = Number (values.seconds);
expect (seconds > 0 && seconds <= 3600, `--seconds: expected 1 to 3600, got '${values.seconds}'`);
expect (/^\d{1,2}(,\d{1,2})*$/.test (values.clients), `--clients: expected numbers up to 99, e.g. 0,1,10, got '${values.clients}'`);
const { sleep } = await import ('../../web/browser.js');
const { client, killServers, memory, serve } = await import ('../../web/serving.js');

const ticks = Number (execFileSync ('getconf', ['CLK_TCK']));
const scene = ['avatartestsrc', 'is-live=true', 'views=4', 'range-person-only=true', '!', 'video/x-range,width=320,height=240,framerate=15/1'];
const cpu = ({ process: { pid } }) => {
  const fields = fs.readFileSync (`/proc/${pid}/stat`, 'utf8').split (') ')[1].split (' ');
  return (Number (fields[11]) + Number (fields[12])) / ticks;
};
const folder = fs.mkdtempSync (path.join (os.tmpdir (), 'clients-'));
execFileSync ('openssl', ['req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes', '-days', '2', '-subj', '/CN=localhost',
  '-keyout', path.join (folder, 'key.pem'), '-out', path.join (folder, 'cert.pem')], { stdio: 'ignore' });
const tls = [`certificate=${path.join (folder, 'cert.pem')}`, `private-key=${path.join (folder, 'key.pem')}`];

console.log ('| clients | frame sets/s each: least, median | left out | CPU, ms a client and second | Mbit/s each | server, MB |\n|---|---|---|---|---|---|');
for (const [name, settings, stalls] of [['', [], false], [', TLS', tls, false], [', every second one stalled', [], true]]) {
  const server = await serve (['port=0', 'max-clients=100', ...settings], [], scene);
  let idle = 0;
  for (const count of values.clients.split (',').map (Number)) {
    if (count === 0 && name !== '' && idle > 0)
      continue;
    const clients = Array.from ({ length: count }, (_, i) => client (server.address, { acknowledges: !(stalls && i % 2 === 1) }));
    for (const one of clients)
      await one.until (({ frames }) => frames.length > 0, 'a frame set');
    await sleep (2000);
    for (const { frames } of clients)
      frames.length = 0;
    const before = cpu (server), begin = performance.now ();
    await sleep (1000 * seconds);
    const elapsed = (performance.now () - begin) / 1000, used = (cpu (server) - before) / elapsed;
    const alive = clients.filter ((_, i) => !(stalls && i % 2 === 1));
    const rates = alive.map (({ frames }) => frames.length / elapsed).toSorted ((a, b) => a - b);
    const left = alive.reduce ((sum, { frames }) => sum + frames.at (-1).dropped - frames[0].dropped, 0);
    const bits = alive.reduce ((sum, { frames }) => sum + frames.reduce ((bytes, frame) => bytes + 8 * frame.bytes, 0), 0) / elapsed / 1e6;
    if (count === 0)
      idle = used;
    console.log (`| ${count}${name} | ${count ? `${rates[0].toFixed (1)}, ${rates[rates.length >> 1].toFixed (1)}` : ''} | ${count ? left : ''} | ` +
      `${count ? (1000 * (used - idle) / count).toFixed (2) : `${(1000 * idle).toFixed (0)} in all`} | ${count ? (bits / alive.length).toFixed (2) : ''} | ${(memory (server) / 1e6).toFixed (0)} |`);
    for (const { socket } of clients)
      socket.terminate ();
    await sleep (500);
  }
  await server.stop ();
}
killServers ();
fs.rmSync (folder, { recursive: true });

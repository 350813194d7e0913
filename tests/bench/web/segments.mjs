// SPDX-License-Identifier: LGPL-2.1-or-later
// What clients that fetch segments cost nginx, beside clients of rangewebsink: CPU time of the server's processes per client and second.
// usage: node segments.mjs [--seconds N] [--clients N]   (after: tests/web/page.sh has installed ws; rangecast and nginx in the PATH; RANGECAST_BUILD)
// A client reads the playlist twice a second over one connection, and each new segment once, as the page does.
import { execFileSync, spawn } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import { expect, readArguments } from './arguments.mjs';

const { values } = readArguments ({ seconds: { type: 'string', default: '10' }, clients: { type: 'string', default: '500' } });
const seconds = Number (values.seconds), count = Number (values.clients);
expect (seconds > 0 && seconds <= 3600, `--seconds: expected 1 to 3600, got '${values.seconds}'`);
expect (count > 0 && count <= 1000, `--clients: expected 1 to 1000, got '${values.clients}'`);
const { sleep } = await import ('../../web/browser.js');
const { client, freePort, killServers, serve } = await import ('../../web/serving.js');

const ticks = Number (execFileSync ('getconf', ['CLK_TCK']));
const cpu = (pids) => pids.reduce ((sum, pid) => {
  const fields = fs.readFileSync (`/proc/${pid}/stat`, 'utf8').split (') ')[1].split (' ');
  return sum + (Number (fields[11]) + Number (fields[12])) / ticks;
}, 0);
const children = (pid) => fs.readFileSync (`/proc/${pid}/task/${pid}/children`, 'utf8').split (' ').filter (Boolean).map (Number);
const scene = ['avatartestsrc', 'is-live=true', 'views=4', 'range-person-only=true', '!', 'video/x-range,width=320,height=240,framerate=15/1'];
const row = (name, requests, used, bits) => console.log (`| ${name} | ${requests} | ${used.toFixed (2)} | ${bits.toFixed (2)} |`);
console.log ('| server, clients | requests/s | CPU, ms a client and second | Mbit/s each |\n|---|---|---|---|');

const folder = fs.mkdtempSync (path.join (os.tmpdir (), 'segments-')), port = await freePort ();
fs.chmodSync (folder, 0o755); // for nginx's user
fs.writeFileSync (path.join (folder, 'nginx.conf'), `pid ${folder}/pid; error_log ${folder}/errors; daemon off; worker_rlimit_nofile 4096;
  events { worker_connections 2048; } http { access_log off; sendfile on; keepalive_requests 100000; server { listen 127.0.0.1:${port}; root ${folder}; } }`);
const nginx = spawn ('nginx', ['-c', path.join (folder, 'nginx.conf')], { stdio: 'inherit' });
const publisher = spawn ('rangecast', ['publish', folder, '--source', [...scene, '! neighbourcodeenc'].join (' ')], { stdio: 'inherit' });
const list = path.join (folder, 'live.m3u8');
while (!fs.existsSync (list))
  await sleep (100);

let requests = 0, bytes = 0, failures = 0, running = true;
const get = (agent, name) => new Promise ((resolve) => http.get ({ host: '127.0.0.1', port, agent, path: `/${name}` }, (answer) => {
  const parts = [];
  requests++;
  failures += answer.statusCode !== 200;
  answer.on ('data', (data) => {
    bytes += data.length;
    if (name === 'live.m3u8')
      parts.push (data);
  });
  answer.on ('end', () => resolve (String (Buffer.concat (parts))));
}).on ('error', () => resolve ('', failures++)));
const follow = async () => {
  const agent = new http.Agent ({ keepAlive: true, maxSockets: 1 });
  await sleep (500 * Math.random ());
  for (let last; running; await sleep (500)) {
    const newest = (await get (agent, 'live.m3u8')).match (/^\d+\.rcnc$/mg)?.at (-1);
    if (newest && newest !== last)
      await get (agent, last = newest);
  }
  agent.destroy ();
};
const clients = Array.from ({ length: count }, follow);
await sleep (3000);
requests = bytes = 0;
const workers = children (nginx.pid), before = cpu (workers), begin = performance.now ();
await sleep (1000 * seconds);
const elapsed = (performance.now () - begin) / 1000;
row (`nginx, ${count}`, Math.round (requests / elapsed), 1000 * (cpu (workers) - before) / elapsed / count, 8 * bytes / elapsed / count / 1e6);
running = false;
await Promise.all (clients);
publisher.kill ('SIGINT');
nginx.kill ();

const server = await serve (['port=0', 'max-clients=100'], [], scene), pids = [server.process.pid];
await sleep (2000);
const idleBefore = cpu (pids);
await sleep (1000 * seconds);
const idle = cpu (pids) - idleBefore, sockets = Array.from ({ length: 50 }, () => client (server.address));
for (const one of sockets)
  await one.until (({ frames }) => frames.length > 0, 'a frame set');
await sleep (2000);
for (const { frames } of sockets)
  frames.length = 0;
const busyBefore = cpu (pids);
await sleep (1000 * seconds);
const bits = sockets.reduce ((sum, { frames }) => sum + frames.reduce ((all, frame) => all + 8 * frame.bytes, 0), 0) / seconds / 1e6;
row ('rangewebsink, 50', '', 1000 * (cpu (pids) - busyBefore - idle) / seconds / 50, bits / 50);
await server.stop ();
killServers ();
fs.rmSync (folder, { recursive: true, force: true });
if (failures > 0)
  console.error (`${failures} requests failed`);
process.exit (failures > 0 ? 1 : 0);

// SPDX-License-Identifier: LGPL-2.1-or-later
// rangewebsink in a launch string of its own process, and clients of it without a page.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import net from 'node:net';
import { required, sleep } from './browser.js';

const { WebSocket } = required ('ws');
const servers = new Set ();
export const killServers = () => {
  for (const server of servers)
    server.kill ('SIGKILL');
};

const people = ['avatartestsrc', 'is-live=true', 'views=4', 'range-person-only=true', '!', 'video/x-range,width=160,height=120,framerate=15/1'];
// settings: of rangewebsink, and what follows it; encoder: of neighbourcodeenc; scene: the source; env: added to the environment. Resolves when it listens: { address, port, process, log (), stop (signal): exit status or signal }.
export const serve = async (settings = [], encoder = [], scene = people, env = {}) => {
  const server = spawn ('gst-launch-1.0', ['-m', ...scene, '!', 'neighbourcodeenc', ...encoder, '!', 'rangewebsink', 'sync=false', ...settings],
    { env: { ...process.env, ...env } });
  servers.add (server);
  let log = '';
  const ended = new Promise ((resolve) => server.on ('exit', (status, signal) => {
    servers.delete (server);
    resolve (signal ?? status);
  }));
  const address = await new Promise ((resolve, reject) => {
    const take = (data) => {
      log = (log + data).slice (-100000);
      const url = /rangewebsink-address, url=\(string\)"?(https?:[^;"]*?)\/?"?;/.exec (log);
      if (url)
        resolve (url[1].replaceAll ('\\', ''));
    };
    server.stdout.on ('data', take);
    server.stderr.on ('data', take);
    ended.then (() => reject (new Error (`the server ended: ${log}`)));
  });
  return { address, port: Number (new URL (address).port), process: server, log: () => log, stop: async (signal = 'SIGINT') => {
    server.kill (signal);
    return ended;
  } };
};
// A port that was free a moment ago.
export const freePort = () => new Promise ((resolve) => {
  const probe = net.createServer ().listen (0, '127.0.0.1', () => {
    const { port } = probe.address ();
    probe.close (() => resolve (port));
  });
});

// A client without a page. acknowledges: how it answers frame sets
export const client = (address, { hello = { type: 'hello', version: 1 }, acknowledges = true, ...options } = {}) => {
  const socket = new WebSocket (`${address.replace (/^http/, 'ws')}/stream`, 'rangecast.v1', { rejectUnauthorized: false, ...options });
  const seen = { socket, texts: [], frames: [], speech: [] };
  seen.closed = new Promise ((resolve) => socket.on ('close', (code, reason) => resolve ({ code, reason: String (reason) })));
  socket.on ('error', (error) => { seen.error = error; });
  socket.on ('open', () => hello && socket.send (JSON.stringify (hello)));
  socket.on ('message', (data, binary) => {
    if (!binary)
      return seen.texts.push (JSON.parse (data));
    if (data.readUInt8 (0) === 2)
      return seen.speech.push ({ number: data.readUInt32LE (4), captured: Number (data.readBigUInt64LE (8)) / 1000, bytes: data.length - 16 });
    const frameSet = data.readUInt32LE (4);
    seen.frames.push ({ frameSet, key: (data.readUInt8 (1) & 1) !== 0, dropped: data.readUInt32LE (8), bytes: data.length, firstUnit: data.readUInt8 (24) & 15 });
    if (acknowledges)
      socket.send (JSON.stringify ({ type: 'ack', frameSet }));
  });
  seen.until = async (condition, what) => {
    for (let i = 0; i < 600 && !condition (seen); i++)
      await sleep (50);
    assert.ok (condition (seen), `${what}: ${JSON.stringify ([seen.texts, seen.frames.slice (-3), seen.error?.message])}`);
  };
  return seen;
};

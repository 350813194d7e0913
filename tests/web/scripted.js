// SPDX-License-Identifier: LGPL-2.1-or-later
// A server of the page whose WebSocket a test plays.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { openPage, required } from './browser.js';
import { build } from './support.js';

const { WebSocketServer } = required ('ws');
const folder = path.join (build, 'pipelines/web');
const types = { html: 'text/html', js: 'text/javascript', css: 'text/css', wasm: 'application/wasm' };

// A page of that name and, for each connection to its server, script (client, number), where client has next () for messages, send (),
// welcome (), frameSet ().
export const withServer = async (browser, script, use, name = '') => {
  const server = http.createServer ((request, answer) => {
    const name = new URL (request.url, 'http://here').pathname.slice (1) || 'index.html', file = path.join (folder, path.basename (name));
    if (name === 'server.json' || !fs.existsSync (file)) {
      answer.writeHead (name === 'server.json' ? 200 : 404, { 'Content-Type': 'application/json' });
      answer.end (JSON.stringify ({ version: 1, token: false, title: 'a script' }));
    } else {
      answer.writeHead (200, { 'Content-Type': types[name.split ('.').pop ()] });
      fs.createReadStream (file).pipe (answer);
    }
  });
  const sockets = new WebSocketServer ({ server, path: '/stream', handleProtocols: (protocols) => protocols.has ('rangecast.v1') ? 'rangecast.v1' : false });
  const errors = [];
  let connections = 0;
  sockets.on ('connection', (socket) => script (clientOf (socket), connections++).catch ((error) => socket.readyState === 1 && errors.push (error)));
  await new Promise ((resolve) => server.listen (0, '127.0.0.1', resolve));
  const page = await openPage (browser, `http://127.0.0.1:${server.address ().port}/${name}`);
  try {
    await use (page, { connections: () => connections });
    assert.deepEqual (errors, []);
  } finally {
    await page.close ();
    for (const socket of sockets.clients)
      socket.terminate ();
    server.close ();
    server.closeAllConnections ();
  }
};

const clientOf = (socket) => {
  const received = [], waiting = [];
  socket.on ('error', () => {});
  socket.on ('message', (data) => {
    const parsed = JSON.parse (String (data));
    if (parsed.type === 'ping')
      return;
    if (waiting.length > 0)
      waiting.shift () (parsed);
    else
      received.push (parsed);
  });
  let sent = 0;
  const client = {
    socket, send: (data) => socket.send (typeof data === 'string' || data instanceof Uint8Array ? data : JSON.stringify (data)),
    next: () => received.length > 0 ? Promise.resolve (received.shift ()) : new Promise ((resolve) => waiting.push (resolve)),
    welcome: async () => {
      const hello = await client.next ();
      assert.equal (hello.type, 'hello');
      assert.equal (hello.version, 1);
      client.send ({ type: 'welcome', version: 1, window: 3, audio: false });
    },
    // Resolves when it is acknowledged.
    frameSet: async (units, frameSet = sent++, { flags = 1, dropped = 0 } = {}) => {
      const header = Buffer.alloc (24);
      header.writeUInt8 (1, 0);
      header.writeUInt8 (flags, 1);
      header.writeUInt32LE (frameSet >>> 0, 4);
      header.writeUInt32LE (dropped, 8);
      header.writeUInt32LE (0xffffffff, 12);
      client.send (Buffer.concat ([header, units]));
      for (let answer; answer?.frameSet !== frameSet >>> 0 || answer.type !== 'ack';)
        answer = await client.next ();
    },
  };
  return client;
};

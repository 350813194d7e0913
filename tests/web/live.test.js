// SPDX-License-Identifier: LGPL-2.1-or-later
// The page and rangewebsink, in launch strings of their own processes: live pictures, servers that go and return, clients that stall.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import dgram from 'node:dgram';
import fs from 'node:fs';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { frameSets, framesShown, launch, message, messageMatches, openPage, sleep, work } from './browser.js';
import { client, closes, freePort, killServers, memory, serve } from './serving.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

// ---- the page ----

test ('the page shows a live stream, and reports its latency', async () => {
  const server = await serve (['port=0', 'title="A person"']);
  const page = await openPage (browser, `${server.address}/?stats`);
  await framesShown (page, 20);
  assert.equal (await message (page), '');
  assert.equal (await page.title (), 'A person');
  assert.equal (await page.$eval ('#bar', (bar) => bar.className), 'live');
  await page.waitForFunction (() => /WebSocket: \d+ frame sets dropped/.test (document.getElementById ('stats').textContent));
  const latencies = await page.evaluate (() => window.rangecastPage.stats.latencies);
  assert.ok (latencies.length > 10 && latencies.every ((ms) => ms > 0 && ms < 10000), JSON.stringify (latencies));
  fs.writeFileSync (path.join (work, 'page-live.png'), await page.screenshot ());
  await page.close ();
  await server.stop ();
});

test ('with temporal prediction, too, a viewer begins with a whole picture', async () => {
  const server = await serve (['port=0'], ['profile=entropy', 'temporal=true', 'refresh-period=0', 'key-interval=0']);
  for (let i = 0; i < 2; i++) {
    const page = await openPage (browser, `${server.address}/?stats`);
    await framesShown (page, 20);
    await page.waitForFunction (() => / unknown 0 pixels/.test (document.getElementById ('stats').textContent));
    await page.close ();
  }
  await server.stop ();
});

test ('a server that is killed and returns is found again', async () => {
  const port = await freePort ();
  const first = await serve ([`port=${port}`]), page = await openPage (browser, first.address);
  await framesShown (page, 5);
  await first.stop ('SIGKILL');
  await messageMatches (page, '^The (connection was lost|server cannot be reached); trying again\\.$');
  const second = await serve ([`port=${port}`]), shown = await frameSets (page);
  await framesShown (page, shown + 5);
  assert.equal (await message (page), '');
  await page.close ();
  await second.stop ();
});

test ('the token of the link lets in, and leaves the address', async () => {
  const server = await serve (['port=0', 'token=correct']);
  const page = await openPage (browser, `${server.address}/#token=correct`);
  await framesShown (page, 3);
  assert.ok (!page.url ().includes ('correct'));
  await page.evaluate (() => sessionStorage.clear ());
  await page.goto (`${server.address}/`);
  await page.waitForSelector ('#token:not([hidden])');
  assert.match (await message (page), /^This server requires a token\.$/);
  assert.ok (!server.log ().includes ('correct'));
  await page.close ();
  await server.stop ();
});

test ('a browser that stands still for ten seconds slows nobody, and goes on', async () => {
  const server = await serve (['port=0']);
  const stalled = await launch ();
  try {
    const page = await openPage (stalled, server.address), other = client (server.address);
    await framesShown (page, 5);
    const all = execFileSync ('ps', ['-eo', 'pid=,ppid=']).toString ().trim ().split ('\n').map ((line) => line.trim ().split (/\s+/).map (Number));
    const pids = [stalled.process ().pid];
    for (let i = 0; i < pids.length; i++)
      pids.push (...all.filter (([, parent]) => parent === pids[i]).map (([pid]) => pid));
    for (const pid of pids)
      process.kill (pid, 'SIGSTOP');
    const before = { memory: memory (server), frames: other.frames.length };
    await sleep (10000);
    const after = { memory: memory (server), frames: other.frames.length };
    for (const pid of pids)
      process.kill (pid, 'SIGCONT');
    assert.ok (after.frames - before.frames > 75, `the other client got ${after.frames - before.frames} of 150 frame sets`);
    assert.ok (after.memory < before.memory + 16e6, `${before.memory} to ${after.memory} bytes`);
    const shown = await frameSets (page);
    await framesShown (page, shown + 10);
    other.socket.close ();
  } finally {
    await stalled.close ();
    await server.stop ();
  }
});

test ('the dashboard shows what hosts report', async () => {
  const port = await freePort (), server = await serve (['port=0', `stats-address=udp://127.0.0.1:${port}`]);
  const page = await openPage (browser, `${server.address}/rig`), host = dgram.createSocket ('udp4');
  const report = (text) => new Promise ((resolve) => host.send (text, port, '127.0.0.1', resolve));
  await framesShown (page, 3);
  for (const text of ['rubbish', '[1,2]', '{"host":"x"}', `{"host":"${'y'.repeat (9000)}","name":"n","element":"e"}`, '['.repeat (5000)])
    await report (text);
  await report (JSON.stringify ({ host: 'camera1', element: 'stereodepth', name: 'depth', 'view-ids': [1], fps: 14.9, time: Date.now () / 1000 - 2 }));
  await report (JSON.stringify ({ host: 'camera1', name: 'source', warning: 'Camera lost', time: Date.now () / 1000 }));
  await page.waitForFunction (() => document.querySelectorAll ('#elements tbody tr').length === 1);
  const cells = await page.$eval ('#elements tbody tr', (row) => [...row.cells].map ((cell) => cell.textContent));
  assert.deepEqual (cells.slice (0, 4), ['camera1', 'depth', '1', '14.9']);
  assert.ok (Math.abs (Number (cells[10]) - 2000) < 500, `clock: ${cells[10]} ms`);
  await page.waitForFunction (() => /Camera lost/.test (document.getElementById ('warnings').textContent));
  await page.waitForFunction (() => document.querySelectorAll ('#views tbody tr').length === 4);
  host.close ();
  await page.close ();
  await server.stop ();
});

// ---- clients without a page ----

test ('twenty clients and a page get the stream, and leave', async () => {
  const server = await serve (['port=0']), page = await openPage (browser, server.address);
  const clients = Array.from ({ length: 20 }, () => client (server.address));
  for (const one of clients) {
    await one.until (({ frames }) => frames.length >= 30, 'thirty frame sets');
    assert.equal (one.texts[0].type, 'welcome');
    assert.ok (one.frames[0].key);
    assert.equal (one.frames[0].firstUnit, 2, 'the rig comes first');
  }
  await framesShown (page, 5);
  for (const one of clients)
    one.socket.terminate ();
  const shown = await frameSets (page);
  await framesShown (page, shown + 10);
  await page.close ();
  await server.stop ();
});

test ('a client gets nothing before its hello, and is closed if none comes', async () => {
  const server = await serve (['port=0', 'hello-timeout=1500', 'token=t']), silent = client (server.address, { hello: null });
  await closes (silent, 4408, /no hello in time/);
  assert.deepEqual ([silent.texts, silent.frames], [[], []]);
  await server.stop ();
});

// With the log of what clients do wrong.
process.env.GST_DEBUG = 'rangewebsink:4';

const rubbish = [
  ['text that is not JSON', 'rubbish', 4400],
  ['JSON without a type', '{"a":1}', 4400],
  ['deeply nested JSON', '['.repeat (16000), 4400],
  ['another first message', '{"type":"ack","frameSet":1}', 4400],
  ['a version that is no number', '{"type":"hello","version":"1"}', 4400],
  ['another version', '{"type":"hello","version":2}', 4406],
  ['a token that is no text', '{"type":"hello","version":1,"token":7}', 4400],
  ['no token', '{"type":"hello","version":1}', 4401],
  ['a wrong token', '{"type":"hello","version":1,"token":"secre"}', 4401],
  ['an oversized message', `{"type":"hello","version":1,"token":"${'x'.repeat (20000)}"}`, 1009],
  ['a binary message', Buffer.alloc (10), 1003],
];
test ('what breaks the protocol closes that connection only', async () => {
  const server = await serve (['port=0', 'token=secret']), good = client (server.address, { hello: { type: 'hello', version: 1, token: 'secret' } });
  for (const [what, data, code] of rubbish) {
    const one = client (server.address, { hello: null });
    one.socket.on ('open', () => one.socket.send (data));
    const closed = await one.closed;
    assert.equal (closed.code, code, `${what}: ${JSON.stringify (closed)}`);
    assert.deepEqual ([one.texts, one.frames], [[], []], what);
  }
  const entered = { type: 'hello', version: 1, token: 'secret' };
  for (const [what, data, code] of [['a wrong acknowledgement', '{"type":"ack","frameSet":-1}', 4400], ['a ping without a time', '{"type":"ping"}', 4400]]) {
    const one = client (server.address, { hello: entered });
    one.socket.on ('open', () => one.socket.send (data));
    assert.equal ((await one.closed).code, code, what);
  }
  const endless = client (server.address, { hello: entered });
  endless.socket.on ('open', async () => {
    for (let i = 0; i < 100 && endless.socket.readyState === 1; i++) {
      endless.socket.send ('x'.repeat (1000), { fin: false }); // fragments of a message without end
      await sleep (1);
    }
  });
  assert.equal ((await endless.closed).code, 1006);
  const fast = client (server.address, { hello: entered });
  fast.socket.on ('open', () => { for (let i = 0; i < 300; i++) fast.socket.send ('{"type":"x"}'); });
  await closes (fast, 4429, /at most 200 messages a second/);
  for (const sentence of ['wrong or missing token', 'expected text messages', 'a message of more than 16384 bytes', 'expected version 1', 'at most 200 messages a second'])
    assert.match (server.log (), new RegExp (`closing the connection of 127\\.0\\.0\\.1: ${sentence}`));
  const count = good.frames.length;
  await good.until (({ frames }) => frames.length > count + 5, 'frame sets go on');
  good.socket.close ();
  await server.stop ();
});

test ('pages of other servers are refused, unless the origin is allowed', async () => {
  const server = await serve (['port=0', 'origins="https://friend.example https://other.example:8443"']);
  for (const [origin, allowed] of [['https://evil.example', false], ['null', false], ['https://friend.example', true], ['https://other.example:8443', true],
    ['https://other.example', false], [server.address, true]]) {
    const one = client (server.address, { origin });
    await Promise.race ([one.until (({ texts, error }) => texts.length > 0 || error, 'an answer'), one.closed]);
    assert.equal (one.texts.length > 0, allowed, `${origin}: ${one.error?.message}`);
    if (!allowed)
      assert.match (one.error.message, /403/);
    one.socket.terminate ();
  }
  await server.stop ();
});

test ('one client too many is told so', async () => {
  const server = await serve (['port=0', 'max-clients=2']), two = [client (server.address), client (server.address)];
  for (const one of two)
    await one.until (({ frames }) => frames.length > 0, 'a frame set');
  await closes (client (server.address), 4429, /at most 2 viewers/);
  two[0].socket.close ();
  await two[0].closed;
  await sleep (200);
  const third = client (server.address);
  await third.until (({ frames }) => frames.length > 0, 'a frame set');
  await server.stop ();
});

test ('a client that does not acknowledge gets the window, and then a key frame set', async () => {
  const server = await serve (['port=0', 'window=3', 'key-unit-interval=100'], ['profile=entropy', 'temporal=true', 'refresh-period=0', 'key-interval=0']);
  const slow = client (server.address, { acknowledges: false });
  await slow.until (({ frames }) => frames.length === 3, 'three frame sets');
  await sleep (1500);
  assert.equal (slow.frames.length, 3);
  slow.socket.send (JSON.stringify ({ type: 'ack', frameSet: slow.frames.at (-1).frameSet }));
  await slow.until (({ frames }) => frames.length === 4, 'a fourth');
  assert.ok (slow.frames[3].key);
  assert.equal (slow.frames[3].dropped, slow.frames[3].frameSet - slow.frames[2].frameSet - 1);
  assert.ok (slow.frames[3].dropped > 10);
  slow.socket.terminate ();
  await server.stop ();
});

test ('TLS serves https and wss, and end of stream reaches clients', async () => {
  const folder = fs.mkdtempSync (path.join (work, 'tls-')), key = path.join (folder, 'key.pem'), certificate = path.join (folder, 'certificate.pem');
  execFileSync ('openssl', ['req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes', '-days', '2', '-subj', '/CN=localhost',
    '-keyout', key, '-out', certificate], { stdio: 'ignore' });
  const server = await serve (['port=0', `certificate=${certificate}`, `private-key=${key}`]);
  assert.match (server.address, /^https:/);
  const page = await openPage (browser, server.address), one = client (server.address);
  await framesShown (page, 3);
  await one.until (({ frames }) => frames.length > 0, 'a frame set');
  server.process.kill ('SIGINT'); // without -e there is no end of stream: the server says that it stops
  await closes (one, 1001, /the server stops/);
  await page.close ();
  fs.rmSync (folder, { recursive: true });
});

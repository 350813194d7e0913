// SPDX-License-Identifier: LGPL-2.1-or-later
// The page and rangewebsink, in launch strings of their own processes: live pictures, servers that go and return, clients that stall.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import dgram from 'node:dgram';
import fs from 'node:fs';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { frameSets, framesShown, launch, message, messageMatches, openPage, sleep, work } from './browser.js';
import { client, freePort, killServers, memory, serve } from './serving.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

test ('the page shows a live stream, and reports its latency', async () => {
  const server = await serve (['port=0', 'title="A person"']);
  const page = await openPage (browser, `${server.address}/?stats`);
  await framesShown (page, 20);
  assert.equal (await message (page), '');
  assert.equal (await page.title (), 'A person');
  assert.equal (await page.$eval ('#bar', (bar) => bar.className), 'live');
  await page.waitForFunction (() => /\d+ frame sets dropped/.test (document.getElementById ('stats').textContent));
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
  await page.waitForFunction (() => document.body.dataset.state === 'waiting');
  for (const text of ['rubbish', 'null', '7', '{"host":{},"fps":"many","view-ids":3,"lost":[]}', '[1,2]', '{"host":"x"}', `{"host":"${'y'.repeat (9000)}","name":"n","element":"e"}`, '['.repeat (5000)])
    await report (text);
  await report (JSON.stringify ({ host: 'camera1', element: 'stereodepth', name: 'depth', 'view-ids': [1], fps: 14.9, time: Date.now () / 1000 - 2 }));
  await report (JSON.stringify ({ host: 'camera1', name: 'source', warning: 'Camera lost', time: Date.now () / 1000 }));
  await page.waitForFunction (() => document.querySelectorAll ('#elements tbody tr').length === 1);
  const cells = await page.$eval ('#elements tbody tr', (row) => [...row.cells].map ((cell) => cell.textContent));
  assert.deepEqual (cells.slice (0, 4), ['camera1', 'depth', '1', '14.9']);
  assert.ok (Math.abs (Number (cells[10]) - 2000) < 500, `clock: ${cells[10]} ms`);
  await page.waitForFunction (() => /Camera lost/.test (document.getElementById ('warnings').textContent));
  await page.setViewport ({ width: 1280, height: 400 });
  fs.writeFileSync (path.join (work, 'page-rig.png'), await page.screenshot ());
  // It shows no rate of a host that has stopped.
  await page.waitForFunction (() => document.querySelector ('#elements tbody tr').className === 'gone');
  assert.equal (await page.$eval ('#elements tbody tr', (row) => row.cells[3].textContent), '');
  host.close ();
  await page.close ();
  await server.stop ();
});

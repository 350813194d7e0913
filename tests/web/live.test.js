// SPDX-License-Identifier: LGPL-2.1-or-later
// The page and rangewebsink, in launch strings of their own processes: live pictures, and the dashboard.
import assert from 'node:assert/strict';
import dgram from 'node:dgram';
import fs from 'node:fs';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { framesShown, launch, message, openPage, work } from './browser.js';
import { freePort, killServers, serve } from './serving.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

test ('a viewer of a stream with temporal prediction begins with a complete frame set, live, and is shown its latency', async () => {
  const server = await serve (['port=0', 'title="A person"'], ['profile=entropy', 'temporal=true', 'refresh-period=0', 'key-interval=0']);
  const page = await openPage (browser, `${server.address}/?stats`);
  await framesShown (page, 20);
  assert.equal (await message (page), '');
  assert.equal (await page.title (), 'A person');
  assert.equal (await page.$eval ('>>> #bar', (bar) => bar.className), 'live');
  await page.waitForFunction (() => / unknown 0 pixels.*\d+ frame sets dropped/s.test (window.rangecastView.element ('stats').textContent));
  const latencies = await page.evaluate (() => window.rangecastView.meter.latencies);
  assert.ok (latencies.length > 10 && latencies.every ((ms) => ms > 0 && ms < 10000), JSON.stringify (latencies));
  fs.writeFileSync (path.join (work, 'page-live.png'), await page.screenshot ());
  await page.close ();
  await server.stop ();
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

// SPDX-License-Identifier: LGPL-2.1-or-later
// The page before servers that break docs/formats/web-protocol.md, go away, or send streams that no page can show. rangewebsink
// does none of that: a script of each test plays the server here.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { framesShown, frameSets, launch, message, messageMatches, sleep, work } from './browser.js';
import { withServer } from './scripted.js';
import { accessUnits, changedRigView, corpus, isRigView, joined, readStream } from './support.js';

let browser;
before (async () => { browser = await launch (); });
after (() => browser?.close ());

const scene = accessUnits (readStream ('packed')), first = joined (scene[0]);
const forever = async (client, units = scene) => {
  for (let i = 0; client.socket.readyState === 1; i++) {
    await client.frameSet (joined (units[i % units.length]));
    await sleep (50);
  }
};

test ('a stream that stops is not live any more, and is again when it goes on', () => {
  let goOn;
  const stopped = new Promise ((resolve) => { goOn = resolve; });
  return withServer (browser, async (client) => {
    await client.welcome ();
    await client.frameSet (first);
    await stopped;
    await forever (client);
  }, async (page) => {
    await page.waitForSelector ('#live:not([hidden])');
    await messageMatches (page, '^No frame sets have arrived for some seconds\\.$');
    await page.waitForSelector ('#live[hidden]');
    goOn ();
    await page.waitForSelector ('#live:not([hidden])');
    assert.equal (await message (page), '');
  });
});

test ('frame sets without a rig give their sentence, until the rig comes', () => withServer (browser, async (client) => {
  await client.welcome ();
  for (let i = 0; i < 40; i++) {
    await client.frameSet (joined (scene[0].filter ((unit) => !isRigView (unit))));
    await sleep (50);
  }
  await forever (client);
}, async (page) => {
  await messageMatches (page, '^The stream has not described its cameras \\(rig\\) yet\\.$');
  await framesShown (page, 3);
  assert.equal (await message (page), '');
}));

const refused = [
  ['text that is no message', (client) => client.send ('rubbish'), '^The server sent text that is not a message of the protocol\\.$'],
  ['a frame set before its welcome', (client) => client.frameSet (first), "^The server sent a frame set before 'welcome'\\.$"],
  ['another version', (client) => client.send ({ type: 'welcome', version: 2 }), '^The server uses another version of the protocol; reload this page\\.$'],
  ['a binary message that is no frame set', async (client) => { await client.welcome (); client.send (new Uint8Array (31)); },
    '^The server sent a message that is not a frame set\\.$'],
  ['40 MB in one message', async (client) => { await client.welcome (); client.send (Buffer.concat ([Buffer.from ([1, 1, 1, 0]), Buffer.alloc (40e6)])); },
    '^The server sent 40000004 bytes in one message, more than a frame set may have\\.$'],
  ['4429', async (client) => { await client.next (); client.socket.close (4429, 'at most 2 clients'); }, '^The server refused the connection: at most 2 clients; trying again\\.$'],
  ['4406', async (client) => { await client.next (); client.socket.close (4406, 'expected version 9'); },
    '^The server uses another version of the protocol; reload this page: expected version 9\\.$'],
];
for (const [what, script, sentence] of refused)
  test (`${what} gives its sentence`, () => withServer (browser, async (client) => script (client), async (page) => {
    await messageMatches (page, sentence);
  }));

test ('a server without a stream gives its sentence, and the picture when it has one', () => withServer (browser, async (client) => {
  await client.welcome ();
  await sleep (4000);
  await forever (client);
}, async (page) => {
  await messageMatches (page, '^The server has no stream yet\\. Waiting for it\\.$');
  await framesShown (page, 3);
  assert.equal (await message (page), '');
}));

test ('a token is asked for, sent, and kept for the next time', () => {
  const tokens = [];
  return withServer (browser, async (client) => {
    const hello = await client.next ();
    tokens.push (hello.token);
    if (hello.token !== 'secret')
      return client.socket.close (4401, 'wrong or missing token');
    client.send ({ type: 'welcome', version: 1, window: 3, rtc: false });
    await forever (client);
  }, async (page) => {
    await page.waitForSelector ('#token:not([hidden])');
    await page.type ('#token-text', 'guess');
    await page.keyboard.press ('Enter');
    await page.waitForFunction (() => document.body.dataset.state === 'token' && document.getElementById ('token').hidden === false);
    await page.waitForSelector ('#token:not([hidden])');
    await page.$eval ('#token-text', (input) => { input.value = ''; });
    await page.type ('#token-text', 'secret');
    await page.keyboard.press ('Enter');
    await framesShown (page, 1);
    assert.deepEqual (tokens, [undefined, 'guess', 'secret']);
    await page.reload ();
    await framesShown (page, 1);
    assert.equal (tokens.at (-1), 'secret');
    await page.goto (`${page.url ()}#token=other`);
    await page.reload ();
    await page.waitForSelector ('#token:not([hidden])');
    assert.equal (tokens.at (-1), 'other');
    assert.equal (await page.evaluate (() => location.hash), '');
  });
});

test ('a connection that breaks is made again, and the picture goes on', () => withServer (browser, async (client, connection) => {
  await client.welcome ();
  await client.frameSet (first); // numbers begin anew
  await sleep (500);
  if (connection < 2)
    client.socket.terminate ();
  else
    await forever (client);
}, async (page, { connections }) => {
  await messageMatches (page, '^The connection was lost; trying again\\.$');
  await framesShown (page, 5);
  assert.ok (connections () >= 3);
  assert.equal (await message (page), '');
}));

test ('a rig of 64 views and a view of 16384 pixels give their sentences', async () => {
  const rig = scene[0].filter (isRigView), rest = scene[0].filter ((unit) => !isRigView (unit));
  const many = Array.from ({ length: 64 }, (_, i) => changedRigView (rig[0], { number: i, total: 64, id: i }));
  const wide = rig.map ((unit, i) => changedRigView (unit, { number: i, total: rig.length, id: i, width: 16384 }));
  for (const [units, sentence] of [[many, '^The rig has 64 views; the browser shows at most 16\\.$'], [wide, 'has 16384x\\d+ pixels; the browser shows at most 8192']])
    await withServer (browser, async (client) => {
      await client.welcome ();
      await client.frameSet (joined ([...units, ...rest]));
    }, (page) => messageMatches (page, sentence));
});

test ('units of the fuzz corpus do no harm, and the stream after them is shown', () => withServer (browser, async (client) => {
  await client.welcome ();
  for (const { bytes } of [...corpus ('access_unit'), ...corpus ('slice')])
    if (bytes.length > 0)
      await client.frameSet (bytes);
  await forever (client);
}, async (page) => {
  await framesShown (page, 5);
  await page.waitForFunction (() => document.body.dataset.state === 'receiving');
}));

test ('frame sets that the server drops are counted, and a sentence says when it drops most', () => withServer (browser, async (client) => {
  await client.welcome ();
  for (let i = 0; i < 40; i++)
    await client.frameSet (joined (scene[i % scene.length]), 4 * i, { dropped: 3 * i });
  await sleep (60000);
}, async (page) => {
  await messageMatches (page, '^The connection or this device is too slow: 7\\d of 10\\d frame sets were dropped\\.$');
}));

test ('memory stays the same over 10000 frame sets that come faster than they can be drawn', () => {
  let sent = 0;
  return withServer (browser, async (client) => {
    await client.welcome ();
    await client.frameSet (first);
    for (; sent < 10000 && client.socket.readyState === 1; sent++)
      await client.frameSet (joined (scene[sent % scene.length]));
    await sleep (60000);
  }, async (page) => {
    const session = await page.createCDPSession ();
    const used = async () => {
      await session.send ('HeapProfiler.collectGarbage');
      return (await page.metrics ()).JSHeapUsedSize;
    };
    const until = async (count) => {
      for (let i = 0; sent < count && i < 3000; i++)
        await sleep (100);
      assert.ok (sent >= count, `${sent} of ${count} frame sets`);
    };
    await until (1000);
    const early = await used (), shown = await frameSets (page);
    await until (10000);
    const late = await used ();
    assert.ok (late < early * 1.2 + 1e6, `${early} to ${late} bytes`);
    assert.ok (await frameSets (page) > shown);
  });
});

test ('the dashboard shows views, elements and warnings, and takes rows of any shape', () => withServer (browser, async (client) => {
  const { want } = await client.next ();
  assert.deepEqual (want, ['stream', 'stats']);
  client.send ({ type: 'welcome', version: 1, window: 3, rtc: false });
  const row = { host: 'camera0', element: 'stereodepth', name: 'depth', 'view-ids': [0], fps: 15, 'latency-p50': 16400000, clock: 0.0021, age: 0.5 };
  client.send ({ type: 'stats', rows: [row, { ...row, host: 'parent', element: 'rangemux', name: 'mux', pad: 'sink_2', fps: 0, lost: 12 },
    { host: 'camera1', name: 'source', warning: 'The camera is gone', time: 1e9 }, null, 7, 'x', [], { host: {}, fps: 'many', 'view-ids': 3, lost: [] }] });
  await forever (client, accessUnits (new Uint8Array (fs.readFileSync (path.join (work, 'moving.rcnc'))))); // four views, by page.sh
}, async (page) => {
  await framesShown (page, 10);
  await page.waitForFunction (() => document.querySelectorAll ('#views tbody tr').length === 4);
  const cells = (table) => page.$$eval (`#${table} tbody tr`, (rows) => rows.map ((tr) => [...tr.cells].map ((td) => td.textContent)));
  const views = await cells ('views'), elements = await cells ('elements');
  assert.deepEqual (views.map ((view) => view[0]), ['0', '1', '2', '3']);
  assert.ok (views.every ((view) => Number (view[4]) > 0), JSON.stringify (views));
  assert.deepEqual (elements.find (([host]) => host === 'camera0').slice (0, 4), ['camera0', 'depth', '0', '15.0']);
  assert.equal (elements.find (([host]) => host === 'parent')[1], 'mux.sink_2');
  assert.match (await page.$eval ('#warnings', (list) => list.textContent), /camera1 source: The camera is gone/);
  assert.equal (await message (page), '');
  await page.setViewport ({ width: 1280, height: 800 });
  await sleep (1000);
  fs.writeFileSync (path.join (work, 'page-rig.png'), await page.screenshot ());
}, 'rig.html'));

test ('the dashboard shows no rate of a stream or a host that has stopped', () => withServer (browser, async (client) => {
  await client.next ();
  client.send ({ type: 'welcome', version: 1, window: 3, rtc: false });
  client.send ({ type: 'stats', rows: [{ host: 'camera0', element: 'stereodepth', name: 'depth', fps: 14.9, bitrate: 2e6, age: 0 }] });
  for (let i = 0; i < 20; i++) {
    await client.frameSet (joined (scene[i % scene.length]));
    await sleep (50);
  }
  await sleep (60000);
}, async (page) => {
  const cells = (table) => page.$eval (`#${table} tbody tr`, (row) => [...row.cells].map ((cell) => cell.textContent));
  await page.waitForFunction (() => Number (document.querySelector ('#views tbody tr')?.cells[5].textContent) > 1);
  assert.equal ((await cells ('elements'))[3], '14.9');
  await page.waitForFunction (() => document.querySelector ('#views tbody tr').cells[5].textContent === '0.0');
  await page.waitForFunction (() => document.querySelector ('#elements tbody tr').className === 'gone');
  assert.deepEqual ((await cells ('elements')).slice (3, 6), ['', '', '']);
  assert.match (await page.$eval ('#summary', (summary) => summary.textContent), / 0\.0 frame sets\/s/);
}, 'rig.html'));

test ('statistics fit a screen of 360 pixels', () => withServer (browser, async (client) => {
  await client.welcome ();
  await forever (client);
}, async (page) => {
  await page.setViewport ({ width: 360, height: 640 });
  await page.waitForFunction (() => document.getElementById ('stats').textContent !== '');
  const { right, scrolls } = await page.$eval ('#stats', (stats) => ({ right: stats.getBoundingClientRect ().right, scrolls: stats.scrollWidth > stats.clientWidth }));
  assert.ok (right <= 360 && !scrolls, `${right} ${scrolls}`);
}, '?stats'));

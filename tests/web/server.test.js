// SPDX-License-Identifier: LGPL-2.1-or-later
// The page before servers that break docs/formats/web-protocol.md, go away, or send streams that no page can show. rangewebsink
// does none of that: a script of each test plays the server here.
import assert from 'node:assert/strict';
import test, { after, before } from 'node:test';
import { framesShown, frameSets, launch, message, messageMatches, sleep } from './browser.js';
import { withServer } from './scripted.js';
import { accessUnits, isRigView, joined, readStream } from './support.js';

let browser;
before (async () => { browser = await launch (); });
after (() => browser?.close ());

const scene = accessUnits (readStream ('packed')), first = joined (scene[0]);
const forever = async (client) => {
  for (let i = 0; client.socket.readyState === 1; i++) {
    await client.frameSet (joined (scene[i % scene.length]));
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
    await page.waitForSelector ('>>> #live:not([hidden])');
    await messageMatches (page, '^No frame sets have arrived for some seconds\\.$');
    await page.waitForSelector ('>>> #live[hidden]');
    goOn ();
    await page.waitForSelector ('>>> #live:not([hidden])');
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
    '^The server sent a message that is not a frame set\\.$'],
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
    client.send ({ type: 'welcome', version: 1, window: 3, audio: false });
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

test ('frame sets that the server drops are counted, and a sentence says when it drops most', () => withServer (browser, async (client) => {
  await client.welcome ();
  for (let i = 0; i < 40; i++)
    await client.frameSet (joined (scene[i % scene.length]), 4 * i, { dropped: 3 * i });
  await sleep (60000);
}, async (page) => {
  await messageMatches (page, '^The connection or this device is too slow: 7\\d of 10\\d frame sets were dropped\\.$');
}));

test ('memory stays the same over 2000 frame sets that come faster than they can be drawn', () => {
  let sent = 0;
  return withServer (browser, async (client) => {
    await client.welcome ();
    await client.frameSet (first);
    for (; sent < 2000 && client.socket.readyState === 1; sent++)
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
    await until (300);
    const early = await used (), shown = await frameSets (page);
    await until (2000);
    const late = await used ();
    assert.ok (late < early * 1.2 + 1e6, `${early} to ${late} bytes`);
    assert.ok (await frameSets (page) > shown);
  });
});

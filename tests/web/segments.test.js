// SPDX-License-Identifier: LGPL-2.1-or-later
// What `rangecast publish` writes, carried by a plain web server of another origin, and played by the page.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { assertInSync, CLAPS, withoutPolicy } from './claps.js';
import { frameSets, framesShown, launch, message, messageMatches, openPage, sleep, work } from './browser.js';
import { build } from './support.js';

const folder = path.join (work, 'segments'), page = path.join (build, 'pipelines/web');
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm', '.css': 'text/css' };
const figure = 'avatartestsrc is-live=true views=2 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc temporal=true key-interval=1000';
let browser, publisher, origin, pages;
let fault = () => false; // (name, response): whether it has answered instead

const serve = async (root, headers, handle = () => false) => {
  const server = http.createServer ((request, response) => {
    const name = new URL (request.url, 'http://host').pathname.slice (1), file = path.join (root, name);
    if (handle (name, response))
      return;
    if (!fs.existsSync (file) || fs.statSync (file).isDirectory ())
      return response.writeHead (404, headers).end ();
    response.writeHead (200, { 'Content-Type': TYPES[path.extname (name)] ?? 'application/octet-stream', ...headers });
    fs.createReadStream (file).pipe (response);
  });
  await new Promise ((resolve) => server.listen (0, '127.0.0.1', resolve));
  return { server, address: `http://127.0.0.1:${server.address ().port}` };
};
const CORS = { 'Access-Control-Allow-Origin': '*' };
const publish = (...options) => spawn ('rangecast', ['publish', folder, '--keep', '30', ...options], { stdio: 'inherit' });
const listed = () => fs.readFileSync (path.join (folder, 'live.m3u8'), 'utf8').match (/^\d+\.rcnc$/mg) ?? [];
const until = async (condition) => {
  for (let i = 0; i < 600 && !(await condition ()); i++)
    await sleep (100);
  assert.ok (await condition (), String (condition));
};
const open = async (address = `${origin.address}/live.m3u8`, prepare = undefined) => {
  const opened = await openPage (browser, `${pages.address}/index.html?src=${encodeURIComponent (address)}`, undefined, prepare);
  await opened.evaluate (() => {
    const view = document.querySelector ('rangecast-view');
    window.events = [];
    for (const type of ['pause', 'seeked', 'ended', 'error'])
      view.addEventListener (type, () => window.events.push (type));
    view.player.addEventListener ('frame', ({ detail }) => { Object.assign (window, { captured: detail.captureTime, views: detail.layers.length }); });
  });
  return opened;
};
const time = (opened) => opened.evaluate (() => document.querySelector ('rangecast-view').currentTime);
const seek = (opened, seconds) => opened.evaluate ((to) => { document.querySelector ('rangecast-view').currentTime = to; }, seconds);
const duration = (opened) => opened.evaluate (() => document.querySelector ('rangecast-view').duration);

before (async () => {
  fs.rmSync (folder, { recursive: true, force: true });
  fs.mkdirSync (folder);
  publisher = publish ('--source', figure);
  pages = await serve (page, {});
  origin = await serve (folder, CORS, (name, response) => fault (name, response));
  browser = await launch ();
  await until (() => fs.existsSync (path.join (folder, 'live.m3u8')) && listed ().length >= 3);
});
after (async () => {
  publisher?.kill ('SIGKILL');
  await browser?.close ();
  pages?.server.close ();
  origin?.server.close ();
});

test ('a playlist plays live, and back as far as it goes', async (t) => {
  const opened = await open (), ages = [];
  await framesShown (opened, 30);
  for (let i = 0; i < 30; i++, await sleep (100))
    ages.push (Number (process.hrtime.bigint ()) / 1e6 - await opened.evaluate (() => window.captured));
  t.diagnostic (`from capture to the page: median ${Math.round (ages.sort ((a, b) => a - b)[15])} ms`);
  const now = await time (opened);
  assert.ok (now > 0 && await duration (opened) >= now, `${now} of ${await duration (opened)}`);
  await seek (opened, 0.5);
  await until (async () => await time (opened) < 2);
  const before = await frameSets (opened);
  await framesShown (opened, before + 15); // goes on from there
  assert.ok (await time (opened) < await duration (opened) - 1);
  const [from, since] = [await time (opened), Date.now ()];
  for (let i = 0; i < 6; i++) // while segments are fetched, too
    await opened.evaluate ((play) => document.querySelector ('rangecast-view')[play ? 'play' : 'pause'] (), i % 2 === 1);
  await framesShown (opened, await frameSets (opened) + 15);
  assert.ok (await time (opened) - from <= (Date.now () - since) / 1000 + 0.1); // nothing was left out
  await seek (opened, await duration (opened));
  await until (async () => await time (opened) > await duration (opened) - 3);
  assert.deepEqual ([...new Set (await opened.evaluate (() => window.events))], ['seeked', 'pause']);
  await opened.close ();
});

test ('a server that is away, and parts that are missing or damaged, are survived', async () => {
  const opened = await open ();
  await framesShown (opened, 10);
  fault = (name, response) => Boolean (response.destroy ()) || true;
  await messageMatches (opened, 'does not answer, or not to pages of other servers: it has to send Access-Control-Allow-Origin. Trying again');
  await sleep (5000); // longer than what was fetched before lasts
  fault = () => false;
  await framesShown (opened, await frameSets (opened) + 15);
  await until (async () => await message (opened) === '');
  const otherRig = fs.readFileSync (path.join (work, 'scene.rcnc'));
  const damaged = [(old) => old.subarray (0, 3000), (old) => old, () => otherRig, (old) => old.fill (old[0] + 16, 0, 1)]; // also a wrong number, and another version
  const faults = [(response) => response.writeHead (404, CORS).end (), (response) => response.writeHead (200, CORS).end ('<html>not here</html>'),
    ...damaged.map ((change) => (response) => response.writeHead (200, CORS).end (change (fs.readFileSync (path.join (folder, listed ()[0])))))];
  const seen = [];
  fault = (name, response) => name.endsWith ('.rcnc') && seen.length < faults.length && !faults[seen.push (name) - 1] (response) || seen.at (-1) === name;
  await until (() => seen.length === faults.length);
  fault = () => false;
  await framesShown (opened, await frameSets (opened) + 30);
  assert.deepEqual (await opened.evaluate (() => [window.views, ...window.events.filter ((type) => type !== 'seeked')]), [2]);
  await opened.close ();
});

test ('what is no playlist is said', async () => {
  const cases = [[(response) => response.writeHead (404, CORS).end (), '404 Not Found'],
    [(response) => response.writeHead (200, CORS).end ('<html></html>'), 'is not a playlist'],
    [(response) => response.writeHead (200, CORS).end ('#EXTM3U\n'), 'has no segments'],
    [(response) => response.writeHead (200, CORS).end ('#EXTM3U\nx.rcnc\n'), 'a segment without #EXTINF'],
    [(response) => response.writeHead (200).end ('#EXTM3U\n'), 'Access-Control-Allow-Origin']];
  for (const [answer, text] of cases) {
    fault = (name, response) => Boolean (answer (response)) || true;
    const opened = await open ();
    await messageMatches (opened, `The stream could not be loaded: .*${text}`);
    await opened.close ();
  }
  fault = () => false;
});

test ('a stream that begins again goes on, and one that ends has ended', async () => {
  const opened = await open ();
  await framesShown (opened, 10);
  publisher.kill ('SIGKILL');
  publisher = publish ('--source', figure);
  await until (() => listed ().length >= 2 && listed ().length < 20);
  await framesShown (opened, await frameSets (opened) + 15);
  publisher.kill ('SIGINT');
  await opened.waitForFunction (() => window.events.includes ('ended'));
  assert.match (fs.readFileSync (path.join (folder, 'live.m3u8'), 'utf8'), /#EXT-X-ENDLIST\n$/);
  await opened.close ();
});

test ('sound is heard with the picture', async (t) => {
  const camera = spawn ('rangecast', ['camera', '--view', '0', '--rig', path.join (work, 'rig.yaml'), '--input', 'range', '--size', '160x120', '--learn', '5',
    '--to', '127.0.0.1:20010', '--microphone', 'audiotestsrc is-live=true wave=silence', '--audio-to', '127.0.0.1:20020'],
  { stdio: 'inherit', env: { ...process.env, ...CLAPS } });
  publisher.kill ('SIGKILL');
  publisher = publish ('--listen', '20010', '--audio-port', '20020');
  await until (() => listed ().some ((name) => fs.existsSync (path.join (folder, name.replace ('.rcnc', '.rtp')))));
  const opened = await open (undefined, withoutPolicy);
  await framesShown (opened, 10);
  await assertInSync (opened, t);
  camera.kill ('SIGINT');
  publisher.kill ('SIGINT');
  await opened.waitForFunction (() => window.events.includes ('ended'));
  const sounds = fs.readdirSync (folder).filter ((name) => name.endsWith ('.rtp')).map ((name) => name.replace ('.rtp', '.rcnc'));
  assert.deepEqual (sounds.filter ((name) => !listed ().includes (name)), []);
  await opened.close ();
});

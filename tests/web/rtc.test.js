// SPDX-License-Identifier: LGPL-2.1-or-later
// The page and rangewebsink over a WebRTC data channel, on one machine. link.sh has networks that lose packets.
import assert from 'node:assert/strict';
import test, { after, before } from 'node:test';
import { frameSets, framesShown, launch, message, openPage, sleep } from './browser.js';
import { client, closes, killServers, memory, serve } from './serving.js';

let browser;
before (async () => { browser = await launch (); });
after (async () => {
  await browser?.close ();
  killServers ();
});

const transportIs = (page, name) => page.waitForFunction ((text) => document.getElementById ('stats').textContent.includes (`${text}: `), {}, name);
const more = async (page, count) => framesShown (page, await frameSets (page) + count);
const isWhole = (page) => page.waitForFunction (() => /missing 0, unknown 0 pixels; 0 damaged/.test (document.getElementById ('stats').textContent));
const channelOpened = (server) => server.log ().includes ('frame sets go over a data channel');
// With the log of what clients do.
process.env.GST_DEBUG = 'rangewebsink:4';

test ('a page that wants a data channel goes over to it, and shows whole pictures', async () => {
  const server = await serve (['port=0', 'webrtc=true']), page = await openPage (browser, `${server.address}/?stats&transport=webrtc`);
  await transportIs (page, 'WebRTC');
  await more (page, 30);
  assert.equal (await message (page), '');
  await isWhole (page);
  await page.close ();
  assert.equal (await server.stop (), 0);
});

test ('with temporal prediction, the data channel begins with a key frame set', async () => {
  const server = await serve (['port=0', 'webrtc=true'], ['profile=entropy', 'temporal=true', 'refresh-period=0', 'key-interval=0']);
  const page = await openPage (browser, `${server.address}/?stats&transport=webrtc`);
  await transportIs (page, 'WebRTC');
  await more (page, 20);
  await isWhole (page);
  await page.close ();
  assert.equal (await server.stop (), 0);
});

test ('slices that are longer than a message of the channel come over the WebSocket', async () => {
  const server = await serve (['port=0', 'webrtc=true'], ['max-slice-size=65535', 'profile=plain', 'colour-threshold=0', 'depth-threshold=0'],
    ['avatartestsrc', 'is-live=true', 'views=1', '!', 'video/x-range,width=320,height=240,framerate=15/1']);
  const page = await openPage (browser, `${server.address}/?stats&transport=webrtc`);
  await more (page, 40);
  assert.ok (channelOpened (server));
  await transportIs (page, 'WebSocket');
  await page.close ();
  assert.equal (await server.stop (), 0);
});

test ('a page that does not ask for a channel, and a server that offers none, stay with the WebSocket', async () => {
  for (const [setting, parameter] of [['webrtc=true', ''], ['webrtc=false', '&transport=webrtc']]) {
    const server = await serve (['port=0', setting]), page = await openPage (browser, `${server.address}/?stats${parameter}`);
    await more (page, 40);
    await transportIs (page, 'WebSocket');
    await page.close ();
    assert.ok (!channelOpened (server));
    await server.stop ();
  }
});

test ('frame sets go on over the WebSocket when the channel does not open, and when it dies', async () => {
  const server = await serve (['port=0', 'webrtc=true']);
  const deaf = await openPage (browser, `${server.address}/?stats&transport=webrtc`, undefined, (page) => page.evaluateOnNewDocument (() => {
    RTCPeerConnection.prototype.addIceCandidate = async () => {};
    const { setRemoteDescription } = RTCPeerConnection.prototype;
    RTCPeerConnection.prototype.setRemoteDescription = function ({ type, sdp }) {
      return setRemoteDescription.call (this, { type, sdp: sdp.replace (/a=candidate.*\r\n/g, '') });
    };
    RTCPeerConnection.prototype.setLocalDescription = async function () { throw new Error ('a test'); };
  }));
  await more (deaf, 30);
  await transportIs (deaf, 'WebSocket');
  await deaf.close ();

  const page = await openPage (browser, `${server.address}/?stats&transport=webrtc`, undefined, (one) => one.evaluateOnNewDocument (() => {
    window.RTCPeerConnection = class extends RTCPeerConnection {
      constructor (...args) {
        super (...args);
        window.peer = this;
      }
    };
  }));
  await transportIs (page, 'WebRTC');
  await page.evaluate (() => window.peer.close ()); // as if the network were gone: no event in the page
  await page.evaluate (() => window.rangecastPage.channel.fail ());
  await transportIs (page, 'WebSocket');
  await more (page, 10);
  await isWhole (page);
  await page.close ();
  assert.equal (await server.stop (), 0);
});

test ('a server with open channels stops, and the page finds the next one', async () => {
  const first = await serve (['port=0', 'webrtc=true']), page = await openPage (browser, `${first.address}/?stats&transport=webrtc`);
  await transportIs (page, 'WebRTC');
  assert.equal (await first.stop (), 0);
  const second = await serve ([`port=${first.port}`, 'webrtc=true']);
  await more (page, 5);
  await transportIs (page, 'WebRTC');
  await page.close ();
  await second.stop ();
});

test ('signals that break the protocol end their own connection only', async () => {
  const server = await serve (['port=0', 'webrtc=true']), page = await openPage (browser, `${server.address}/?stats&transport=webrtc`);
  await transportIs (page, 'WebRTC');
  const asks = async () => {
    const one = client (server.address);
    await one.until (({ texts }) => texts.length > 0, 'welcome');
    one.socket.send ('{"type":"rtc"}');
    await one.until (({ texts }) => texts.some (({ type }) => type === 'offer'), 'offer');
    return { ...one, offer: one.texts.find (({ type }) => type === 'offer').sdp, send: (object) => one.socket.send (JSON.stringify (object)) };
  };
  const sentence = /^answer: sdp: expected /;
  for (const change of [() => '', () => 'rubbish', (sdp) => sdp.slice (0, 100), (sdp) => sdp.replace ('m=application', 'm=video'),
    (sdp) => sdp + sdp.slice (sdp.indexOf ('m=')), (sdp) => sdp.replace (/a=fingerprint.*\r\n/, ''), (sdp) => sdp.replace (/a=ice-ufrag.*\r\n/, ''),
    () => 'v=0\r\n'.repeat (2000)]) {
    const one = await asks ();
    one.send ({ type: 'answer', sdp: change (one.offer) });
    await closes (one, 4400, sentence).catch ((error) => assert.fail (`${change}: ${error.message}`));
  }
  // What looks like an answer, but has other keys: the channel does not open, frame sets go on over the WebSocket.
  const other = await asks ();
  other.send ({ type: 'answer', sdp: other.offer.replace ('actpass', 'active').replace (/(a=ice-(ufrag|pwd):).*/g, '$1AAAAAAAAAAAAAAAAAAAAAAAA') });
  for (const candidate of ['', 'rubbish', 'candidate:1 1 UDP 1 300.1.1.1 99999 typ host', `candidate:${'9'.repeat (5000)}`])
    other.send ({ type: 'candidate', candidate, sdpMLineIndex: 7 });
  const before = other.frames.length;
  await other.until (({ frames }) => frames.length > before + 10, 'frame sets');
  for (let i = 0; i < 100; i++)
    other.send ({ type: 'candidate', candidate: 'candidate:1 1 UDP 2015363327 127.0.0.1 9 typ host', sdpMLineIndex: 0 });
  await closes (other, 4429, /^at most 64 candidates$/);

  const many = await asks ();
  for (let i = 0; i < 4; i++)
    many.send ({ type: 'rtc' });
  await closes (many, 4429, /^at most 4 data channels$/);
  const wrong = await asks ();
  wrong.send ({ type: 'answer', sdp: 5 });
  await closes (wrong, 4400, sentence);

  await more (page, 10);
  await transportIs (page, 'WebRTC');
  await page.close ();
  assert.equal (await server.stop (), 0);
});

test ('clients that ask for a channel and vanish cost no memory', async () => {
  const server = await serve (['port=0', 'webrtc=true']);
  const round = async () => {
    for (let i = 0; i < 10; i++) {
      const one = client (server.address);
      await one.until (({ texts }) => texts.length > 0, 'welcome');
      one.socket.send ('{"type":"rtc"}');
      await one.until (({ texts }) => texts.some (({ type }) => type === 'offer'), 'offer');
      one.socket.terminate ();
    }
    await sleep (1000);
  };
  await round ();
  await round ();
  const early = memory (server);
  for (let i = 0; i < 4; i++)
    await round ();
  assert.ok (memory (server) < early + 12e6, `${early} -> ${memory (server)} bytes`);
  assert.equal (await server.stop (), 0);
});

// SPDX-License-Identifier: LGPL-2.1-or-later
// The page behind a link that loses packets; link.sh makes the link and says what it loses.
import assert from 'node:assert/strict';
import test, { after, before } from 'node:test';
import { launch, openPage } from './browser.js';

const { ADDRESS, LOSS } = process.env, loss = Number (LOSS);
let browser;
before (async () => { browser = await launch (); });
after (() => browser?.close ());

test (`with ${100 * loss} % of packets lost, pictures come over a data channel and lack slices only where messages were lost`, async () => {
  const page = await openPage (browser, `${ADDRESS}/?stats&transport=webrtc`, undefined, (one) => one.evaluateOnNewDocument (() => {
    window.seen = []; // of each frame set that is shown
  }));
  await page.waitForFunction (() => /WebRTC: /.test (document.getElementById ('stats').textContent));
  await page.evaluate (() => {
    const { stats } = window.rangecastPage, shown = stats.shown;
    stats.shown = function (frame, ...rest) {
      window.seen.push ({ missing: frame.missingPixels, damaged: frame.badSlices, ...frame.network });
      return shown.call (this, frame, ...rest);
    };
  });
  await page.waitForFunction ((count) => window.seen.length >= count, {}, loss > 0.1 ? 20 : 60); // SCTP sends less where much is lost
  const seen = await page.evaluate (() => window.seen);
  await page.close ();
  assert.deepEqual (seen.filter (({ damaged }) => damaged !== 0), []);
  assert.ok (seen.every (({ transport }) => transport === 'WebRTC'), JSON.stringify (seen.slice (-3)));
  for (const { missing, absent, lost } of seen)
    assert.ok (missing === 0 || (absent > 0 && lost >= absent), JSON.stringify ({ missing, absent, lost }));
  const { lost } = seen.at (-1);
  if (loss === 0)
    assert.equal (lost, 0);
  if (loss >= 0.05)
    assert.ok (lost > 0 && seen.some (({ missing }) => missing > 0), `${lost} messages lost`);
});

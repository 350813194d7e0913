// SPDX-License-Identifier: LGPL-2.1-or-later
// What a page shows of a stream, as a row of a table. usage: node measure.js ADDRESS SECONDS LABEL [QUERY]
// Latency: from capture to the frame after the picture was drawn, by the server's clock. Resolution: how much of the window's width and height
// is drawn at the end.
import { launch, openPage, sleep } from './browser.js';

// Resolves to { pictures (a second), p50, p99 (ms), dropped, firstPicture (ms), scale }
const measure = async (browser, address, seconds, query) => {
  const page = await openPage (browser, `${address}/?stats&${query}`, undefined, (made) => made.evaluateOnNewDocument (() => {
    const look = setInterval (() => {
      if (document.body?.dataset.frameSets) {
        window.firstPicture = performance.now (); // since the page was opened
        clearInterval (look);
      }
    }, 5);
  }));
  await page.waitForFunction (() => window.firstPicture > 0);
  const firstPicture = await page.evaluate (() => window.firstPicture);
  await sleep (2000);
  const read = () => page.evaluate (() => {
    const text = window.rangecastView.element ('stats').textContent, { meter: stats, scale } = window.rangecastView;
    const [, dropped] = /(\d+) frame sets dropped by the server/.exec (text) ?? [];
    const found = { frames: Number (document.body.dataset.frameSets), dropped: Number (dropped), latencies: stats.latencies, scale };
    stats.latencies = [];
    return { ...found, time: performance.now () };
  });
  const first = await read ();
  await sleep (1000 * seconds);
  const last = await read (), elapsed = (last.time - first.time) / 1000;
  await page.close ();
  const sorted = last.latencies.toSorted ((a, b) => a - b), at = (share) => sorted[Math.min (sorted.length - 1, Math.floor (share * sorted.length))];
  return { pictures: (last.frames - first.frames) / elapsed, p50: at (0.5), p99: at (0.99), dropped: last.dropped - first.dropped, firstPicture,
    scale: last.scale };
};

const [address, seconds, label, query = ''] = process.argv.slice (2);
const browser = await launch ();
const row = await measure (browser, address, Number (seconds), query);
const cells = [label, row.pictures.toFixed (1), ...[row.p50, row.p99, row.firstPicture].map ((ms) => `${ms?.toFixed (0)} ms`), `${Math.round (100 * row.scale)} %`, row.dropped];
console.log (`| ${cells.join (' | ')} |`);
await browser.close ();

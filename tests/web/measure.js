// SPDX-License-Identifier: LGPL-2.1-or-later
// What a page shows of a stream, as a row of a table. usage: node measure.js ADDRESS webrtc|websocket blend|strips SECONDS LABEL
// Latency: from capture to the frame after the GPU has drawn, by the server's clock. Resolution: how much of the window's width and height
// is drawn at the end.
import { launch, openPage, sleep } from './browser.js';
import { pathToFileURL } from 'node:url';

// parameters: of the address. Resolves to { pictures (a second), p50, p99 (ms), dropped, lost, firstPicture (ms), transport, scale }
export const measure = async (browser, address, parameters, seconds) => {
  const page = await openPage (browser, `${address}/?stats&${parameters}`, undefined, (made) => made.evaluateOnNewDocument (() => {
    const look = setInterval (() => {
      if (document.body?.dataset.frameSets) {
        window.firstPicture = performance.now (); // since the page was opened
        clearInterval (look);
      }
    }, 5);
  }));
  await page.waitForFunction (() => window.firstPicture > 0);
  const firstPicture = await page.evaluate (() => window.firstPicture);
  if (parameters.includes ('transport=webrtc'))
    await page.waitForFunction (() => /WebRTC: /.test (document.getElementById ('stats').textContent), { timeout: 20000 }).catch (() => {});
  await sleep (2000);
  const read = () => page.evaluate (() => {
    const text = document.getElementById ('stats').textContent, { stats, resolution } = window.rangecastPage;
    const [, transport, dropped, lost] = /(\w+): (\d+) frame sets dropped by the server, (\d+) messages lost/.exec (text) ?? [];
    const found = { frames: Number (document.body.dataset.frameSets), transport, dropped: Number (dropped), lost: Number (lost), latencies: stats.latencies,
      scale: resolution.scale };
    stats.latencies = [];
    return { ...found, time: performance.now () };
  });
  const first = await read ();
  await sleep (1000 * seconds);
  const last = await read (), elapsed = (last.time - first.time) / 1000;
  await page.close ();
  const sorted = last.latencies.toSorted ((a, b) => a - b), at = (share) => sorted[Math.min (sorted.length - 1, Math.floor (share * sorted.length))];
  return { pictures: (last.frames - first.frames) / elapsed, p50: at (0.5), p99: at (0.99), dropped: last.dropped - first.dropped,
    lost: last.lost - first.lost, firstPicture, transport: last.transport,
    scale: last.scale };
};

if (import.meta.url === pathToFileURL (process.argv[1]).href) {
  const [address, transport, mode, seconds, label] = process.argv.slice (2);
  const browser = await launch ();
  const row = await measure (browser, address, `mode=${mode}&transport=${transport}`, Number (seconds));
  const cells = [label, mode, row.transport, row.pictures.toFixed (1), ...[row.p50, row.p99, row.firstPicture].map ((ms) => `${ms?.toFixed (0)} ms`),
    `${Math.round (100 * row.scale)} %`, row.dropped, row.lost];
  console.log (`| ${cells.join (' | ')} |`);
  await browser.close ();
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// What a page shows of a stream, drawn as strips, as a row of a table. usage: node measure.js ADDRESS webrtc|websocket SECONDS LABEL
// Latency: from capture to the frame after the draw call, whose clock is the server's.
import { framesShown, launch, openPage, sleep } from './browser.js';
import { pathToFileURL } from 'node:url';

// parameters: of the address. Resolves to { pictures (a second), p50, p99 (ms), dropped, lost, firstPicture (ms), transport }
export const measure = async (browser, address, parameters, seconds) => {
  const begin = Date.now ();
  const page = await openPage (browser, `${address}/?stats&${parameters}`);
  await framesShown (page, 1);
  const firstPicture = Date.now () - begin;
  if (parameters.includes ('transport=webrtc'))
    await page.waitForFunction (() => /WebRTC: /.test (document.getElementById ('stats').textContent), { timeout: 20000 }).catch (() => {});
  await sleep (2000);
  const read = () => page.evaluate (() => {
    const text = document.getElementById ('stats').textContent, { stats } = window.rangecastPage;
    const [, transport, dropped, lost] = /(\w+): (\d+) frame sets dropped by the server, (\d+) messages lost/.exec (text) ?? [];
    const found = { frames: Number (document.body.dataset.frameSets), transport, dropped: Number (dropped), lost: Number (lost), latencies: stats.latencies };
    stats.latencies = [];
    return { ...found, time: performance.now () };
  });
  const first = await read ();
  await sleep (1000 * seconds);
  const last = await read (), elapsed = (last.time - first.time) / 1000;
  await page.close ();
  const sorted = last.latencies.toSorted ((a, b) => a - b), at = (share) => sorted[Math.min (sorted.length - 1, Math.floor (share * sorted.length))];
  return { pictures: (last.frames - first.frames) / elapsed, p50: at (0.5), p99: at (0.99), dropped: last.dropped - first.dropped,
    lost: last.lost - first.lost, firstPicture, transport: last.transport };
};

if (import.meta.url === pathToFileURL (process.argv[1]).href) {
  const [address, transport, seconds, label] = process.argv.slice (2);
  const browser = await launch ();
  const row = await measure (browser, address, `mode=strips&transport=${transport}`, Number (seconds));
  console.log (`| ${label} | ${row.transport} | ${row.pictures.toFixed (1)} | ${row.p50?.toFixed (0)} ms | ${row.p99?.toFixed (0)} ms | ${row.dropped} | ${row.lost} |`);
  await browser.close ();
}

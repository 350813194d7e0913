// SPDX-License-Identifier: LGPL-2.1-or-later
// Headless Chromium with software WebGL for the tests of the page; page.sh installs puppeteer-core into the build folder.
import { createRequire } from 'node:module';
import path from 'node:path';
import { build } from './support.js';

export const work = path.join (build, 'web-test');
export const required = createRequire (path.join (work, 'package.json')); // modules that npm installed there
export const sleep = (ms) => new Promise ((resolve) => setTimeout (resolve, ms));

export const launch = () => required ('puppeteer-core').launch ({ executablePath: process.env.CHROMIUM, headless: true,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--hide-scrollbars', '--ignore-certificate-errors', '--mute-audio'] });

// prepare (page): before it loads the address
export const openPage = async (browser, address, viewport = { width: 640, height: 480 }, prepare = async () => {}) => {
  const page = await browser.newPage ();
  page.setDefaultTimeout (60000);
  await page.setViewport (viewport);
  await prepare (page);
  await page.goto (address);
  return page;
};
export const message = (page) => page.evaluate (() => document.body.dataset.message ?? '');
export const messageMatches = (page, pattern) =>
  page.waitForFunction ((source) => new RegExp (source).test (document.body.dataset.message ?? ''), {}, pattern);
export const frameSets = (page) => page.evaluate (() => Number (document.body.dataset.frameSets ?? 0));
export const framesShown = (page, count) => page.waitForFunction ((wanted) => Number (document.body.dataset.frameSets ?? 0) >= wanted, {}, count);

// SPDX-License-Identifier: LGPL-2.1-or-later
// The page in headless Chromium; page.sh makes the recordings and striprender's pictures.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { framesShown, launch, message, messageMatches, openPage, work } from './browser.js';
import { build } from './support.js';

let browser, server, address;

// A folder of its own, so that the page finds recordings beside itself.
const prepareFolder = () => {
  const folder = path.join (work, 'served');
  fs.rmSync (folder, { recursive: true, force: true });
  fs.cpSync (path.join (build, 'pipelines/web'), folder, { recursive: true, filter: (from) => !/\.[od]$/.test (from) });
  for (const name of ['scene.rcnc', 'moving.rcnc', 'slow.rcnc', ...fs.readdirSync (work).filter ((file) => /^native-.*\.png$/.test (file))])
    fs.copyFileSync (path.join (work, name), path.join (folder, name));
  fs.writeFileSync (path.join (folder, 'cut.rcnc'), fs.readFileSync (path.join (work, 'moving.rcnc')).subarray (0, -20));
  return folder;
};

before (async () => {
  const folder = prepareFolder ();
  server = spawn ('python3', ['-u', '-m', 'http.server', '--bind', '127.0.0.1', '--directory', folder, '0'], { stdio: ['ignore', 'pipe', 'ignore'] });
  address = await new Promise ((resolve) => {
    let text = '';
    server.stdout.on ('data', (data) => {
      text += data;
      const port = / port (\d+) /.exec (text);
      if (port)
        resolve (`http://127.0.0.1:${port[1]}`);
    });
  });
  browser = await launch ();
});
after (async () => {
  await browser?.close ();
  server?.kill ();
});

const open = (query, ...rest) => openPage (browser, `${address}/index.html?${query}`, ...rest);
// What is on the canvas once it has all pixels and two pictures in a row are equal: the fit comes with the second.
const picture = async (page) => {
  let last = '';
  for (let i = 0; i < 50; i++) {
    const now = await page.evaluate (() => new Promise ((resolve) => requestAnimationFrame (() => requestAnimationFrame (() => {
      const canvas = window.rangecastView.element ('picture');
      resolve (canvas.width === canvas.clientWidth && document.body.dataset.frameSets > 0 ? canvas.toDataURL ('image/png') : '');
    }))));
    if (now !== '' && now === last)
      return now;
    last = now;
    await new Promise ((resolve) => setTimeout (resolve, 200));
  }
  return assert.fail ('the picture does not come to rest');
};

const rendererOf = (page) => page.evaluate (() => window.rangecastView.renderer.constructor.name);
// In the page: of two pictures, the mean difference of their grey in levels, and the share of pixels that are not background.
const compare = (page, ours, theirs) => page.evaluate (async (a, b) => {
  const grey = async (url) => {
    const image = new Image ();
    image.src = url;
    await image.decode ();
    const canvas = new OffscreenCanvas (image.width, image.height), context = canvas.getContext ('2d');
    context.drawImage (image, 0, 0);
    const { data } = context.getImageData (0, 0, image.width, image.height);
    return Float64Array.from ({ length: data.length / 4 }, (_, i) => 0.299 * data[4 * i] + 0.587 * data[4 * i + 1] + 0.114 * data[4 * i + 2]);
  };
  const x = await grey (a), y = await grey (b), mean = (value) => x.reduce ((sum, _, i) => sum + value (i), 0) / x.length;
  return { difference: x.length === y.length ? mean ((i) => Math.abs (x[i] - y[i])) : NaN, shown: mean ((i) => Number (Math.abs (x[i] - x[0]) > 4)) };
}, ours, theirs);

for (const [angle, renderer] of [[-30, 'webgl'], [100, 'webgl'], [-30, 'software'], [100, 'software']])
  test (`the picture at ${angle} degrees, by ${renderer}, is striprender's`, async () => {
    const page = await open (`src=scene.rcnc&paused&azimuth=${angle}&renderer=${renderer}`);
    await framesShown (page, 1);
    assert.equal (await rendererOf (page), { webgl: 'WebGlRenderer', software: 'SoftwareRenderer' }[renderer]);
    const ours = await picture (page);
    fs.writeFileSync (path.join (work, `page-${renderer}${angle}.png`), Buffer.from (ours.split (',')[1], 'base64'));
    const result = await compare (page, ours, `native-${angle}.png`);
    assert.equal (await message (page), '');
    assert.ok (result.shown > 0.1, `a person is there: ${JSON.stringify (result)}`);
    assert.ok (result.difference <= 0.1, JSON.stringify (result));
    await page.close ();
  });

for (const renderer of ['webgl', 'software']) test (`a transparent page shows nothing but the person, by ${renderer}`, async () => {
  const page = await open (`src=scene.rcnc&paused&transparent&renderer=${renderer}`), url = await picture (page);
  const alphas = await page.evaluate (async (from) => {
    const image = await createImageBitmap (await (await fetch (from)).blob ()), canvas = new OffscreenCanvas (image.width, image.height);
    const context = canvas.getContext ('2d');
    context.drawImage (image, 0, 0);
    return [[2, 2], [image.width / 2, image.height / 2]].map ((at) => context.getImageData (...at, 1, 1).data[3]);
  }, url);
  assert.deepEqual (alphas, [0, 255]);
  assert.equal (await page.evaluate (() => getComputedStyle (window.rangecastView.element ('bar')).display + getComputedStyle (document.body).backgroundColor),
    'nonergba(0, 0, 0, 0)');
  await page.close ();
});

test ('a recording that is cut off is shown to its end, and says so', async () => {
  const page = await open ('src=cut.rcnc');
  await messageMatches (page, '^The recording is cut off: ');
  assert.ok (await page.evaluate (() => Number (document.body.dataset.frameSets)) > 0);
  // The last whole frame set, number 39, stays.
  assert.match (await page.evaluate (() => window.rangecastView.element ('time').textContent), /^0:02\.5 /);
  await page.close ();
});

test ('a browser without WebGL2 draws in software', async () => {
  const page = await open ('src=scene.rcnc', undefined, (made) => made.evaluateOnNewDocument (() => {
    const get = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (type, ...rest) { return type === 'webgl2' ? null : get.call (this, type, ...rest); };
  }));
  await framesShown (page, 1);
  assert.equal (await rendererOf (page), 'SoftwareRenderer');
  await page.close ();
});

test ('a file that is dropped onto the page is played, and the button and the space bar pause it', async () => {
  const page = await open ('');
  await page.waitForSelector ('#welcome:not([hidden])');
  await page.evaluate (async () => {
    const dropped = new DataTransfer ();
    dropped.items.add (new File ([await (await fetch ('slow.rcnc')).blob ()], 'slow.rcnc'));
    document.dispatchEvent (new DragEvent ('drop', { dataTransfer: dropped, bubbles: true, cancelable: true }));
  });
  await framesShown (page, 2);
  const stateIs = (state) => page.waitForFunction ((wanted) => document.body.dataset.state === wanted, {}, state);
  await stateIs ('playing');
  await page.click ('>>> #play');
  await stateIs ('paused');
  await page.focus ('>>> #picture');
  await page.keyboard.press ('Space');
  await stateIs ('playing');
  await page.close ();
});

test ('the picture and the point cloud are saved as files', async () => {
  const page = await open ('src=scene.rcnc&paused');
  await framesShown (page, 1);
  await page.evaluate (() => {
    window.saved = [];
    HTMLAnchorElement.prototype.click = function () {
      const { download, href } = this;
      fetch (href).then ((answer) => answer.arrayBuffer ()).then ((file) => window.saved.push ({ download, bytes: [...new Uint8Array (file.slice (0, 300))], size: file.byteLength }));
    };
  });
  await page.click ('>>> #save-picture');
  await page.waitForFunction (() => window.saved.length === 1);
  await page.click ('>>> #save-points');
  await page.waitForFunction (() => window.saved.length === 2);
  const [picture, points] = await page.evaluate (() => window.saved);
  assert.equal (picture.download, 'rangecast.png');
  assert.deepEqual (picture.bytes.slice (0, 8), [0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
  assert.equal (points.download, 'rangecast.ply');
  const [header] = Buffer.from (points.bytes).toString ('latin1').split ('end_header'), count = Number (/element vertex (\d+)/.exec (header)[1]);
  assert.ok (header.startsWith ('ply\n') && count > 10000 && points.size > 15 * count, header);
  await page.close ();
});

test ('seeking shows the frame set at that time, paused or not', async () => {
  const page = await open ('src=moving.rcnc&paused&time=1000');
  await framesShown (page, 1);
  await page.waitForFunction (() => /^0:01\.0 /.test (window.rangecastView.element ('time').textContent));
  assert.equal (await page.evaluate (() => document.body.dataset.state), 'paused');
  await page.close ();
});

test ('mouse, touch and keys move the camera', async () => {
  const page = await open ('src=scene.rcnc&paused');
  const orbit = () => page.evaluate (() => window.rangecastView.camera.record ('rc_orbit'));
  await framesShown (page, 1);
  await page.mouse.move (320, 200);
  await page.mouse.down ();
  await page.mouse.move (160, 200, { steps: 4 });
  await page.mouse.up ();
  assert.ok (Math.abs ((await orbit ()).azimuth - 45) < 1);
  await page.keyboard.press ('ArrowLeft');
  assert.ok (Math.abs ((await orbit ()).azimuth - 40) < 1);
  await page.mouse.wheel ({ deltaY: -100 });
  await page.waitForFunction (() => window.rangecastView.camera.record ('rc_orbit').distance > 0);
  await page.keyboard.press ('Home');
  assert.equal ((await orbit ()).azimuth, 0);
  await page.close ();
});

test ('on a phone one finger orbits, and every pixel of the screen is used', async () => {
  const page = await open ('src=scene.rcnc&paused', { width: 360, height: 640, deviceScaleFactor: 3, isMobile: true, hasTouch: true });
  await framesShown (page, 1);
  await page.waitForFunction (() => window.rangecastView.element ('picture').width === 1080 && window.rangecastView.element ('picture').height === 1920);
  await page.touchscreen.touchStart (180, 300);
  await page.touchscreen.touchMove (90, 300);
  await page.touchscreen.touchEnd ();
  await page.waitForFunction (() => Math.abs (window.rangecastView.camera.record ('rc_orbit').azimuth - 45) < 2);
  fs.writeFileSync (path.join (work, 'page-phone.png'), await page.screenshot ());
  await page.close ();
});

test ('a renderer that is too slow draws fewer pixels of moving pictures, and all of one that stands still', async () => {
  const page = await open ('src=moving.rcnc&paused', { width: 800, height: 600 });
  await framesShown (page, 1);
  const widthIs = (condition) => page.waitForFunction (`((width) => ${condition}) (window.rangecastView.element ('picture').width)`);
  await page.evaluate (() => { window.rangecastView.renderer.finished = () => new Promise ((resolve) => setTimeout (resolve, 150)); });
  await page.click ('>>> #play');
  await widthIs ('width < 800');
  await page.waitForFunction (() => document.body.dataset.state === 'paused');
  await widthIs ('width === 800');
  await page.close ();
});

test ('a context that is lost and restored within a picture does not stop the page', async () => {
  const page = await open ('src=moving.rcnc&paused&renderer=webgl');
  await framesShown (page, 1);
  await page.evaluate (() => {
    const { renderer } = window.rangecastView, { gl } = renderer, finished = renderer.finished.bind (renderer);
    window.extension = gl.getExtension ('WEBGL_lose_context');
    renderer.finished = () => {
      renderer.finished = finished;
      const wait = finished ();
      window.extension.loseContext ();
      return wait;
    };
    window.rangecastView.element ('picture').addEventListener ('webglcontextlost', () => setTimeout (() => window.extension.restoreContext (), 0));
  });
  await page.keyboard.press ('ArrowLeft'); // draws
  await page.waitForFunction (() => !window.rangecastView.renderer.gl.isContextLost ());
  await page.click ('>>> #play');
  await framesShown (page, 4);
  await page.close ();
});

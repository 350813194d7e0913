// SPDX-License-Identifier: LGPL-2.1-or-later
// What others embed, in headless Chromium: <rangecast-view> twice on a page, three.js, and the npm package built by vite.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import test, { after, before } from 'node:test';
import { launch, work } from './browser.js';
import { build, source } from './support.js';

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
const folder = path.join (work, 'embedded');
let browser, server, address;

before (async () => {
  fs.rmSync (folder, { recursive: true, force: true });
  fs.cpSync (path.join (build, 'pipelines/web'), folder, { recursive: true, filter: (from) => !/\.[od]$/.test (from) });
  fs.cpSync (path.join (source, 'pipelines/web/examples'), path.join (folder, 'examples'), { recursive: true });
  fs.symlinkSync (path.join (work, 'node_modules'), path.join (folder, 'node_modules'));
  for (const name of ['scene', 'moving'])
    fs.copyFileSync (path.join (work, `${name}.rcnc`), path.join (folder, 'examples', `${name}.rcnc`));
  // With the policy that docs/guide/embed.md names.
  server = http.createServer ((request, response) => {
    const file = path.join (folder, new URL (request.url, 'http://host').pathname);
    if (!fs.existsSync (file))
      return response.writeHead (404).end ();
    response.writeHead (200, { 'Content-Type': TYPES[path.extname (file)] ?? 'application/octet-stream',
      'Content-Security-Policy': "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' blob:; connect-src 'self'" });
    fs.createReadStream (file).pipe (response);
  });
  await new Promise ((resolve) => server.listen (0, '127.0.0.1', resolve));
  address = `http://127.0.0.1:${server.address ().port}`;
  browser = await launch ();
});
after (async () => {
  await browser?.close ();
  server?.close ();
});

// script: which the page begins with; errors: what the page threw
const open = async (name, script = '') => {
  const page = await browser.newPage (), errors = [];
  page.setDefaultTimeout (60000);
  page.on ('pageerror', (error) => errors.push (error.message));
  await page.setViewport ({ width: 640, height: 480 });
  await page.evaluateOnNewDocument (script);
  await page.goto (`${address}/${name}`);
  return { page, errors };
};
const write = (name, text) => fs.writeFileSync (path.join (folder, name), text);
const screenshot = async (page, name) => fs.writeFileSync (path.join (work, name), await page.screenshot ());

test ('two elements on a page play, seek and leave the document by themselves', async () => {
  write ('two.html', `<!doctype html><body><script type="module" src="./view.js"></script>
    <style>rangecast-view { width: 300px; height: 220px; display: inline-block; }</style>
    <rangecast-view id="a" src="examples/moving.rcnc" controls></rangecast-view><rangecast-view id="b" src="examples/scene.rcnc" azimuth="90" autoplay="false"></rangecast-view>
    <script>
      window.seen = [];
      for (const id of ['a', 'b'])
        for (const type of ['loadedmetadata', 'play', 'pause', 'seeking', 'seeked', 'ended', 'error', 'framesetchange'])
          document.getElementById (id).addEventListener (type, ({ detail }) => window.seen.push ([id, type, detail?.views]));
    </script>`);
  const { page, errors } = await open ('two.html');
  const has = (id, type) => page.waitForFunction ((...wanted) => window.seen.some (([a, b]) => a === wanted[0] && b === wanted[1]), {}, id, type);
  for (const [id, type] of [['a', 'loadedmetadata'], ['a', 'play'], ['a', 'framesetchange'], ['b', 'framesetchange'], ['a', 'ended']])
    await has (id, type);
  assert.ok (await page.evaluate (() => Math.abs (window.a.duration - 39 / 15) < 0.01 && window.a.ended && window.a.paused));
  await page.evaluate (() => { window.a.currentTime = 1; });
  await has ('a', 'seeked');
  assert.ok (await page.evaluate (() => Math.abs (window.a.currentTime - 1) < 0.1));
  assert.equal (await page.evaluate (() => window.b.orbit.azimuth), 90);
  assert.equal (await page.evaluate (() => { window.b.orbit = { elevation: 20 }; return window.b.orbit.elevation; }), 20);
  assert.ok (await page.evaluate (() => { try { window.a.currentTime = Infinity; } catch (error) { return error instanceof TypeError; } return false; }));
  assert.ok (await page.evaluate (() => { try { window.b.orbit = { azimuth: NaN }; } catch (error) { return error instanceof TypeError; } return false; }));
  await page.evaluate (() => { window.a.play (); window.a.play (); });
  await page.waitForFunction (() => !window.a.paused);
  assert.ok (await page.evaluate (async () => (await window.b.picture ()).size) > 1000);
  await screenshot (page, 'embed-two.png');
  await page.evaluate (() => { window.seen = []; document.body.append (window.b); window.a.remove (); }); // b comes anew
  await has ('b', 'framesetchange');
  // What is asked for before the recording is there is about its beginning.
  await page.evaluate (() => {
    window.b.setAttribute ('src', 'examples/moving.rcnc');
    window.b.play ();
    window.b.currentTime = 2;
  });
  await page.waitForFunction (() => window.b.ended);
  assert.ok (await page.evaluate (() => window.seen.filter (([id, type]) => id === 'b' && type === 'framesetchange').length) < 15);
  await page.evaluate (() => { window.b.play (); });
  await page.waitForFunction (() => !window.b.paused);
  await page.evaluate (() => { window.b.src = ''; });
  await page.waitForFunction (() => window.b.state === 'empty' && window.b.paused && !window.b.ended);
  assert.equal (await page.evaluate (() => window.b.element ('message').hidden), true);
  await page.evaluate (() => { window.b.src = 'nowhere.rcnc'; });
  await has ('b', 'error');
  assert.deepEqual (errors, []);
  await page.close ();
});

test ('mode=strips differs from blend, and is the same in WebGL and in software', async () => {
  write ('modes.html', `<!doctype html><body><script>addEventListener ('framesetchange', ({ target }) => { target.drawn = true; }, true);</script>
    <script type="module" src="./view.js"></script><style>rangecast-view { width: 400px; height: 300px; }</style>
    ${['webgl', 'software'].map ((renderer) => `<rangecast-view src="examples/scene.rcnc" azimuth="45" mode="strips" renderer="${renderer}"></rangecast-view>`)}`);
  const { page, errors } = await open ('modes.html');
  await page.waitForFunction (() => [...document.querySelectorAll ('rangecast-view')].every ((view) => view.drawn));
  const { strips, blended } = await page.evaluate (async () => {
    const views = [...document.querySelectorAll ('rangecast-view')];
    const pixels = () => Promise.all (views.map (async (view) => {
      const image = await createImageBitmap (await view.picture ()), context = new OffscreenCanvas (image.width, image.height).getContext ('2d');
      context.drawImage (image, 0, 0);
      return context.getImageData (0, 0, image.width, image.height).data;
    }));
    const difference = ([a, b]) => a.reduce ((sum, level, i) => sum + Math.abs (level - b[i]), 0) / a.length;
    const strips = await pixels ();
    views.forEach ((view) => view.setAttribute ('mode', 'blend'));
    return { strips: difference (strips), blended: (await pixels ()).map ((now, i) => difference ([now, strips[i]])) };
  });
  assert.ok (3 * strips < Math.min (...blended), `${strips} ${blended}`); // 0.01 and 0.15 levels
  assert.deepEqual (errors, []);
  await page.close ();
});

// In the page of examples/three.html: SSIM of three.js's picture and of the software renderer's, in blocks of 8 pixels that show the person.
const similarity = (page) => page.evaluate (async () => {
  const { THREE, scene, camera, person, renderer } = window, { Core } = await import ('/core.js');
  const others = scene.children.filter ((child) => child.isMesh && child !== person);
  const frame = await new Promise ((resolve) => {
    person.player.addEventListener ('frame', ({ detail }) => resolve ({ state: detail.state, layers: detail.layers.map (({ vertices }) => vertices.slice ()) }), { once: true });
    person.player.again ();
  });
  for (const other of others)
    other.visible = false;
  scene.background = new THREE.Color (0x20242a);
  window.draw ();
  await new Promise (requestAnimationFrame);
  window.draw ();
  const { width, height } = renderer.domElement, canvas = new OffscreenCanvas (width, height), context = canvas.getContext ('2d');
  context.drawImage (renderer.domElement, 0, 0);
  const theirs = context.getImageData (0, 0, width, height).data.slice ();
  const core = new Core (await person.player.ready), clip = new THREE.Matrix4 ().multiplyMatrices (camera.projectionMatrix, camera.matrixWorldInverse);
  core.setScene (frame.state);
  frame.layers.forEach ((vertices, i) => core.bytes (core.call ('rc_draw_layer', i, vertices.length), vertices.length).set (vertices));
  core.input (new Uint8Array (Float32Array.from (clip.elements).buffer));
  core.call ('rc_set_clip', 64);
  const ours = core.bytes (core.call ('rc_draw', width, height, 0), 4 * width * height);
  const grey = (pixels, i) => 0.299 * pixels[i] + 0.587 * pixels[i + 1] + 0.114 * pixels[i + 2];
  let sum = 0, count = 0;
  for (let y = 0; y + 8 <= height; y += 8)
    for (let x = 0; x + 8 <= width; x += 8) {
      let a = 0, b = 0, aa = 0, bb = 0, ab = 0;
      for (let i = 0; i < 64; i++) {
        const at = 4 * ((y + (i >> 3)) * width + x + (i & 7)), p = grey (ours, at), q = grey (theirs, at);
        a += p / 64; b += q / 64; aa += p * p / 64; bb += q * q / 64; ab += p * q / 64;
      }
      if (aa - a * a < 1)
        continue;
      count++;
      sum += (2 * a * b + 6.5) * (2 * (ab - a * b) + 58.5) / ((a * a + b * b + 6.5) * (aa - a * a + bb - b * b + 58.5));
    }
  for (const other of others)
    other.visible = true;
  return { ssim: sum / count, blocks: count };
});

test ('three.js draws the person among other things as we do', async () => {
  const { page, errors } = await open ('examples/three.html?src=scene.rcnc');
  await page.waitForFunction (() => window.person?.painter);
  for (const [i, place] of [[0.3, 0.2, 1.6], [-1.2, 0.3, 0.9], [0.2, 0.5, -1.5]].entries ()) {
    await page.evaluate ((at) => { window.camera.position.set (...at); }, place);
    const { ssim, blocks } = await similarity (page);
    console.log (`SSIM ${ssim.toFixed (4)}`);
    assert.ok (blocks > 200 && ssim > 0.97, `${ssim} in ${blocks} blocks`);
    await screenshot (page, `three-${i}.png`);
  }
  // A box before the person hides it, one behind is hidden; pixels of the middle of the face.
  const colours = await page.evaluate (() => {
    const { THREE, scene, camera, person } = window, results = [];
    camera.position.set (0, 0.05, 1.6);
    const box = new THREE.Mesh (new THREE.BoxGeometry (0.1, 0.1, 0.02), new THREE.MeshBasicMaterial ({ color: 0x00ff00 })), gl = window.renderer.getContext ();
    scene.add (box);
    for (const z of [0.5, -0.5]) {
      box.position.set (0, 0.05, z);
      window.draw ();
      const pixel = new Uint8Array (4);
      gl.readPixels (gl.drawingBufferWidth / 2, gl.drawingBufferHeight / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      results.push (pixel[1] === 255 && pixel[0] === 0);
    }
    scene.remove (box);
    window.renderer.setAnimationLoop (null);
    person.dispose ();
    scene.remove (person);
    window.draw ();
    results.push (gl.getError ());
    return results;
  });
  assert.deepEqual (colours, [true, false, 0]);
  // Lit by a red light, and again after the context was lost.
  const reds = await page.evaluate (async () => {
    const { THREE, renderer, camera } = window, gl = renderer.getContext (), dark = new THREE.Scene (), { RangecastObject } = await import ('/three.js');
    dark.add (new THREE.DirectionalLight (0xff0000, 3), new RangecastObject (new URL ('scene.rcnc', location).href, { lit: true }));
    dark.children[0].position.set (0, 0, 1);
    const red = async () => {
      for (const pixel = new Uint8Array (4); ; await new Promise (requestAnimationFrame)) {
        renderer.render (dark, camera);
        gl.readPixels (gl.drawingBufferWidth / 2, gl.drawingBufferHeight / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        if (pixel[0] > 20)
          return [...pixel.subarray (1, 3)];
      }
    };
    const first = await red (), restored = new Promise ((resolve) => renderer.domElement.addEventListener ('webglcontextrestored', resolve));
    renderer.forceContextLoss ();
    await new Promise ((resolve) => setTimeout (resolve, 100));
    renderer.forceContextRestore ();
    await restored;
    return [...first, ...await red ()];
  });
  assert.deepEqual (reds, [0, 0, 0, 0]);
  assert.deepEqual (errors, []);
  await page.close ();
});

test ('each eye of a WebXR session sees the person among other things', async () => {
  const { page, errors } = await open ('examples/three.html?src=scene.rcnc', fs.readFileSync (path.join (work, 'node_modules/iwer/build/iwer.min.js'), 'utf8') +
    'window.headset = new IWER.XRDevice (IWER.metaQuest3); window.headset.installRuntime ({ forceInstall: true }); window.headset.stereoEnabled = true;');
  await page.waitForFunction (() => window.person?.painter);
  const eyes = await page.evaluate (async () => {
    const { THREE, renderer, scene, camera, headset } = window, gl = renderer.getContext ();
    renderer.setAnimationLoop (null);
    renderer.setSize (640, 480);
    scene.background = new THREE.Color (0);
    renderer.xr.enabled = true;
    await renderer.xr.setSession (await navigator.xr.requestSession ('immersive-vr', { optionalFeatures: ['local-floor'] }));
    headset.position.set (0, 0.05, 0.8);
    for (let pixels = new Uint8Array (4 * 320 * 480), i = 0; ; i++) {
      await new Promise ((resolve) => renderer.setAnimationLoop (resolve));
      renderer.render (scene, camera);
      // The columns in which each eye sees the box behind (green), the face, and the box before (red), from left to right.
      const seen = [0, 320].map ((x0) => {
        gl.readPixels (x0, 0, 320, 480, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        return [(r, g, b) => g > 50 && r < g / 2 && b < g, (r, g, b) => r > 120 && g > r / 2 && b > r / 3 && b < g, (r, g, b) => r > 60 && g < r / 2 && b < r / 2].map ((is) => {
          const columns = Array.from (pixels.keys ()).filter ((i) => i % 4 === 0 && is (...pixels.subarray (i, i + 3))).map ((i) => i / 4 % 320);
          return columns.sort ((p, q) => p - q)[columns.length >> 1];
        });
      });
      if (seen.flat ().every ((x) => x >= 0) || i > 100)
        return { seen, eyes: renderer.xr.getCamera ().cameras.length, error: gl.getError () };
    }
  });
  assert.deepEqual ([eyes.eyes, eyes.error], [2, 0]);
  for (const [behind, face, before] of eyes.seen)
    assert.ok (behind < face && face < before, JSON.stringify (eyes));
  assert.ok (eyes.seen[0][1] > eyes.seen[1][1], JSON.stringify (eyes)); // the left eye sees what is near further right
  assert.deepEqual (errors, []);
  await page.close ();
});

test ('the pages of docs/guide/embed.md show the person', async () => {
  const guide = fs.readFileSync (path.join (source, 'docs/guide/embed.md'), 'utf8'), blocks = [...guide.matchAll (/^```html\n(.*?)^```/gms)];
  assert.equal (blocks.length, 3);
  fs.copyFileSync (path.join (work, 'scene.rcnc'), path.join (folder, 'person.rcnc'));
  for (const [i, [, text]] of blocks.entries ()) {
    write (`guide-${i}.html`, text);
    const { page, errors } = await open (`guide-${i}.html`);
    for (let tries = 0; (await page.screenshot ()).length < 12000; tries++) { // of an empty page: 3000
      assert.ok (tries < 600, `page ${i} stays empty`);
      await new Promise ((resolve) => setTimeout (resolve, 100));
    }
    await screenshot (page, `guide-${i}.png`);
    assert.deepEqual (errors, []);
    await page.close ();
  }
});

test ('the npm package is built by vite into a page of one folder', async () => {
  const app = path.join (work, 'app');
  fs.rmSync (app, { recursive: true, force: true });
  fs.mkdirSync (app);
  execFileSync ('npm', ['pack', '--silent', '--pack-destination', app], { cwd: folder });
  fs.mkdirSync (path.join (app, 'node_modules/gst-rangecast'), { recursive: true });
  execFileSync ('tar', ['xf', path.join (app, 'gst-rangecast-0.1.0.tgz'), '--strip-components=1', '-C', path.join (app, 'node_modules/gst-rangecast')]);
  fs.writeFileSync (path.join (app, 'index.html'), `<!doctype html><body><rangecast-view src="./scene.rcnc" style="height: 300px"></rangecast-view>
    <script type="module" src="./app.js"></script>`);
  fs.writeFileSync (path.join (app, 'app.js'), "import 'gst-rangecast';\ndocument.querySelector ('rangecast-view').addEventListener ('framesetchange', () => { document.title = 'drawn'; });\n");
  execFileSync ('node', [path.join (work, 'node_modules/vite/bin/vite.js'), 'build', '--base', './', '--outDir', path.join (folder, 'built'), '--emptyOutDir', '--logLevel', 'error'], { cwd: app });
  fs.copyFileSync (path.join (work, 'scene.rcnc'), path.join (folder, 'built/scene.rcnc'));
  const { page, errors } = await open ('built/index.html');
  await page.waitForFunction (() => document.title === 'drawn');
  assert.deepEqual (errors, []);
  await page.close ();
});

test ('three.js reads the mesh that plyenc writes', async () => {
  const { GLTFLoader } = await import (path.join (work, 'node_modules/three/examples/jsm/loaders/GLTFLoader.js'));
  const bytes = fs.readFileSync (path.join (work, 'scene.glb'));
  const { scene } = await new GLTFLoader ().parseAsync (bytes.buffer.slice (bytes.byteOffset, bytes.byteOffset + bytes.length), '');
  const mesh = scene.children[0], { position, color } = mesh.geometry.attributes;
  assert.equal (mesh.material.type, 'MeshBasicMaterial');
  assert.ok (position.count > 20000 && mesh.geometry.index.count > 3 * position.count, `${position.count} ${mesh.geometry.index.count}`);
  assert.ok (Math.max (...mesh.geometry.index.array.slice (0, 60000)) < position.count);
  mesh.geometry.computeBoundingBox ();
  const { min, max } = mesh.geometry.boundingBox;
  assert.ok (max.y - min.y > 0.2 && max.y - min.y < 1, `${min.y} to ${max.y}`); // a head, in metres
  assert.ok (color.normalized && color.getX (position.count >> 1) > 0.01);
  // Triangles face outwards, where the cameras are.
  const triangle = [0, 1, 2].map ((corner) => mesh.geometry.index.getX (3000 + corner));
  const [a, b, c] = triangle.map ((i) => [position.getX (i), position.getY (i), position.getZ (i)]);
  const u = b.map ((v, i) => v - a[i]), v = c.map ((value, i) => value - a[i]);
  const up = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  assert.ok (up[0] * a[0] + up[2] * a[2] > 0, `${up} at ${a}`);
});

// SPDX-License-Identifier: LGPL-2.1-or-later
// The page's main thread: it owns the picture and the camera; decoder.js, a worker, owns stream, decoder and geometry. Parameters of the
// address: src=URL of a recording; server=URL of a stream (default: this page's server, if that has one); stats; fit=0: the first camera's view; azimuth, elevation (degrees); time (ms) and paused;
// transparent: nothing but the person; renderer=webgl or software.
// A token comes in the fragment (#token=...), which stays in this browser.
import { Core } from './core.js';
import { followPointers } from './pointers.js';
import { makeRenderer } from './renderer.js';
import { findServer, storeToken, readToken } from './server.js';
import { Speech } from './speech.js';
import { Stats } from './stats.js';

const element = (id) => document.getElementById (id);
const canvas = element ('picture');
const parameters = new URLSearchParams (location.search);
document.documentElement.classList.toggle ('transparent', parameters.has ('transparent'));

// ---- what the page says ----

// kind: 'error' or 'note'; an empty text hides it
const say = (text, kind = 'error') => {
  const place = element ('message');
  place.textContent = text;
  place.className = kind;
  place.hidden = text === '';
  document.body.dataset.message = text;
};

const save = (blob, name) => {
  const link = document.createElement ('a');
  link.href = URL.createObjectURL (blob);
  link.download = name;
  link.click ();
  setTimeout (() => URL.revokeObjectURL (link.href), 60000);
};
const timeText = (ms) => {
  const seconds = Math.max (0, ms) / 1000;
  return `${Math.floor (seconds / 60)}:${(seconds % 60).toFixed (1).padStart (4, '0')}`;
};

const REST = 500; // ms without a new picture until the last one is drawn with all pixels
// Where drawing takes longer than SLOW ms for a picture, pictures that move have fewer pixels, until it takes less than FAST.
const MIN_SCALE = 0.4, SLOW = 80, FAST = 30; // the scale is that of width and height

class Page {
  // worker: of decoder.js
  constructor (module, worker) {
    this.worker = worker;
    this.worker.onmessage = ({ data }) => this[data.type] (data);
    this.worker.postMessage ({ type: 'start', module });
    this.camera = new Core (module);
    this.renderer = makeRenderer (canvas, this.camera, parameters.has ('transparent'), parameters.get ('renderer'));
    this.speech = new Speech (say, (wait) => this.worker.postMessage ({ type: 'hold', wait }));
    this.stats = new Stats (element ('stats'), parameters.has ('stats'), (latency) => this.speech.follow (latency));
    this.pending = null; // the newest frame set, not uploaded yet
    this.scale = 1; // of the resolution of moving pictures
    this.wanted = this.painting = false; // another picture; one is under way
    this.resting = false; // the next one is to have all pixels
    this.server = null; // { url, token }
    if (parameters.has ('azimuth') || parameters.has ('elevation'))
      this.camera.call ('rc_set_orbit', Number (parameters.get ('azimuth') ?? 0), Number (parameters.get ('elevation') ?? 0), 0, 0, 0, 0, 0);
    this.watch ();
    this.draw ();
  }

  // ---- from the worker ----

  frame (frame) {
    if (this.pending)
      this.stats.skip ();
    this.pending = frame;
    this.draw ();
  }
  position ({ time, duration, playing }) {
    const seek = element ('seek');
    element ('token').hidden = true;
    this.showBar (false);
    seek.max = Math.max (duration, 1);
    seek.disabled = duration < 0;
    if (!seek.matches (':active'))
      seek.value = time;
    element ('time').textContent = duration < 0 ? timeText (time) : `${timeText (time)} / ${timeText (duration)}`;
    element ('play').textContent = playing ? 'Pause' : 'Play';
    document.body.dataset.state = playing ? 'playing' : 'paused';
  }
  say ({ text, kind }) { say (text, kind); }
  live ({ state }) {
    document.body.dataset.state = state;
    element ('live').hidden = state !== 'receiving';
    element ('token').hidden = state !== 'token';
    if (state === 'token')
      element ('token-text').focus ();
    if (state === 'receiving')
      this.showBar (true);
  }
  hear ({ packet }) { this.speech.add (packet); }
  audio ({ available }) {
    element ('sound').hidden = !available;
    element ('sound').textContent = this.speech.isOn ? 'Mute' : 'Sound';
  }
  points ({ file }) {
    if (file)
      save (new Blob ([file], { type: 'model/ply' }), 'rangecast.ply');
  }

  showBar (live) {
    element ('bar').hidden = false;
    element ('bar').classList.toggle ('live', live);
    element ('welcome').hidden = true;
  }

  // What was asked for last is shown from now on.
  opened () {
    if (this.speech.isOn)
      this.speech.stop ();
    this.audio ({ available: false }); // until there is some
  }

  // ---- drawing ----

  setScene (state) {
    if (this.camera.input (new Uint8Array (state)))
      this.camera.call ('rc_camera_scene', state.byteLength);
  }

  draw () {
    this.wanted = true;
    if (this.painting)
      return;
    this.painting = true;
    requestAnimationFrame (() => this.drawNext ());
  }
  // The next picture has to wait until this one has been drawn, so that it is of the newest frame set.
  async drawNext () {
    clearTimeout (this.rest);
    const whole = this.resting, scale = whole ? 1 : this.scale;
    this.wanted = this.resting = false;
    try {
      const begin = performance.now ();
      this.setSize (scale);
      const frame = this.paint ();
      await this.renderer.finished ();
      const time = performance.now () - begin, factor = time > SLOW ? 0.8 : time < FAST ? 1.1 : 1;
      if (!whole)
        this.scale = Math.max (MIN_SCALE, Math.min (1, this.scale * factor));
      this.shown (frame, begin, scale);
    } finally {
      this.painting = false;
    }
    if (this.wanted)
      this.draw ();
    else if (scale < 1)
      this.rest = setTimeout (() => {
        this.resting = true;
        this.draw ();
      }, REST);
  }

  // Draws a picture. Returns the frame set that is new in it, if any.
  paint () {
    const frame = this.pending;
    this.pending = null;
    try {
      if (frame) {
        this.setScene (frame.state);
        this.renderer.upload (frame.layers);
      }
      this.renderer.draw ();
    } catch (error) {
      say (error.message);
      if (!frame) // the core was made anew, without a scene
        this.postedView = '';
    }
    this.postView ();
    return frame;
  }
  // begin: when its drawing began; scale: of the resolution
  shown (frame, begin, scale = 1) {
    if (!frame)
      return;
    this.worker.postMessage ({ type: 'shown' });
    this.stats.shown (frame, performance.now () - begin, scale);
    document.body.dataset.frameSets = Number (document.body.dataset.frameSets ?? 0) + 1;
  }

  // The camera decides which views are reduced, and the shape of the picture what fits.
  postView () {
    const view = { ...this.camera.record ('rc_orbit'), aspect: (canvas.clientWidth || 1) / (canvas.clientHeight || 1),
      fit: parameters.get ('fit') !== '0' };
    const text = JSON.stringify (view);
    if (text !== this.postedView)
      this.worker.postMessage ({ type: 'view', view });
    this.postedView = text;
  }

  // ---- from the user ----

  openLive (url, token) {
    this.server = { url, token };
    this.worker.postMessage ({ type: 'open', live: this.server });
  }
  // recording: a File or an address
  open (recording) {
    this.worker.postMessage ({ type: 'open', recording, paused: parameters.has ('paused'), time: Number (parameters.get ('time') ?? 0) });
  }

  // scale: of the resolution of the screen
  setSize (scale) {
    const { clientWidth, clientHeight } = canvas;
    const ratio = Math.min (scale * (window.devicePixelRatio || 1), this.renderer.largest / Math.max (clientWidth, clientHeight));
    for (const [side, length] of [['width', clientWidth], ['height', clientHeight]]) {
      const pixels = Math.max (1, Math.round (length * ratio));
      if (canvas[side] !== pixels)
        canvas[side] = pixels;
    }
  }

  move (name, ...args) {
    this.camera.call (name, ...args);
    this.draw ();
  }
  key (event) {
    const actions = {
      ArrowLeft: () => this.move ('rc_step', -1, 0), ArrowRight: () => this.move ('rc_step', 1, 0),
      ArrowUp: () => this.move ('rc_step', 0, 1), ArrowDown: () => this.move ('rc_step', 0, -1),
      '+': () => this.move ('rc_step_nearer', 1), '=': () => this.move ('rc_step_nearer', 1), '-': () => this.move ('rc_step_nearer', 0),
      Escape: () => say (''),
      Home: () => this.move ('rc_go_home'), r: () => this.move ('rc_go_home'),
      ' ': () => this.worker.postMessage ({ type: 'toggle' }),
    };
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches ('input, button') || !actions[event.key])
      return;
    event.preventDefault ();
    actions[event.key] ();
  }

  watch () {
    new ResizeObserver (() => this.draw ()).observe (canvas);
    followPointers (canvas, (name, ...args) => this.move (name, ...args));
    addEventListener ('keydown', (event) => this.key (event));
    canvas.addEventListener ('webglcontextlost', (event) => {
      event.preventDefault ();
      say ('The browser has reset WebGL; rendering resumes when it is restored.');
    });
    canvas.addEventListener ('webglcontextrestored', () => {
      this.renderer.start ();
      say ('');
      this.postedView = '';
      this.worker.postMessage ({ type: 'again' });
    });
    element ('message').onclick = () => say ('');
    element ('play').onclick = () => this.worker.postMessage ({ type: 'toggle' });
    element ('seek').oninput = () => this.worker.postMessage ({ type: 'seek', time: Number (element ('seek').value) });
    element ('home').onclick = () => this.move ('rc_go_home');
    element ('sound').onclick = () => {
      this.speech.toggle ();
      this.audio ({ available: true });
    };
    element ('save-picture').onclick = () => {
      this.setSize (1);
      this.shown (this.paint (), performance.now ());
      canvas.toBlob ((blob) => blob && save (blob, 'rangecast.png'));
    };
    element ('save-points').onclick = () => this.worker.postMessage ({ type: 'points' });
    element ('token').onsubmit = (event) => {
      event.preventDefault ();
      say ('');
      element ('token').hidden = true;
      storeToken (this.server.url, element ('token-text').value);
      this.openLive (this.server.url, element ('token-text').value);
    };
    element ('file').onchange = ({ target }) => {
      if (target.files.length > 0)
        this.open (target.files[0]);
      target.value = ''; // so that the same file can be chosen again
    };
    addEventListener ('dragover', (event) => {
      event.preventDefault ();
      document.body.classList.add ('dropping');
    });
    addEventListener ('dragleave', () => document.body.classList.remove ('dropping'));
    addEventListener ('drop', (event) => {
      event.preventDefault ();
      document.body.classList.remove ('dropping');
      if (event.dataTransfer.files.length > 0)
        this.open (event.dataTransfer.files[0]);
    });
  }
}

const loadModule = async () => {
  const answer = await fetch ('rangecast.wasm');
  if (!answer.ok)
    throw new Error (`The decoder could not be loaded: ${answer.status} ${answer.statusText}.`);
  return WebAssembly.compile (await answer.arrayBuffer ()).catch ((error) => {
    throw new Error (`This browser cannot run the decoder: ${error.message}.`);
  });
};

// A stream to show immediately: { url, title }, or null.
const findStream = async () => {
  if (parameters.has ('src'))
    return null;
  return parameters.has ('server') ? { url: new URL (parameters.get ('server'), location).href.replace (/^http/, 'ws') } : findServer ();
};

try {
  const worker = new Worker ('decoder.js', { type: 'module' });
  worker.onerror = (event) => say (`The decoder could not be started: ${event.message ?? 'its file could not be loaded'}.`);
  const [module, stream] = await Promise.all ([loadModule (), findStream ()]);
  const page = new Page (module, worker);
  window.rangecastPage = page; // for tests and for the curious
  document.title = stream?.title || document.title;
  if (parameters.has ('src'))
    page.open (new URL (parameters.get ('src'), location).href);
  else if (stream)
    page.openLive (stream.url, readToken (stream.url));
  else
    element ('welcome').hidden = false;
} catch (error) {
  say (error.message);
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// <rangecast-view>: a live person or a recording in 3D, with the camera in the viewer's hands. Attributes (docs/guide/embed.md):
//   src (ws: or wss: of a stream, or a recording), token, autoplay=false, controls, azimuth, elevation (degrees), distance (m), fit=false,
//   mode (blend or strips), renderer (webgl or software), transparent, show-stats
// The event framesetchange follows each frame set that was drawn; `player` is the Player.
import { Core } from './core.js';
import { Player } from './player.js';
import { followPointers } from './pointers.js';
import { makeRenderer } from './renderer.js';
import { Stats } from './stats.js';

const REST = 500; // ms without a new picture until the last one is drawn with all pixels
// Where drawing takes longer than SLOW ms for a picture, pictures that move have fewer pixels, until it takes less than FAST.
const MIN_SCALE = 0.4, SLOW = 80, FAST = 30; // the scale is that of width and height

const style = new CSSStyleSheet ();
style.replaceSync (`
:host { position: relative; display: block; overflow: hidden; min-height: 60px; background: #20242a; color: #e8eaed; font: 15px/1.4 system-ui, sans-serif; }
:host([transparent]) { background: none; }
[hidden], :host(:not([controls])) #bar, :host(:not([controls])) #message { display: none !important; }
#picture { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; outline: none; }
#message { position: absolute; top: 0; left: 0; right: 0; margin: 0; padding: 0.6em 1em; background: #7a2e1fe6; text-align: center; cursor: pointer; }
#message::after { content: '\\A0\\A0\\2715'; opacity: 0.7; }
#message.note { background: #2b3a4de6; }
#stats { position: absolute; top: 3em; left: 0.6em; margin: 0; padding: 0.5em; background: #0009; font-size: 12px; pointer-events: none;
  max-width: calc(100% - 2.2em); white-space: pre-wrap; }
#stats:empty { display: none; }
#bar.live .recorded, #bar:not(.live) #live { display: none; }
#bar.live #live[hidden] { display: inline !important; visibility: hidden; }
button { font: inherit; color: inherit; background: #ffffff1f; border: 0; border-radius: 6px; padding: 0.45em 0.8em; cursor: pointer; }
button:hover { background: #ffffff38; }
#bar { position: absolute; left: 0; right: 0; bottom: 0; display: flex; flex-wrap: wrap; gap: 0.5em; align-items: center; background: #0007;
  padding: 0.5em max(0.6em, env(safe-area-inset-right)) max(0.5em, env(safe-area-inset-bottom)) max(0.6em, env(safe-area-inset-left)); }
#seek { flex: 1 1 8em; min-width: 6em; }
#live { margin-right: auto; }
#live::before { content: '\\25CF\\A0'; color: #e5534b; }
#time { font-variant-numeric: tabular-nums; }
@media (max-width: 480px) { #seek { order: -1; flex-basis: 100%; } #bar { gap: 0.3em; } button { flex: 1; padding: 0.45em 0.3em; white-space: nowrap; } }`);

const CONTENT = `
<canvas id="picture" tabindex="0" aria-label="The person, in 3D. Drag to orbit, Shift and drag to pan, wheel to zoom."></canvas>
<p id="message" role="status" hidden></p>
<pre id="stats" hidden></pre>
<footer id="bar" hidden>
  <button id="play" class="recorded" title="Play or pause (space)">Pause</button>
  <input id="seek" class="recorded" type="range" min="0" max="1" step="1" value="0" aria-label="Time">
  <output id="time" class="recorded"></output>
  <output id="live">Live</output>
  <button id="sound" title="Hear the person" hidden>Sound</button>
  <button id="home" title="Show the whole person (Home)">Fit</button>
  <button id="save-picture" title="Save this frame (PNG)">PNG</button>
  <button id="save-points" title="Save the points of this frame set (PLY)">PLY</button>
</footer>`;

const save = (blob, name) => {
  const link = document.createElement ('a');
  link.href = URL.createObjectURL (blob);
  link.download = name;
  link.click ();
  setTimeout (() => URL.revokeObjectURL (link.href), 60000);
};
const timeText = (seconds) => `${Math.floor (seconds / 60)}:${(seconds % 60).toFixed (1).padStart (4, '0')}`;

export class RangecastView extends HTMLElement {
  static observedAttributes = ['src', 'token', 'azimuth', 'elevation', 'distance', 'mode', 'show-stats'];

  constructor () {
    super ();
    this.attachShadow ({ mode: 'open' }).adoptedStyleSheets = [style];
    this.addEventListener ('keydown', (event) => this.key (event));
    this.wantedOrbit = {}; // until there is a camera
    this.loading = null; // what a load () asked for that has not begun yet: [source, options]
  }
  element (id) { return this.shadowRoot.getElementById (id); }

  // ---- in and out of the document ----

  async connectedCallback () {
    for (const name of ['src', 'token', 'orbit'])
      if (Object.hasOwn (this, name)) { // set before the element was defined
        const value = this[name];
        delete this[name];
        this[name] = value;
      }
    this.shadowRoot.innerHTML = CONTENT;
    this.canvas = this.element ('picture');
    this.pending = null; // the newest frame set, not uploaded yet
    this.scale = 1; // of the resolution of moving pictures
    this.wanted = this.painting = false; // another picture; one is under way
    this.resting = false; // the next one is to have all pixels
    this.postedView = ''; // what the player was told last
    const player = this.player = new Player ();
    this.meter = new Stats (this.element ('stats'), this.hasAttribute ('show-stats'), (latency) => player.speech.follow (latency));
    this.follow (player);
    const asked = this.loading ?? []; // before it was in the document
    this.loading = null;
    this.load (...asked);
    const module = await player.ready.catch (() => null);
    if (!module || this.player !== player)
      return;
    this.camera = new Core (module);
    this.renderer = makeRenderer (this.canvas, this.camera, this.hasAttribute ('transparent'), this.getAttribute ('renderer') ?? undefined);
    this.setOrbit ();
    this.orbit = this.wantedOrbit;
    this.watch ();
    this.draw ();
  }
  disconnectedCallback () {
    this.player.close ();
    this.wantedOrbit = this.orbit;
    this.observer?.disconnect ();
    this.renderer?.close ();
    clearTimeout (this.rest);
    this.player = this.camera = this.renderer = null;
  }
  attributeChangedCallback (name, before, value) {
    if (!this.player || before === value)
      return;
    if (name === 'show-stats')
      this.element ('stats').hidden = value === null;
    else if (name === 'src' || name === 'token')
      this.load ();
    else if (name === 'mode')
      this.draw ();
    else
      this.setOrbit ();
  }

  // ---- as of a media element ----

  get src () { return this.getAttribute ('src') ?? ''; }
  set src (address) { this.setAttribute ('src', address); }
  get token () { return this.getAttribute ('token') ?? undefined; }
  set token (token) {
    if (token === undefined || token === null)
      this.removeAttribute ('token');
    else
      this.setAttribute ('token', token);
  }
  get state () { return this.player?.state ?? 'empty'; }
  get paused () { return this.player?.paused ?? true; }
  get ended () { return this.player?.ended ?? false; }
  get seeking () { return this.player?.seeking ?? false; }
  get duration () { return this.player?.duration ?? NaN; }
  get currentTime () { return this.player?.currentTime ?? 0; }
  set currentTime (seconds) {
    if (this.loading)
      this.load (this.loading[0], { ...this.loading[1], time: seconds });
    else if (this.player)
      this.player.currentTime = seconds;
  }
  play () { this.control ('play', false); }
  pause () { this.control ('pause', true); }
  control (name, paused) {
    if (this.loading)
      this.load (this.loading[0], { ...this.loading[1], paused });
    else
      this.player?.[name] ();
  }
  // Shows src, an address or a File, soon: the last call counts. Without any, the stream ends. options: see Player.open ()
  load (source = this.src, options = {}) {
    if (!this.loading)
      queueMicrotask (() => this.openLoading ());
    this.loading = [source, options];
  }
  openLoading () {
    const { player } = this;
    if (!player || !this.loading) // once it is in the document
      return;
    const [source, options] = this.loading;
    this.loading = null;
    player.open (source, { token: this.token, paused: this.getAttribute ('autoplay') === 'false', ...options }).catch (() => {});
  }

  // ---- of the picture ----

  // { azimuth, elevation (degrees), distance (m, 0: default), fieldOfView (degrees, 0: default), panX, panY, panZ (m) }; any of them may be set
  get orbit () { return this.camera?.record ('rc_orbit') ?? this.wantedOrbit; }
  set orbit (values) {
    if (!this.camera) {
      this.wantedOrbit = { ...this.wantedOrbit, ...values };
      return;
    }
    const o = { ...this.orbit, ...values };
    if (!Object.values (o).every (Number.isFinite))
      throw new TypeError ('orbit takes finite numbers');
    this.move ('rc_set_orbit', o.azimuth, o.elevation, o.distance, o.fieldOfView, o.panX, o.panY, o.panZ);
  }
  setOrbit () {
    const given = ['azimuth', 'elevation', 'distance'].filter ((name) => this.hasAttribute (name));
    if (given.length > 0)
      this.orbit = Object.fromEntries (given.map ((name) => [name, Math.max (-1e6, Math.min (1e6, Number (this.getAttribute (name)) || 0))]));
  }
  // Shows the whole person again.
  home () { this.move ('rc_go_home'); }
  // Of the last second: see Stats
  get stats () { return this.meter?.last; }
  // Resolves to a PNG with all pixels (Blob).
  async picture () {
    if (!this.renderer)
      return null;
    this.setSize (1);
    this.shown (this.paint (), performance.now ());
    return new Promise ((resolve) => this.canvas.toBlob (resolve));
  }

  // ---- from the player ----

  follow (player) {
    for (const type of ['loadedmetadata', 'play', 'pause', 'timeupdate', 'seeking', 'seeked', 'ended', 'error', 'message', 'statechange', 'audiochange'])
      player.addEventListener (type, ({ detail }) => {
        this.show (type, detail);
        this.dispatchEvent (new CustomEvent (type, { detail }));
      });
    player.addEventListener ('frame', ({ detail }) => {
      if (this.pending)
        this.meter.skip ();
      this.pending = detail;
      this.draw ();
    });
  }
  // In the controls.
  show (type, detail) {
    const { player } = this;
    if (type === 'message')
      this.say (detail.text, detail.kind);
    else if (type === 'audiochange') {
      this.element ('sound').hidden = !player.audio;
      this.element ('sound').textContent = player.speech.isOn ? 'Mute' : 'Sound';
    } else if (type === 'timeupdate') {
      const seek = this.element ('seek'), known = Number.isFinite (player.duration);
      seek.max = known ? Math.max (1000 * player.duration, 1) : 1;
      seek.disabled = !known;
      if (!seek.matches (':active'))
        seek.value = player.time;
      this.element ('time').textContent = timeText (player.currentTime) + (known ? ` / ${timeText (player.duration)}` : '');
      this.showBar (false);
    } else if (type === 'statechange') {
      this.element ('play').textContent = player.state === 'playing' ? 'Pause' : 'Play';
      this.element ('live').hidden = player.state !== 'receiving';
      if (player.state === 'receiving')
        this.showBar (true);
    }
  }
  showBar (live) {
    this.element ('bar').hidden = false;
    this.element ('bar').classList.toggle ('live', live);
  }
  // kind: 'error' or 'note'; an empty text hides it
  say (text, kind = 'error') {
    const place = this.element ('message');
    place.textContent = text;
    place.className = kind;
    place.hidden = text === '';
  }
  // What the renderer says.
  report (text) { this.player?.say ({ text }); }

  // ---- drawing ----

  draw () {
    this.wanted = true;
    if (this.painting || !this.renderer)
      return;
    this.painting = true;
    requestAnimationFrame (() => this.drawNext ());
  }
  // The next picture has to wait until this one has been drawn, so that it is of the newest frame set.
  async drawNext () {
    const { renderer } = this;
    if (!renderer) // it has left the document
      return;
    clearTimeout (this.rest);
    const whole = this.resting, scale = whole ? 1 : this.scale;
    this.wanted = this.resting = false;
    try {
      const begin = performance.now ();
      this.setSize (scale);
      const frame = this.paint ();
      await renderer.finished ();
      if (this.renderer !== renderer)
        return;
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
        this.camera.setScene (frame.state);
        this.renderer.upload (frame.layers);
      }
      this.renderer.strips = this.getAttribute ('mode') === 'strips';
      this.renderer.draw ();
    } catch (error) {
      this.report (error.message);
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
    this.player.shown ();
    this.meter.shown (frame, performance.now () - begin, scale);
    this.dispatchEvent (new CustomEvent ('framesetchange', { detail: { views: frame.views, points: frame.points, captureTime: frame.captureTime } }));
  }

  // The camera decides which views are reduced, and the shape of the picture what fits.
  postView () {
    const view = { ...this.camera.record ('rc_orbit'), aspect: (this.canvas.clientWidth || 1) / (this.canvas.clientHeight || 1),
      fit: this.getAttribute ('fit') !== 'false' };
    const text = JSON.stringify (view);
    if (text !== this.postedView)
      this.player.setView (view);
    this.postedView = text;
  }

  // scale: of the resolution of the screen
  setSize (scale) {
    const { canvas } = this, { clientWidth, clientHeight } = canvas;
    const ratio = Math.min (scale * (window.devicePixelRatio || 1), this.renderer.largest / Math.max (clientWidth, clientHeight));
    for (const [side, length] of [['width', clientWidth], ['height', clientHeight]]) {
      const pixels = Math.max (1, Math.round (length * ratio));
      if (canvas[side] !== pixels)
        canvas[side] = pixels;
    }
  }

  // ---- from the user ----

  move (name, ...args) {
    this.camera?.call (name, ...args);
    this.draw ();
  }
  key (event) {
    const actions = {
      ArrowLeft: () => this.move ('rc_step', -1, 0), ArrowRight: () => this.move ('rc_step', 1, 0),
      ArrowUp: () => this.move ('rc_step', 0, 1), ArrowDown: () => this.move ('rc_step', 0, -1),
      '+': () => this.move ('rc_step_nearer', 1), '=': () => this.move ('rc_step_nearer', 1), '-': () => this.move ('rc_step_nearer', 0),
      Escape: () => this.report (''),
      Home: () => this.home (), r: () => this.home (),
      ' ': () => this.player.toggle (),
    };
    if (!this.camera || event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || !actions[event.key] ||
        event.composedPath ()[0].matches?.('input, button'))
      return;
    event.preventDefault ();
    actions[event.key] ();
  }

  watch () {
    const { canvas, player } = this;
    this.observer = new ResizeObserver (() => this.draw ());
    this.observer.observe (canvas);
    followPointers (canvas, (name, ...args) => this.move (name, ...args));
    canvas.addEventListener ('webglcontextlost', (event) => {
      event.preventDefault ();
      if (canvas === this.canvas && this.renderer)
        this.report ('The browser has reset WebGL; rendering resumes when it is restored.');
    });
    canvas.addEventListener ('webglcontextrestored', () => {
      if (canvas !== this.canvas || !this.renderer)
        return;
      this.renderer.start ();
      this.report ('');
      this.postedView = '';
      player.again ();
    });
    this.element ('message').onclick = () => this.report ('');
    this.element ('play').onclick = () => player.toggle ();
    this.element ('seek').oninput = ({ target }) => { player.currentTime = Number (target.value) / 1000; };
    this.element ('home').onclick = () => this.home ();
    this.element ('sound').onclick = () => player.toggleSound ();
    this.element ('save-picture').onclick = async () => save (await this.picture (), 'rangecast.png');
    this.element ('save-points').onclick = async () => {
      const file = await player.savePoints ();
      if (file)
        save (new Blob ([file], { type: 'model/ply' }), 'rangecast.ply');
    };
  }
}

customElements.define ('rangecast-view', RangecastView);

// SPDX-License-Identifier: LGPL-2.1-or-later
// Plays a stream or a recording without drawing it: owns the worker (decoder.js) that decodes, and the sound. view.js and three.js draw.
import { Speech } from './speech.js';

let compiled; // all players of a page share the module
const loadModule = () => compiled ??= (async () => {
  const answer = await fetch (new URL ('./rangecast.wasm', import.meta.url));
  if (!answer.ok)
    throw new Error (`The decoder could not be loaded: ${answer.status} ${answer.statusText}.`);
  return WebAssembly.compile (await answer.arrayBuffer ()).catch ((error) => {
    throw new Error (`This browser cannot run the decoder: ${error.message}.`);
  });
}) ();

// Events, as of a media element where there is the same: loadedmetadata, play, pause, timeupdate, seeking, seeked, ended, error; and
//   frame         detail: layers (vertices for the renderer), state (for rc_camera_scene), and what Core.frame () says
//   message       detail: text ('' hides the one before), kind ('error' or 'note')
//   statechange   state has changed
//   audiochange   audio has changed
export class Player extends EventTarget {
  constructor () {
    super ();
    this.state = 'empty'; // of a recording: playing, paused; of a stream: connecting, waiting, receiving, ended, closed, token
    this.live = false;
    this.audio = false; // whether the stream has sound
    this.duration = NaN; // seconds
    this.time = 0; // ms
    this.seekingTo = null;
    this.takePoints = []; // for each savePoints () that waits
    this.plays = this.stopped = this.atEnd = false; // plays: what the last event said
    this.loading = false; // nothing was shown yet of what was opened last
    this.worker = new Worker (new URL ('./decoder.js', import.meta.url), { type: 'module' });
    this.worker.onmessage = ({ data }) => this[data.type] (data);
    this.worker.onerror = (event) => this.say ({ text: `The decoder could not be started: ${event.message ?? 'its file could not be loaded'}.` });
    this.speech = new Speech ((text, kind) => this.say ({ text, kind }), (wait) => this.post ({ type: 'hold', wait }));
    this.ready = loadModule ().then ((module) => {
      this.worker.postMessage ({ type: 'start', module });
      return module;
    });
    this.ready.catch ((error) => {
      compiled = undefined; // so that another player tries again
      this.say ({ text: error.message });
    });
  }

  // source: address of a stream (ws:, wss:), of a playlist (.m3u8) or of a recording, or a File; none: as stop (); time: s
  async open (source, { token, time = 0, paused = false } = {}) {
    if (!source)
      return this.stop ();
    try {
      source = typeof source === 'string' ? new URL (source, document.baseURI).href : source;
    } catch {
      return this.say ({ text: `'${source}' is no address.` });
    }
    await this.ready;
    this.live = typeof source === 'string' && /^wss?:/.test (source);
    this.post (this.live ? { type: 'open', live: { url: source, token } } : { type: 'open', recording: source, paused, time: 1000 * time });
  }
  // Ends the stream or recording; the last frame stays.
  stop () {
    this.post ({ type: 'close' });
    this.stopped = true;
    this.atEnd = false;
    this.setState ('empty');
    this.say ({ text: '' });
  }
  toggle () { this.post ({ type: 'toggle' }); }
  play () { this.post ({ type: 'play' }); }
  pause () { this.post ({ type: 'pause' }); }
  get paused () { return !this.plays; }
  get ended () { return this.paused && this.atEnd; }
  get seeking () { return this.seekingTo !== null; }
  get currentTime () { return this.time / 1000; }
  set currentTime (seconds) {
    if (!Number.isFinite (seconds))
      throw new TypeError (`currentTime takes a finite number of seconds, not ${seconds}`);
    this.seekingTo = 1000 * seconds;
    this.emit ('seeking');
    this.post ({ type: 'seek', time: this.seekingTo });
  }
  // Asks for the points of the current frame set. Resolves to a PLY file (ArrayBuffer), undefined if there are none
  savePoints () {
    this.post ({ type: 'points' });
    return new Promise ((resolve) => this.takePoints.push (resolve));
  }
  // In answer to a click: plays the sound, or no longer.
  toggleSound () {
    this.speech.toggle ();
    this.emit ('audiochange');
  }
  // What the frames are to be drawn from: of rc_orbit, aspect, fit
  setView (view) { this.post ({ type: 'view', view }); }
  // The frame was drawn: the next one may come.
  shown () { this.post ({ type: 'shown' }); }
  // The last frame again, after what was drawn has been lost.
  again () { this.post ({ type: 'again' }); }
  close () {
    this.worker.terminate ();
    this.takePoints.splice (0).forEach ((take) => take ());
    if (this.speech.isOn)
      this.speech.stop ();
  }

  post (message) { this.ready.then (() => this.worker.postMessage (message), () => {}); }
  emit (type, detail) { this.dispatchEvent (new CustomEvent (type, { detail })); }
  setState (state) {
    const before = this.state;
    this.state = state;
    if (state === before)
      return;
    this.emit ('statechange');
    const plays = state === 'playing' || state === 'receiving' || (state === 'waiting' && this.plays);
    if (plays !== this.plays && (plays || state === 'paused'))
      this.emit (plays ? 'play' : 'pause');
    this.plays = plays;
    if ((state === 'paused' && this.atEnd) || state === 'ended')
      this.emit ('ended');
  }

  // ---- from the worker ----

  frame (frame) {
    if (this.loading)
      this.emit ('loadedmetadata');
    this.loading = false;
    this.emit ('frame', frame);
  }
  position ({ time, duration, playing, ended }) {
    if (this.stopped) // it was under way
      return;
    this.time = time;
    this.duration = duration < 0 ? NaN : duration / 1000;
    this.atEnd = ended;
    this.setState (playing ? 'playing' : 'paused');
    this.emit ('timeupdate');
  }
  sought () {
    this.seekingTo = null;
    this.emit ('seeked');
  }
  say ({ text, kind = text ? 'error' : 'note' }) {
    this.emit ('message', { text, kind });
    if (text !== '' && kind === 'error')
      this.emit ('error', { message: text });
  }
  connection ({ state }) {
    this.duration = Infinity;
    if (!this.stopped)
      this.setState (state);
  }
  hear ({ packet }) { this.speech.add (packet, this.live); }
  sound ({ available }) {
    this.audio = available;
    this.emit ('audiochange');
  }
  points ({ file }) { this.takePoints.shift ()?.(file); }
  // What was asked for last is shown from now on.
  opened () {
    this.loading = true;
    this.stopped = this.atEnd = false;
    this.time = 0;
    this.duration = NaN;
    if (this.speech.isOn)
      this.speech.stop ();
    this.sound ({ available: false }); // until there is some
  }
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// The worker: decodes what a source delivers and makes vertices of the newest frame set, when the page has drawn the one before.
//
// A source is a class with start (paused, ms), close () and, where it can, toggle () and seek (ms). It gets this stage: core to decode
// with, decode () round each call of it, decoded (due) after each frame set, post (...) and say (...).
import { Core, DONE } from './core.js';
import { LiveSource } from './live-source.js';
import { RecordingSource } from './recording-source.js';
import { SegmentSource } from './segment-source.js';

class Stage {
  constructor (module) {
    this.core = new Core (module);
    this.source = this.wanted = null; // wanted: the last one that was asked for
    this.view = null; // what the page looks from
    this.drawing = false; // the page has a frame set that it has not drawn yet
    this.waiting = null; // of the newest frame set, not shown yet: due, held (it does not follow the one before in the stream's time)
    this.skipped = 0;
    this.decodeTime = 0;
    this.dropped = null; // frame sets, by the server of a live source
  }

  post (message) { postMessage (message); }
  say (text, kind = text ? 'error' : 'note') { this.post ({ type: 'say', text, kind }); }

  // decode (): an Outcome. Measures it; a failure of the core is said, and FAILED returned.
  decode (decode) {
    const begin = performance.now ();
    const outcome = decode ();
    this.decodeTime += performance.now () - begin;
    return outcome;
  }

  // The core has a new frame set. due: when it should be seen, ms since the epoch; held: while nothing plays
  decoded (due, held = false) {
    if (this.waiting && !this.waiting.held)
      this.skipped++;
    this.waiting = { due, held };
    this.show ();
  }

  show () {
    if (!this.waiting || this.drawing || !this.view)
      return;
    const { waiting } = this, begin = performance.now ();
    this.waiting = null;
    if (!this.build ())
      return;
    const { core } = this, layers = [], transfer = [];
    for (let i = 0; i < core.call ('rc_layers'); i++) {
      const layer = core.record ('rc_layer', i);
      const vertices = core.bytes (layer.vertices, layer.size).slice ();
      transfer.push (vertices.buffer);
      layers.push ({ id: layer.id, vertices });
    }
    const state = this.state ();
    this.drawing = true;
    postMessage ({ type: 'frame', layers, state, ...core.frame (), ...waiting, skipped: this.skipped,
      dropped: this.dropped, decodeTime: this.decodeTime, buildTime: performance.now () - begin }, [...transfer, state]);
    this.skipped = this.decodeTime = 0;
  }

  build () {
    const v = this.view;
    try {
      return this.core.call ('rc_build', v.fit ? 1 : 0, v.aspect, v.azimuth, v.elevation, v.distance, v.fieldOfView, v.panX, v.panY, v.panZ,
        v.homeRequests) === DONE;
    } catch (error) {
      this.say (error.message);
      return false;
    }
  }
  state () {
    const { address, size } = this.core.record ('rc_scene_state');
    return this.core.bytes (address, size).slice ().buffer;
  }

  // ---- from the page ----

  shown () {
    this.drawing = false;
    this.show ();
  }
  // Of a held frame set other vertices may be needed.
  look ({ view }) {
    this.view = view;
    this.again ();
  }
  again () {
    if (!this.waiting && this.core.frame ().views > 0)
      this.waiting = { due: performance.timeOrigin + performance.now (), held: true };
    this.show ();
  }
  // What is shown goes on until a recording has been found good.
  async open ({ recording, live, paused, time }) {
    const isPlaylist = typeof recording === 'string' && new URL (recording).pathname.endsWith ('.m3u8'), before = this.wanted;
    const source = live ? new LiveSource (this, live) : new (isPlaylist ? SegmentSource : RecordingSource) (this, recording);
    this.wanted = source;
    this.begin = { paused, time };
    const failure = recording ? await source.load () : '';
    if (this.wanted !== source)
      return;
    if (failure) {
      this.wanted = before;
      this.say (failure);
      return;
    }
    this.source?.close ();
    this.dropped = null;
    this.source = source;
    this.post ({ type: 'opened' });
    source.start (this.begin.paused, this.begin.time);
  }
  // While a recording is loading, its beginning is changed.
  control (name, begin, ...args) {
    if (this.wanted !== this.source)
      Object.assign (this.begin, begin);
    else
      return this.source?.[name]?.(...args);
  }
  close () {
    this.wanted = null;
    this.source?.close ();
    this.source = null;
  }
  points () {
    let file = null;
    try {
      file = this.core.ply ();
      if (!file)
        this.say (this.core.message (), 'note');
    } catch (error) {
      this.say (error.message);
    }
    postMessage ({ type: 'points', file: file?.buffer });
  }
}

let stage;
onmessage = ({ data }) => {
  const actions = {
    start: () => { stage = new Stage (data.module); },
    open: () => stage.open (data),
    view: () => stage.look (data),
    shown: () => stage.shown (),
    again: () => stage.again (),
    toggle: () => stage.source?.toggle?.(),
    play: () => stage.control ('play', { paused: false }),
    pause: () => stage.control ('pause', { paused: true }),
    seek: async () => {
      try {
        await stage.control ('seek', { time: data.time }, data.time);
      } catch (error) {
        stage.say (error.message);
      }
      stage.post ({ type: 'sought' });
    },
    close: () => stage.close (),
    points: () => stage.points (),
    hold: () => stage.source?.hold?.(data),
  };
  actions[data.type] ();
};

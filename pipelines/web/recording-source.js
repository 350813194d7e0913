// SPDX-License-Identifier: LGPL-2.1-or-later
// Plays a recording in its own time: a File, or an address. Frame sets follow one another, as later ones may refer to earlier ones; which
// of them are shown is the stage's business.
import { Core, DONE, END, NOTHING } from './core.js';

export class RecordingSource {
  constructor (stage, recording) {
    this.stage = stage;
    this.recording = recording;
    this.playing = false;
    this.timer = null;
    this.time = 0; // of the last frame set, ms from the first
  }

  // Loads it, and decodes its first frame set in a core of its own. @return why it cannot be played, or ''
  async load () {
    let file = this.recording;
    try {
      if (typeof file === 'string') {
        this.stage.say ('Loading the recording ...', 'note');
        const answer = await fetch (file);
        if (!answer.ok)
          throw new Error (`${answer.status} ${answer.statusText}`);
        file = await answer.blob ();
      }
    } catch (error) {
      return `The recording could not be loaded: ${error.message}.`;
    }
    const reader = new FileReaderSync ();
    this.size = file.size;
    this.read = (offset, size) => new Uint8Array (reader.readAsArrayBuffer (file.slice (offset, offset + size)));
    try {
      const core = new Core (this.stage.core.module, this.read);
      core.call ('rc_open', this.size);
      return core.next () === DONE ? '' : core.message ();
    } catch (error) {
      return error.message;
    }
  }

  start (paused = false, time = 0) {
    this.stage.say ('');
    this.stage.core.read = this.read;
    this.open ();
    if (this.next () && time > 0)
      this.seek (time);
    if (!this.failed && !paused)
      this.play ();
  }

  open () {
    this.stage.core.call ('rc_open', this.size);
    this.atEnd = this.failed = this.saidDamage = false;
    this.time = 0;
    this.last = { pts: 0, shift: 0 }; // of the last frame set
  }

  close () {
    clearTimeout (this.timer);
  }

  // Decodes the next frame set. @return false at the end and after a failure, which has been said
  next () {
    const { core } = this.stage;
    let outcome;
    try {
      outcome = this.stage.decode (() => core.next ());
    } catch (error) { // a new instance of the core has lost the stream
      this.failed = true;
      this.stage.say (error.message);
      return this.stop ();
    }
    if (outcome === DONE) {
      const { time: pts, badSlices } = core.frame ();
      if (badSlices > 0 && !this.saidDamage)
        this.stage.say (`The recording is damaged: ${badSlices} slices of a frame set cannot be decoded.`, 'note');
      this.saidDamage ||= badSlices > 0;
      this.time = pts >= 0 ? this.timeOf (pts) : this.time + (this.frameDuration () || 40);
      this.reportPosition ();
      this.stage.decoded (this.playing ? this.dueOf (this.time) : performance.timeOrigin + performance.now (), !this.playing);
      return true;
    }
    return this.finish (outcome);
  }

  finish (outcome) {
    const { core } = this.stage;
    this.atEnd = outcome === END;
    this.failed = !this.atEnd;
    if (core.message () !== '' || this.failed)
      this.stage.say (core.message (), this.atEnd ? 'note' : 'error');
    return this.stop ();
  }

  // Where times go back, another recording begins, joined to the one before. A single one that does so is damaged.
  timeOf (pts) {
    const last = this.last, frame = this.frameDuration () || 40;
    if (pts < last.pts)
      this.last = { pts, shift: this.time + frame - pts, before: last };
    else
      this.last = { pts, shift: (last.before && pts > last.before.pts ? last.before : last).shift };
    return pts + this.last.shift;
  }

  stop () {
    this.playing = false;
    clearTimeout (this.timer);
    this.reportPosition ();
    return false;
  }

  frameDuration () { return this.stage.core.stream ().framePeriod; }
  dueOf (time) { return performance.timeOrigin + this.origin + time; } // ms since the epoch

  reportPosition () {
    const duration = this.stage.core.stream ().duration;
    this.stage.post ({ type: 'position', time: this.time, duration, playing: this.playing, ended: this.atEnd });
  }

  // origin: performance.now () of time 0
  play (origin) {
    if (this.failed || this.playing)
      return;
    if (this.atEnd) {
      this.open ();
      if (!this.next ())
        return;
    }
    this.playing = true;
    this.origin = origin ?? performance.now () - this.time;
    this.reportPosition ();
    this.schedule ();
  }

  schedule () {
    const period = this.frameDuration () || 40;
    const wait = this.dueOf (this.time + period) - performance.timeOrigin - performance.now ();
    if (wait < -1000) { // too slow: time goes on from here
      this.stage.say ('This device is too slow to play the recording in its own time.', 'note');
      this.origin -= wait;
    }
    this.timer = setTimeout (() => {
      if (this.playing && this.next ())
        this.schedule ();
    }, Math.max (0, wait));
  }

  pause () { return this.playing && this.stop (); }
  toggle () { return this.playing ? this.stop () : this.play (); }

  // Shows the frame set at a time, ms.
  seek (time) {
    if (this.failed)
      return;
    const { core } = this.stage, period = this.frameDuration () || 1;
    const wasPlaying = this.playing;
    clearTimeout (this.timer);
    this.playing = false;
    if (core.seek (time) === NOTHING)
      this.open ();
    this.last = { pts: 0, shift: 0 };
    this.atEnd = false;
    while (this.next () && this.time + period / 2 < time)
      ;
    if (wasPlaying && !this.atEnd)
      this.play ();
  }
}

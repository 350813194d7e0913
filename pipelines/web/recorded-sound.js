// SPDX-License-Identifier: LGPL-2.1-or-later
// Speech that was recorded beside a recording (x.opus beside x.rcnc, as record.sh names them), in step with the picture.

const JUMP = 0.25; // s that sound may be off until it jumps into place; below that it is played faster or slower
const STEP = 0.015; // s that it may be off

export class RecordedSound {
  // changed (): there is sound or not, or it was switched off
  constructor (say, changed) {
    this.say = say;
    this.changed = changed;
    this.audio = new Audio ();
    this.audio.oncanplay = changed;
    this.audio.onerror = () => this.isOpen && this.fail (this.audio.error?.message || 'not a file that this browser plays');
    this.isOn = this.playing = false;
  }
  get isOpen () { return this.audio.hasAttribute ('src'); }

  // After close (). recording: a File or an address; files: those that were chosen with it
  async open (recording, files = []) {
    const name = (recording.name ?? recording).replace (/\.rcnc(~?)($|[?#].*)/, '.opus$1$2');
    if (name === (recording.name ?? recording))
      return;
    let file = files.find ((one) => one.name === name);
    if (typeof recording === 'string') {
      const wanted = this.wanted = {}; // another one may be opened meanwhile
      const answer = await fetch (name).catch (() => null);
      if (answer?.ok)
        file = await answer.blob ().catch (() => null);
      if (this.wanted !== wanted)
        return;
    }
    if (file)
      this.audio.src = URL.createObjectURL (file);
  }
  close () {
    this.wanted = null;
    this.isOn = false;
    if (!this.isOpen)
      return;
    URL.revokeObjectURL (this.audio.src);
    this.audio.pause ();
    this.audio.removeAttribute ('src');
    this.audio.load ();
  }
  fail (reason) {
    this.isOn = false;
    this.say (`The sound cannot be played: ${reason}`, 'note');
    this.changed ();
  }

  // In answer to a click, without which browsers play nothing, also later.
  toggle () {
    this.isOn = !this.isOn;
    if (this.isOn)
      this.play ();
    if (!this.isOn || !this.playing)
      this.audio.pause (); // the next frame set brings it into step
  }
  play () {
    this.audio.play ().catch ((error) => this.isOn && error.name !== 'AbortError' && this.fail (error.message));
  }

  // time: of a frame set, ms from the recording's beginning, that is due at a moment, ms since the epoch; latency: ms until it is seen
  follow (time, playing, due, latency) {
    const { audio } = this, late = performance.timeOrigin + performance.now () - due - latency;
    this.playing = playing;
    const place = Math.max (0, time + late) / 1000, off = place - audio.currentTime;
    if (!this.isOn || !playing || place >= audio.duration)
      return audio.pause ();
    if (audio.ended && off > -JUMP)
      return; // a moment before the picture
    if (Math.abs (off) > JUMP)
      audio.currentTime = place;
    audio.playbackRate = Math.abs (off) > JUMP || Math.abs (off) < STEP ? 1 : 1 + Math.max (-0.1, Math.min (0.1, off));
    if (audio.paused)
      this.play ();
  }
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// Plays the segments of a playlist (RFC 8216), each a recording that begins with its rig and a key frame set, as `rangecast publish` writes
// them. Time is that of the playlist, from the first segment that was seen in it.
import { END } from './core.js';
import { RecordingSource } from './recording-source.js';

const AHEAD = 3; // segments that are fetched before they are played
const MAX_BEHIND = 4; // segments; who plays the live end then jumps to it
const MAX_SHIFT = 30; // ms that a segment may begin late or early without moving all that follows
const MAX_SEGMENT = 256 << 20; // bytes
const AUDIO = '#EXT-X-RANGECAST-AUDIO:', RTP_HEADER = 12, SAMPLES = 48; // bytes; in a ms
const AUDIO_AHEAD = 200; // ms that packets leave before they are heard
const RETRY = 1000, PATIENCE = 10000; // ms: until the playlist is asked for again; that an answer may take

// @return { target: ms, ended, segments: [{ number, address, audio: its address, length: ms }] }
export const parsePlaylist = (text, address) => {
  if (!text.startsWith ('#EXTM3U'))
    throw new Error (`${address} is not a playlist (it does not begin with #EXTM3U)`);
  const tag = (name) => Number (text.match (new RegExp (`^#EXT-X-${name}:(\\d+)`, 'm'))?.[1]);
  const first = tag ('MEDIA-SEQUENCE') || 0, segments = [];
  let length = NaN, audio;
  for (const line of text.split (/\r?\n/))
    if (line.startsWith ('#EXTINF:'))
      length = 1000 * parseFloat (line.slice (8));
    else if (line.startsWith (AUDIO))
      audio = new URL (line.slice (AUDIO.length), address).href;
    else if (line !== '' && !line.startsWith ('#')) {
      if (!(length >= 0))
        throw new Error (`${address} has a segment without #EXTINF`);
      segments.push ({ number: first + segments.length, address: new URL (line, address).href, audio, length });
      length = NaN;
      audio = undefined;
    }
  if (segments.length === 0)
    throw new Error (`${address} has no segments`);
  return { target: 1000 * tag ('TARGETDURATION') || 1000, ended: /^#EXT-X-ENDLIST/m.test (text), segments };
};

// RTP packets of Opus (RFC 7587), each after its length (RFC 4571). @return [{ time: from the beginning of the segment, ms; data }]
export const parseAudio = (bytes) => {
  const view = new DataView (bytes.buffer), packets = [];
  for (let at = 0, end; at + 2 + RTP_HEADER < bytes.length; at = end) {
    end = at + 2 + view.getUint16 (at);
    packets.push ({ time: view.getInt32 (at + 6) / SAMPLES, data: bytes.slice (at + 2 + RTP_HEADER, end) });
  }
  return packets;
};

const load = async (address, options) => {
  const answer = await fetch (address, { ...options, signal: AbortSignal.timeout (PATIENCE) }).catch ((error) => {
    throw new Error (new URL (address).origin === globalThis.location?.origin ? `${address}: ${error.message}`
      : `${address} does not answer, or not to pages of other servers: it has to send Access-Control-Allow-Origin`);
  });
  if (!answer.ok)
    throw new Error (`${address}: ${answer.status} ${answer.statusText}`);
  if (Number (answer.headers.get ('Content-Length')) > MAX_SEGMENT)
    throw new Error (`${address} is longer than 256 MiB`);
  return answer;
};

export class SegmentSource extends RecordingSource {
  async load () {
    this.segments = [];
    this.stalled = this.closed = this.entered = false; // entered: the core has the segment this.number
    this.live = true; // plays what is newest
    this.end = 0;
    try {
      await this.update ();
      this.number = (this.ended ? this.segments[0] : this.segments.at (-1)).number;
      await this.fetched (this.segment ());
    } catch (error) {
      return `The stream could not be loaded: ${error.message}.`;
    }
    return '';
  }

  // Reads the playlist again. Segments that it no longer has are forgotten, but for those that were fetched.
  async update () {
    const answer = await load (this.recording, { cache: 'no-cache' });
    const { target, ended, segments } = parsePlaylist (await answer.text (), answer.url);
    if (segments.at (-1).number < this.segments[0]?.number) { // another stream; a list that is merely old has nothing new
      this.segments = [];
      this.number = segments[0].number;
    }
    this.segments = this.segments.filter (({ number, loading }) => number >= segments[0].number || (number >= this.number && loading));
    for (const segment of segments)
      if (segment.number > (this.segments.at (-1)?.number ?? -1)) {
        this.segments.push ({ ...segment, start: this.end });
        this.end += segment.length;
      }
    this.target = target;
    this.ended = ended;
  }
  // Whether the playlist has sound, where that has changed.
  reportSound () {
    const available = this.segments.some (({ audio }) => audio);
    if (available !== this.hasSound)
      this.stage.post ({ type: 'sound', available });
    this.hasSound = available;
  }

  // The one that plays or is to be played; where that is gone, the next.
  segment () { return this.segments.find (({ number }) => number >= this.number); }
  fetched (segment) {
    segment.sound ??= segment.audio && load (segment.audio).then ((answer) => answer.arrayBuffer ()).then ((bytes) => {
      segment.packets = parseAudio (new Uint8Array (bytes));
    }).catch (() => {}); // the picture plays without it
    return segment.loading ??= load (segment.address).then (async (answer) => {
      segment.bytes = new Uint8Array (await answer.arrayBuffer ());
      segment.failure = undefined;
    }).catch ((error) => {
      segment.failure = error.message;
      segment.loading = undefined; // the next one who needs it tries again
    });
  }

  start (paused = false, time = 0) {
    this.stage.say ('');
    this.number = this.segment ().number;
    this.failed = this.atEnd = this.saidDamage = false;
    this.wantsPlay = !paused;
    this.reportSound ();
    if (time > 0)
      this.seek (1000 * Math.floor (time / 1000));
    else
      this.enter ();
    this.poll ();
  }
  close () {
    super.close ();
    this.closed = true;
  }

  // Until it is closed: the playlist again, and what will be needed soon.
  async poll () {
    while (!this.closed && !this.ended) {
      await new Promise ((resolve) => setTimeout (resolve, Math.min (this.target / 2, RETRY)));
      if (this.closed)
        return;
      try {
        await this.update ();
        if (this.closed)
          return;
        this.reportSound ();
        if (this.away)
          this.stage.say ('');
        this.away = false;
      } catch (error) {
        if (this.closed)
          return;
        this.away = true;
        this.stage.say (`${error.message}. Trying again.`, 'note');
      }
      if (this.live && this.wantsPlay && this.segments.at (-1).number - this.number > MAX_BEHIND) {
        this.number = this.segments.at (-1).number;
        this.heard = undefined;
        this.enter ();
      } else if (this.stalled)
        this.enter ();
      this.fetchAhead ();
    }
  }
  fetchAhead () {
    for (const segment of this.segments)
      if (segment.number < this.number)
        segment.loading = segment.bytes = segment.sound = segment.packets = segment.failure = undefined;
      else if (segment.number <= this.number + AHEAD)
        this.fetched (segment);
  }

  // Plays the segment this.number from its beginning, or from a time, as soon as it is there.
  async enter (time = -1) {
    const segment = this.segment (), visit = this.visit = {};
    clearTimeout (this.timer);
    this.playing = this.entered = false;
    this.stalled = !segment;
    if (!segment) {
      this.atEnd = this.ended;
      return this.reportPosition ();
    }
    this.number = segment.number;
    await this.fetched (segment);
    if (this.closed || this.visit !== visit)
      return;
    if (segment.failure) {
      this.stage.say (`A part of the stream is missing: ${segment.failure}.`, 'note');
      return this.leave ();
    }
    this.current = segment;
    const { bytes } = segment, isOnTime = Math.abs (performance.now () - this.origin - segment.start) < MAX_SHIFT;
    this.stage.core.read = (offset, size) => bytes.subarray (offset, offset + size);
    this.stage.core.call ('rc_open', bytes.length);
    this.first = null;
    this.entered = true;
    while (this.visit === visit && this.next () && this.time < time)
      ;
    if (this.visit === visit && this.wantsPlay)
      super.play (time < 0 && isOnTime ? this.origin : undefined);
    this.fetchAhead ();
  }
  // After a failure of the core, too.
  stop () {
    if (this.failed) {
      this.failed = false;
      return this.leave ();
    }
    return super.stop ();
  }
  leave () {
    this.number++;
    this.enter ();
    return false;
  }
  // A segment that cannot be decoded is left, too.
  finish (outcome) {
    const { core } = this.stage;
    if (core.message () !== '' && outcome !== END)
      this.stage.say (`A part of the stream cannot be shown: ${core.message ()}`, 'note');
    return this.leave ();
  }

  // Posts the sound up to AUDIO_AHEAD past the next frame set; it may be in the next segment.
  schedule () {
    super.schedule ();
    const until = this.time + (this.frameDuration () || 40) + AUDIO_AHEAD;
    this.heard ??= this.time;
    for (const { number, start, length, packets } of this.segments)
      if (packets && (number === this.number || number === this.number + 1)) {
        for (const { time, data } of packets)
          if (start + time >= this.heard && start + time < until)
            this.stage.post ({ type: 'hear', packet: { captured: this.dueOf (start + time), data } });
        this.heard = Math.max (this.heard, Math.min (until, start + length));
      }
  }

  timeOf (pts) {
    this.first ??= pts;
    return this.current.start + Math.max (0, pts - this.first);
  }
  reportPosition () {
    this.stage.post ({ type: 'position', time: this.time, duration: this.end, playing: this.wantsPlay && !this.atEnd, ended: this.atEnd });
  }

  play () {
    this.wantsPlay = true;
    if (this.atEnd)
      this.seek (0);
    else if (this.entered)
      super.play ();
  }
  pause () {
    this.wantsPlay = this.live = false;
    this.heard = undefined;
    return this.stop ();
  }
  toggle () { return this.wantsPlay && !this.atEnd ? this.pause () : this.play (); }
  // To the nearest time that the playlist has; to its end is to the live one.
  seek (time) {
    const last = this.segments.at (-1), found = this.segments.findLast (({ start }) => start <= time) ?? this.segments[0];
    this.live = found === last && !this.ended;
    this.number = found.number;
    this.atEnd = false;
    this.heard = undefined;
    return this.enter (time);
  }
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// Plays the segments of a playlist (RFC 8216), each a recording that begins with its rig and a key frame set, as `rangecast publish` writes
// them. Time is that of the playlist, from the first segment that was seen in it.
import { END } from './core.js';
import { RecordingSource } from './recording-source.js';

const AHEAD = 3; // segments that are fetched before they are played
const MAX_BEHIND = 4; // segments; who plays the live end then jumps to it
const MAX_SEGMENT = 256 << 20; // bytes
const RETRY = 1000; // ms

// @return { target: ms, ended, segments: [{ number, address, length: ms }] }
export const parsePlaylist = (text, address) => {
  if (!text.startsWith ('#EXTM3U'))
    throw new Error (`${address} is not a playlist (it does not begin with #EXTM3U)`);
  const tag = (name) => Number (text.match (new RegExp (`^#EXT-X-${name}:(\\d+)`, 'm'))?.[1]);
  const first = tag ('MEDIA-SEQUENCE') || 0, segments = [];
  let length = NaN;
  for (const line of text.split (/\r?\n/))
    if (line.startsWith ('#EXTINF:'))
      length = 1000 * parseFloat (line.slice (8));
    else if (line !== '' && !line.startsWith ('#')) {
      if (!(length >= 0))
        throw new Error (`${address} has a segment without #EXTINF`);
      segments.push ({ number: first + segments.length, address: new URL (line, address).href, length });
    }
  if (segments.length === 0)
    throw new Error (`${address} has no segments`);
  return { target: 1000 * tag ('TARGETDURATION') || 1000, ended: /^#EXT-X-ENDLIST/m.test (text), segments };
};

const load = async (address, options) => {
  const answer = await fetch (address, options).catch ((error) => {
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
    this.stalled = this.closed = false;
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

  // Reads the playlist again. Segments that it no longer has are forgotten, but for the one that plays.
  async update () {
    const text = await (await load (this.recording, { cache: 'no-cache' })).text ();
    const { target, ended, segments } = parsePlaylist (text, this.recording), known = this.segments.at (-1)?.number ?? -1;
    if (segments.at (-1).number < known) // another stream
      this.segments = [];
    this.segments = this.segments.filter (({ number }) => number >= Math.min (segments[0].number, this.number ?? Infinity));
    for (const segment of segments)
      if (segment.number > (this.segments.at (-1)?.number ?? -1)) {
        this.segments.push ({ ...segment, start: this.end });
        this.end += segment.length;
      }
    this.target = target;
    this.ended = ended;
  }

  // The one that plays or is to be played; where that is gone, the next.
  segment () { return this.segments.find (({ number }) => number >= this.number); }
  fetched (segment) {
    return segment.loading ??= load (segment.address).then (async (answer) => segment.bytes = new Uint8Array (await answer.arrayBuffer ()))
      .catch ((error) => { segment.failure = error.message; });
  }

  start (paused = false, time = 0) {
    this.stage.say ('');
    this.number = this.segment ().number;
    this.failed = this.atEnd = this.saidDamage = false;
    this.wantsPlay = !paused;
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
      try {
        await this.update ();
        if (this.away)
          this.stage.say ('');
        this.away = false;
      } catch (error) {
        this.away = true;
        this.stage.say (`${error.message}. Trying again.`, 'note');
      }
      if (this.live && this.segments.at (-1).number - this.number > MAX_BEHIND) {
        this.number = this.segments.at (-1).number;
        this.enter ();
      } else if (this.failed)
        this.leave ();
      else if (this.stalled)
        this.enter ();
      this.fetchAhead ();
    }
  }
  fetchAhead () {
    for (const segment of this.segments)
      if (segment.number < this.number)
        segment.loading = segment.bytes = segment.failure = undefined;
      else if (segment.number <= this.number + AHEAD)
        this.fetched (segment);
  }

  // Plays the segment this.number from its beginning, or from a time, as soon as it is there.
  async enter (time = -1) {
    const segment = this.segment (), visit = this.visit = {};
    clearTimeout (this.timer);
    this.playing = false;
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
    this.size = segment.bytes.length;
    this.stage.core.read = (offset, size) => segment.bytes.subarray (offset, offset + size);
    this.open ();
    while (this.visit === visit && this.next () && this.time < time)
      ;
    if (this.visit === visit && this.wantsPlay)
      super.play ();
    this.fetchAhead ();
  }
  open () {
    this.stage.core.call ('rc_open', this.size);
    this.failed = false;
    this.first = null;
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
    else if (!this.playing)
      super.play ();
  }
  pause () {
    this.wantsPlay = this.live = false;
    return this.stop ();
  }
  toggle () { return this.wantsPlay ? this.pause () : this.play (); }
  // To the nearest time that the playlist has; to its end is to the live one.
  seek (time) {
    const last = this.segments.at (-1), found = this.segments.findLast (({ start }) => start <= time) ?? this.segments[0];
    this.live = found === last && !this.ended;
    this.number = found.number;
    this.atEnd = false;
    this.enter (time);
  }
}

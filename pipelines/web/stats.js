// SPDX-License-Identifier: LGPL-2.1-or-later
// Quality and latency of what is shown, once a second: `last` has times in ms, sizes in bytes.
export class Stats {
  // onSeen (latency): for each frame set
  constructor (place, visible, onSeen) {
    this.place = place;
    this.onSeen = onSeen;
    place.hidden = !visible;
    this.latencies = []; // of the last frame sets, ms
    this.reset ();
  }
  reset () {
    this.begin = performance.now ();
    this.count = this.skipped = this.bytes = this.decode = this.build = this.draw = 0;
  }
  // latency: ms until the frame after it was drawn
  seen (latency) {
    this.onSeen (latency);
    this.latencies.push (latency);
    if (this.latencies.length > 1000)
      this.latencies.shift ();
  }
  // A frame set that a newer one replaced before it was drawn.
  skip () { this.skipped++; }

  // drawing: milliseconds until it was on the canvas; scale: of the resolution
  shown (frame, drawing, scale) {
    this.count++;
    this.skipped += frame.skipped;
    this.bytes += frame.bytes;
    this.decode += frame.decodeTime;
    this.build += frame.buildTime;
    this.draw += drawing;
    requestAnimationFrame (() => this.seen (performance.timeOrigin + performance.now () - frame.due));
    const elapsed = performance.now () - this.begin;
    if (elapsed < 1000)
      return;
    this.last = { frameSetsPerSecond: 1000 * this.count / elapsed, skipped: this.skipped, dropped: frame.dropped, views: frame.views, points: frame.points,
      bytes: this.bytes / this.count, decodeTime: this.decode / this.count, buildTime: this.build / this.count, drawTime: this.draw / this.count, scale,
      latency: this.latencies.at (-1) };
    if (!this.place.hidden)
      this.print (frame, this.last);
    this.reset ();
  }
  print (frame, last) {
    const ms = (time) => `${time.toFixed (1)} ms`;
    this.place.textContent = [
      `${last.frameSetsPerSecond.toFixed (1)} frame sets/s shown, ${last.skipped} skipped`,
      `${frame.views} views, ${frame.points} points, ${(last.bytes / 1024).toFixed (1)} KiB`,
      `missing ${frame.missingPixels}, unknown ${frame.unknownPixels} pixels; ${frame.badSlices} damaged slices`,
      `decode ${ms (last.decodeTime)}, geometry ${ms (last.buildTime)}, draw ${ms (last.drawTime)}${last.scale < 1 ? `, at ${Math.round (100 * last.scale)} % of the resolution` : ''}`,
      `latency ${(last.latency ?? 0).toFixed (0)} ms from ${frame.dropped === null ? 'due' : 'capture'} to drawn`,
      ...frame.dropped === null ? [] : [`${frame.dropped} frame sets dropped by the server`],
    ].join ('\n');
  }
}

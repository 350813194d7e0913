// SPDX-License-Identifier: LGPL-2.1-or-later
// How many of the screen's pixels are drawn, so that pictures keep up with the frame sets where the GPU is slow or absent. Pictures that
// stand still are drawn whole.
const MIN_SCALE = 0.4, MIN_PIXELS = 320 * 240; // of the width and of the height; and in all: below that, fewer save no time
const EVALUATION = 300; // ms of drawing, of three pictures at least, whose median is judged

export class Resolution {
  constructor () {
    this.scale = 1;
    this.interval = 50; // ms, between pictures
    this.period = 0; // ms, of the stream
    this.times = [];
    this.sum = 0;
  }

  // A frame set came. due: ms; skipped: frame sets since the one before
  follow ({ due, skipped }) {
    const period = (due - this.due) / (1 + skipped);
    if (period > 0 && period < 2000) {
      this.period = period;
      this.interval = Math.min (Math.max (period, 16), 100); // slower streams still turn smoothly
    }
    this.due = due;
  }

  // For a window of so many pixels.
  scaleOf (pixels) { return Math.min (1, Math.max (this.scale, Math.sqrt (MIN_PIXELS / pixels))); }

  // time: ms from the first call to the picture's last pixel
  record (time) {
    this.times.push (time);
    this.sum += time;
    if (this.times.length < 3 || this.sum < EVALUATION)
      return;
    const median = this.times.sort ((a, b) => a - b)[this.times.length >> 1];
    this.times = [];
    this.sum = 0;
    if (median > 0.9 * this.interval)
      this.scale = Math.max (MIN_SCALE, this.scale * Math.max (0.6, Math.sqrt (0.7 * this.interval / median)));
    else if (median < 0.6 * this.interval) // 1.44 times as many pixels
      this.scale = Math.min (1, this.scale * 1.2);
  }
}

// SPDX-License-Identifier: LGPL-2.1-or-later
// How many of the screen's pixels are drawn, so that pictures keep up with the frame sets where the GPU is slow or absent. Pictures that
// stand still are drawn whole.
const LEAST = 0.4; // of the width, and of the height
const JUDGED = 300; // ms of drawing, of three pictures at least, whose median is judged

export class Resolution {
  constructor () {
    this.scale = 1;
    this.interval = 50; // ms, between pictures
    this.times = [];
    this.sum = 0;
  }

  // A frame set came. due: ms; skipped: frame sets since the one before
  follow ({ due, skipped }) {
    const interval = (due - this.due) / (1 + skipped);
    if (interval > 0 && interval < 1000)
      this.interval = Math.min (Math.max (interval, 16), 100); // slower streams still turn smoothly
    this.due = due;
  }

  // time: ms from the first call to the picture's last pixel
  drawn (time) {
    this.times.push (time);
    this.sum += time;
    if (this.times.length < 3 || this.sum < JUDGED)
      return;
    const median = this.times.sort ((a, b) => a - b)[this.times.length >> 1];
    this.times = [];
    this.sum = 0;
    if (median > 0.9 * this.interval)
      this.scale = Math.max (LEAST, this.scale * Math.max (0.6, Math.sqrt (0.7 * this.interval / median)));
    else if (median < 0.4 * this.interval)
      this.scale = Math.min (1, this.scale * 1.2);
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// Times and values of one curve, as far back as anybody looks.

export const LONGEST = 300; // [s]
const MOST = 12_000; // points: 40 a second of the longest

export class Series {
  times = [];
  values = [];

  add(t, value) {
    if (t < this.times.at(-1)) this.clear(); // another run, or back in a recording
    if (t === this.times.at(-1)) return;
    this.times.push(t);
    this.values.push(value);
    const old = this.times.findIndex((time) => time >= t - LONGEST);
    const many = Math.max(old, this.times.length - MOST);
    if (many > 100) {
      this.times.splice(0, many);
      this.values.splice(0, many);
    }
  }

  clear() {
    this.times = [];
    this.values = [];
  }

  /** Place of the first point that is not before a time. */
  from(t) {
    let [low, high] = [0, this.times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// Where something has been.

const APART = 0.02; // [m] between points that are kept
const BREAK = 0.7; // [m] between states: it was put there, and did not drive
const LENGTH = 4000; // points, at most

/** Points as x, y, x, y, ...; a NaN lifts the pen. */
export class Trail {
  points = [];

  add([x, y]) {
    const points = this.points;
    const far = Math.hypot(x - points.at(-2), y - points.at(-1));
    if (far < APART) return;
    if (far > BREAK) points.push(NaN, NaN);
    points.push(x, y);
    if (points.length > 2 * LENGTH) points.splice(0, LENGTH);
  }

  /** Add the lines to a path in the world's frame. */
  trace(path) {
    let down = false;
    for (let i = 0; i < this.points.length; i += 2) {
      const [x, y] = [this.points[i], this.points[i + 1]];
      if (Number.isNaN(x)) down = false;
      else if (down) path.lineTo(x, y);
      else {
        path.moveTo(x, y);
        down = true;
      }
    }
  }
}

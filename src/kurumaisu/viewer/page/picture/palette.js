// SPDX-License-Identifier: BSD-3-Clause
// What a tool of the palette adds where it was drawn: a box by two corners, a wall by its ends, a person by the way.

const BOX = 0.5; // [m] edges of a box that was only clicked
const WALL = [2, 0.1]; // [m] length of a wall that was only clicked, and thickness of all
const PERSON = 0.45; // [m] across
const LEAST = 0.1; // [m] that must be between two places to be meant

/** Return the arguments of the command add for a tool that was drawn from one place to another. */
export function added(kind, [x0, y0], [x1, y1]) {
  const [dx, dy] = [x1 - x0, y1 - y0];
  const [length, yaw] = [Math.hypot(dx, dy), Math.atan2(dy, dx)];
  const pulled = length >= LEAST;
  const middle = {x: (x0 + x1) / 2, y: (y0 + y1) / 2};
  if (kind === "box") {
    const sides = pulled ? {length: Math.max(Math.abs(dx), LEAST), width: Math.max(Math.abs(dy), LEAST)} : {length: BOX, width: BOX};
    return {kind, ...middle, yaw: 0, ...sides};
  }
  if (kind === "wall") return {kind, ...middle, yaw: pulled ? yaw : 0, length: pulled ? length : WALL[0], width: WALL[1]};
  const way = pulled ? {to_x: x1, to_y: y1} : {};
  return {kind, x: x0, y: y0, yaw: pulled ? yaw : 0, length: PERSON, width: PERSON, ...way};
}

// SPDX-License-Identifier: BSD-3-Clause
// Curves over time, those of one unit together: a band for each unit, with an axis of its own.

import {short} from "../common/dom.js";
import {niceLength} from "../picture/ground.js";

const LEFT = 46; // [px] of the numbers on the axis
const FOOT = 18; // [px] of the times
const GAP = 12; // [px] between bands
const COLORS = ["accent", "mark", "truth", "estimate", "odom", "ink"];
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 4], [1, 2]]; // told apart by form, too

export const styleOf = (i, colors) => ({color: colors[COLORS[i % COLORS.length]], dash: DASHES[i % DASHES.length]});

/** Draw curves {series, unit, style: {color, dash}} of the last `length` seconds up to t. */
export function drawCurves(context, width, height, curves, t, length, colors) {
  context.clearRect(0, 0, width, height);
  Object.assign(context, {font: "11px system-ui, sans-serif", lineJoin: "round"});
  const units = [...new Set(curves.map(({unit}) => unit))];
  const band = (height - FOOT - GAP * units.length) / Math.max(units.length, 1);
  units.forEach((unit, i) => {
    const box = {x: LEFT, y: GAP + i * (band + GAP), width: width - LEFT - 6, height: band};
    drawBand(context, box, curves.filter((curve) => curve.unit === unit), unit, t, length, colors);
  });
  Object.assign(context, {fillStyle: colors.soft, textAlign: "left", textBaseline: "bottom"});
  context.fillText(`${short(length)} s ago`, LEFT, height - 2);
  context.textAlign = "right";
  context.fillText(`t = ${t.toFixed(2)} s`, width - 6, height - 2);
}

function drawBand(context, box, curves, unit, t, length, colors) {
  const [low, high] = range(curves, t - length);
  const toY = (value) => box.y + box.height - ((value - low) / (high - low)) * box.height;
  Object.assign(context, {fillStyle: colors.soft, strokeStyle: colors["strong-faint"], lineWidth: 1, textAlign: "right"});
  context.textBaseline = "middle";
  for (const value of ticks(low, high)) {
    context.fillText(short(value), box.x - 4, toY(value));
    const y = Math.round(toY(value)) + 0.5;
    context.beginPath();
    context.moveTo(box.x, y);
    context.lineTo(box.x + box.width, y);
    context.stroke();
  }
  Object.assign(context, {textAlign: "left", textBaseline: "top"});
  context.fillText(unit, box.x + 3, box.y + 2);
  context.save();
  context.beginPath();
  context.rect(box.x, box.y - 2, box.width, box.height + 4);
  context.clip();
  for (const curve of curves) drawCurve(context, curve, (time) => box.x + (1 - (t - time) / length) * box.width, toY, t - length);
  context.restore();
}

function drawCurve(context, {series, style}, toX, toY, since) {
  const {times, values} = series;
  let down = false;
  context.beginPath();
  for (let i = Math.max(series.from(since) - 1, 0); i < times.length; i++) {
    if (!Number.isFinite(values[i])) down = false;
    else if (down) context.lineTo(toX(times[i]), toY(values[i]));
    else {
      context.moveTo(toX(times[i]), toY(values[i]));
      down = true;
    }
  }
  context.setLineDash(style.dash);
  Object.assign(context, {strokeStyle: style.color, lineWidth: 1.75});
  context.stroke();
  context.setLineDash([]);
}

/** Round numbers between two others, about three. */
function ticks(low, high) {
  const step = niceLength(1 / ((high - low) / 4), 1);
  const first = Math.ceil(low / step);
  return Array.from({length: Math.floor(high / step) - first + 1}, (_, i) => (first + i) * step);
}

/** Lowest and highest value that is shown, with some room; a constant is in the middle. */
function range(curves, since) {
  let [low, high] = [Infinity, -Infinity];
  for (const {series} of curves) {
    for (let i = series.from(since); i < series.values.length; i++) {
      const value = series.values[i];
      if (!Number.isFinite(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) return [-1, 1];
  const room = high - low > 1e-9 * Math.max(Math.abs(low), 1) ? 0.05 * (high - low) : Math.max(0.5 * Math.abs(high), 0.1);
  return [low - room, high + room];
}

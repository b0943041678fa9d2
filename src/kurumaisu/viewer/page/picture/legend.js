// SPDX-License-Identifier: BSD-3-Clause
// Scale bar and colour scale, in the picture itself: a saved picture needs them as well.

import {BUCKETS} from "./colors.js";
import {fixed, short} from "../common/dom.js";
import {label} from "./names.js";
import {niceLength} from "./ground.js";
import {strongest} from "./scans.js";

const LEFT = 14; // [px]
const BOTTOM = 16;
const LEAST = 60; // [px] width of the scale bar
const COLORS = 140; // [px] width of the colour scale
const ROOM = 240; // [px] height of a picture that has room for it
const TOOLBAR = 44; // [px] above the picture
const HEIGHT = 80; // [px] of all of the legend
const LOW = 36; // [px] without the colour scale

/** Return what of a picture's height toolbar and legend cover, at its top and at its bottom. */
export function covered(height) {
  return [TOOLBAR, height >= ROOM ? HEIGHT : LOW];
}

export function drawLegend(context, picture) {
  const {camera, colors, ratio, options, scene} = picture;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  Object.assign(context, {font: "12px system-ui, sans-serif", textBaseline: "bottom", textAlign: "left"});
  const y = camera.height - BOTTOM;
  const length = niceLength(camera.scale, LEAST);
  const width = length * camera.scale;
  const scale = camera.height >= ROOM && options.layers.scans && scene.scans.size && options.scanColor !== "plain";
  back(context, y, scale, Math.max(width + 84, scale ? COLORS + 12 : 0), colors);
  bar(context, LEFT, y, width, colors);
  label(context, length >= 1 ? `${short(length)} m` : `${short(length * 1000)} mm`, LEFT, y - 6, colors);
  if (scene.state) {
    label(context, `t = ${fixed(scene.state.t, 2)} s`, LEFT + width + 10, y + 4, colors); // for saved pictures
  }
  if (scale) scaleOfColors(context, LEFT, y - 46, picture);
}

function back(context, y, scale, width, colors) {
  const height = scale ? 74 : 30;
  context.globalAlpha = 0.8;
  context.fillStyle = colors.paper;
  context.fillRect(LEFT - 6, y + 6 - height, width + 12, height);
  context.globalAlpha = 1;
}

function bar(context, x, y, width, colors) {
  context.beginPath();
  context.moveTo(x, y - 4);
  context.lineTo(x, y);
  context.lineTo(x + width, y);
  context.lineTo(x + width, y - 4);
  Object.assign(context, {lineWidth: 4, strokeStyle: colors.paper, lineCap: "butt", lineJoin: "miter"});
  context.stroke();
  Object.assign(context, {lineWidth: 1.5, strokeStyle: colors.ink});
  context.stroke();
}

function scaleOfColors(context, x, y, {colors, options, scene}) {
  const error = options.scanColor === "error";
  const high = error ? options.errorScale : strongest(scene.scans.values());
  if (!high) return label(context, "no intensities available", x, y + 24, colors);
  const steps = colors[options.scanColor];
  const step = COLORS / BUCKETS;
  steps.forEach((color, i) => {
    context.fillStyle = color;
    context.fillRect(x + i * step, y, step + 0.5, 8);
  });
  context.textAlign = "left";
  label(context, error ? "range − true range [m]" : "intensity", x, y - 2, colors);
  context.textBaseline = "top";
  label(context, error ? `−${short(high)}` : "0", x, y + 10, colors);
  context.textAlign = "right";
  label(context, error ? `+${short(high)}` : short(high), x + COLORS, y + 10, colors);
}

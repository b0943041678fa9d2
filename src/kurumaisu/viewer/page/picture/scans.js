// SPDX-License-Identifier: BSD-3-Clause
// Scans: a dot for each echo, in a colour scale if wanted, and the area that was seen.

import {bucket} from "./colors.js";

const DOT = 2.6; // [px]

export function drawScans(context, picture) {
  const {scene, options, colors} = picture;
  const scans = [...scene.scans.values()];
  const high = options.scanColor === "intensity" ? strongest(scans) : 0;
  const paths = new Map();
  for (const scan of scans) dots(paths, picture, scan, high);
  context.setTransform(picture.ratio, 0, 0, picture.ratio, 0, 0);
  for (const [step, path] of paths) {
    context.fillStyle = step === null ? plainColor(options, colors) : colors[options.scanColor][step];
    context.fill(path);
  }
}

function plainColor(options, colors) {
  return options.scanColor === "plain" ? colors.scan : colors.soft;
}

export function strongest(scans) {
  let high = 0;
  for (const {intensities} of scans) for (const value of intensities ?? []) if (value > high) high = value;
  return high;
}

function dots(paths, {camera, options}, scan, high) {
  const [c, s] = [Math.cos(scan.angleIncrement), Math.sin(scan.angleIncrement)];
  let [ux, uy] = [Math.cos(scan.yaw + scan.angleMin), Math.sin(scan.yaw + scan.angleMin)];
  for (let i = 0; i < scan.count; i++) {
    const range = scan.ranges[i];
    if (range >= scan.rangeMin && range <= scan.rangeMax) {
      const [px, py] = camera.toScreen(scan.x + range * ux, scan.y + range * uy);
      const step = stepOf(scan, i, options, high);
      if (!paths.has(step)) paths.set(step, new Path2D());
      paths.get(step).rect(px - DOT / 2, py - DOT / 2, DOT, DOT);
    }
    [ux, uy] = [c * ux - s * uy, s * ux + c * uy];
  }
}

/** Return the step of the colour scale, null where there is nothing to say. */
function stepOf(scan, i, options, high) {
  if (options.scanColor === "error") {
    const error = scan.errors?.[i];
    return Number.isFinite(error) ? bucket(error, -options.errorScale, options.errorScale) : null;
  }
  if (options.scanColor === "intensity") {
    const value = scan.intensities?.[i];
    return Number.isFinite(value) ? bucket(value, 0, high) : null;
  }
  return null;
}

/** No return means free as far as the laser sees; an invalid reading means nothing, so the area has a gap there. */
export function drawFans(context, picture) {
  const scans = [...picture.scene.scans.values()];
  for (const scan of scans) drawFan(context, picture, scan, 0.3 / (scans.length + 2)); // many overlap
}

function drawFan(context, {camera, colors, ratio}, scan, strength) {
  camera.apply(context, ratio);
  context.beginPath();
  context.moveTo(scan.x, scan.y);
  for (let i = 0; i < scan.count; i++) {
    const range = scan.ranges[i];
    const far = Number.isNaN(range) ? 0 : Math.min(Math.max(range, 0), scan.rangeMax);
    const angle = scan.yaw + scan.angleMin + i * scan.angleIncrement;
    context.lineTo(scan.x + far * Math.cos(angle), scan.y + far * Math.sin(angle));
  }
  context.closePath();
  context.globalAlpha = strength;
  context.fillStyle = colors.accent;
  context.fill();
  context.globalAlpha = 1;
}

// SPDX-License-Identifier: BSD-3-Clause
// Trails, particles, and where the chair is according to whom.

// Radius of the ellipse that holds 95 % of a Gaussian in two dimensions [sigma]: sqrt(-2 ln 0.05)
const ELLIPSE = Math.sqrt(-2 * Math.log(0.05));
const DASHES = {truth: [], odom: [7, 4], estimate: [2, 3]}; // told apart by form, too

export function drawTrails(context, picture) {
  const {scene, colors, camera, ratio, options} = picture;
  const chair = scene.chair && `body ${scene.chair.id}`;
  for (const [name, trail] of scene.trails) {
    if (name in DASHES && !options.layers[name]) continue;
    if (name === chair && scene.trails.has("truth")) continue; // the same line
    camera.apply(context, ratio);
    context.beginPath();
    trail.trace(context);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.setLineDash(DASHES[name] ?? []);
    Object.assign(context, {lineWidth: name in DASHES ? 2 : 1, strokeStyle: colors[name] ?? colors.soft, lineCap: "butt"});
    context.stroke();
  }
  context.setLineDash([]);
}

export function drawParticles(context, {scene, camera, colors, ratio}) {
  const particles = scene.particles;
  if (!particles) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  Object.assign(context, {strokeStyle: colors.estimate, lineWidth: 1});
  context.beginPath();
  for (let i = 0; i < particles.values.length; i += 3) {
    const [x, y, yaw] = particles.values.subarray(i, i + 3);
    const [px, py] = camera.toScreen(x, y);
    context.moveTo(px, py);
    context.lineTo(px + 6 * Math.cos(yaw), py - 6 * Math.sin(yaw));
  }
  context.stroke();
}

export function drawPoses(context, picture) {
  const {scene, options} = picture;
  const {truth, odom, estimate} = scene.state ?? {};
  if (odom && options.layers.odom) drawGhost(context, picture, odom, "odom");
  if (estimate?.pose && options.layers.estimate) drawEstimate(context, picture, estimate);
  if (truth && options.layers.truth) drawCross(context, picture, truth);
}

/** Outline of the chair where something believes that it is. */
function drawGhost(context, {scene, camera, colors, ratio}, pose, name) {
  const chair = scene.chair;
  camera.apply(context, ratio);
  context.translate(pose[0], pose[1]);
  context.rotate(pose[2]);
  const pixel = 1 / camera.scale;
  context.setLineDash(DASHES[name].map((length) => length * pixel));
  Object.assign(context, {lineWidth: 2 * pixel, strokeStyle: colors[name]});
  if (chair) context.stroke(chair.closed);
  context.setLineDash([]);
  context.beginPath();
  context.moveTo(0, 0);
  context.lineTo(Math.max(chair?.extent[2] ?? 0.3, 0.1), 0);
  context.stroke();
}

function drawEstimate(context, picture, {pose, covariance}) {
  const {camera, colors, ratio} = picture;
  drawGhost(context, picture, pose, "estimate");
  if (!covariance) return;
  const [xx, xy, yy, aa] = covariance;
  // eigenvalues of a symmetric 2 x 2 matrix
  const [mean, spread] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  const [major, minor] = [mean + spread, mean - spread].map((value) => ELLIPSE * Math.sqrt(Math.max(value, 0)));
  camera.apply(context, ratio);
  Object.assign(context, {strokeStyle: colors.estimate, fillStyle: colors.estimate, lineWidth: 1.5 / camera.scale});
  context.beginPath();
  context.ellipse(pose[0], pose[1], major, minor, Math.atan2(2 * xy, xx - yy) / 2, 0, 2 * Math.PI);
  context.globalAlpha = 0.12;
  context.fill();
  context.globalAlpha = 1;
  context.stroke();
  const half = Math.min(1.96 * Math.sqrt(Math.max(aa, 0)), Math.PI);
  const length = Math.max(0.5, 34 / camera.scale);
  context.globalAlpha = 0.2;
  context.beginPath();
  context.moveTo(pose[0], pose[1]);
  context.arc(pose[0], pose[1], length, pose[2] - half, pose[2] + half);
  context.closePath();
  context.fill();
  context.globalAlpha = 1;
}

function drawCross(context, {camera, colors, ratio}, [x, y]) {
  const [px, py] = camera.toScreen(x, y);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.beginPath();
  for (const [dx, dy] of [[5, 0], [0, 5]]) {
    context.moveTo(px - dx, py - dy);
    context.lineTo(px + dx, py + dy);
  }
  Object.assign(context, {lineWidth: 4, strokeStyle: colors.paper});
  context.stroke();
  Object.assign(context, {lineWidth: 2, strokeStyle: colors.truth});
  context.stroke();
}

// SPDX-License-Identifier: BSD-3-Clause
// Robots, people and things: footprint, nose, contact.

const HEX = /^#[0-9a-f]{6}$/i;
const LEAST = 3; // [px] radius under which a body is drawn as a dot
const NOSE = 0.32; // share of a robot's length

export function drawBodies(context, picture) {
  const {scene, camera, colors, ratio, options} = picture;
  for (const body of scene.world.bodies) {
    const pose = body.kind === "wall" ? null : scene.poseOf(body);
    if (!pose) continue;
    camera.apply(context, ratio);
    context.translate(pose[0], pose[1]);
    context.rotate(pose[2]);
    const pixel = 1 / camera.scale;
    const color = HEX.test(body.color ?? "") ? body.color : colors.soft;
    fill(context, body, color, colors, pixel);
    const lines = {lineWidth: (body === scene.chair ? 2.25 : 1.25) * pixel, strokeStyle: colors.ink};
    outline(context, body, lines);
    if (body.kind === "robot") nose(context, body, colors);
    if (body.id === options.selected) outline(context, body, {lineWidth: 4 * pixel, strokeStyle: colors.accent});
    if (scene.touches(body)) contact(context, body, colors, pixel);
  }
}

function fill(context, body, color, colors, pixel) {
  if (body.radius < LEAST * pixel) {
    context.fillStyle = colors.ink;
    context.fillRect(-LEAST * pixel, -LEAST * pixel, 2 * LEAST * pixel, 2 * LEAST * pixel);
    return;
  }
  // ground first: a scan under a half transparent body would look like part of it
  context.fillStyle = colors.paper;
  context.fill(body.closed);
  context.globalAlpha = 0.5;
  context.fillStyle = color;
  context.fill(body.closed);
  context.globalAlpha = 1;
}

function outline(context, body, style) {
  Object.assign(context, {lineJoin: "round", lineCap: "round", ...style});
  context.stroke(body.closed);
  context.stroke(body.lines);
}

function nose(context, body, colors) {
  const [x0, y0, x1, y1] = body.extent;
  const [middle, half] = [(y0 + y1) / 2, ((y1 - y0) / 2) * 0.55];
  const back = x1 - (x1 - x0) * NOSE;
  context.fillStyle = colors.ink;
  context.beginPath();
  context.moveTo(x1 - (x1 - x0) * 0.03, middle);
  context.lineTo(back, middle + half);
  context.lineTo(back, middle - half);
  context.closePath();
  context.fill();
}

/** A ring with a cross: it is told by its form, not by its colour only. */
function contact(context, body, colors, pixel) {
  const radius = body.radius + 6 * pixel;
  Object.assign(context, {strokeStyle: colors.mark, lineWidth: 3 * pixel});
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  for (let i = 0; i < 4; i++) {
    const angle = Math.PI / 4 + (i * Math.PI) / 2;
    context.moveTo(radius * Math.cos(angle), radius * Math.sin(angle));
    context.lineTo((radius + 9 * pixel) * Math.cos(angle), (radius + 9 * pixel) * Math.sin(angle));
  }
  context.stroke();
}

export function drawMarks(context, {scene, camera, colors, ratio}) {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  Object.assign(context, {strokeStyle: colors.mark, lineWidth: 2});
  context.beginPath();
  for (const [x, y] of scene.marks) {
    const [px, py] = camera.toScreen(x, y);
    context.moveTo(px - 4, py - 4);
    context.lineTo(px + 4, py + 4);
    context.moveTo(px - 4, py + 4);
    context.lineTo(px + 4, py - 4);
  }
  context.stroke();
}

// SPDX-License-Identifier: BSD-3-Clause
// What rests: grid and walls.

const APART = 44; // [px] between lines of the grid, at least
const WALL = 1.75; // [px]

/** Return the smallest of 1, 2, 5, 10, ... metres (or parts) that is at least `pixels` wide. */
export function niceLength(scale, pixels) {
  const least = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((length) => length >= least * 0.999);
}

export function drawGrid(context, {camera, colors, ratio}) {
  const step = niceLength(camera.scale, APART);
  const [left, top] = camera.toWorld(0, 0);
  const [right, bottom] = camera.toWorld(camera.width, camera.height);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.lineWidth = 1;
  for (const strong of [false, true]) {
    context.strokeStyle = strong ? colors["strong-faint"] : colors.faint;
    context.beginPath();
    for (let i = Math.ceil(left / step); i * step <= right; i++) {
      if ((i % 5 === 0) !== strong) continue;
      const px = Math.round(camera.toScreen(i * step, 0)[0]) + 0.5;
      context.moveTo(px, 0);
      context.lineTo(px, camera.height);
    }
    for (let i = Math.ceil(bottom / step); i * step <= top; i++) {
      if ((i % 5 === 0) !== strong) continue;
      const py = Math.round(camera.toScreen(0, i * step)[1]) + 0.5;
      context.moveTo(0, py);
      context.lineTo(camera.width, py);
    }
    context.stroke();
  }
}

export function drawWalls(context, {camera, colors, ratio, scene}) {
  camera.apply(context, ratio);
  context.lineWidth = WALL / camera.scale;
  context.lineCap = "round";
  context.strokeStyle = colors.ink;
  context.fillStyle = colors["strong-faint"];
  for (const body of scene.world.bodies) {
    if (body.kind !== "wall") continue;
    context.fill(body.closed);
    context.stroke(body.closed);
    context.stroke(body.lines);
  }
}

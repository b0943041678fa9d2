// SPDX-License-Identifier: BSD-3-Clause
// Names of bodies and of poses. Where two would overlap, the less important one goes a line or two further off, a
// thing's is left out.

const SMALL = 9; // [px] radius of a body that has no room for a name
const LARGE = 90; // [px] size of a thing that has room for it inside
const HEIGHT = 15; // [px] of a line
const RANK = {robot: 1, person: 2, obstacle: 3};
const FONT = "12px system-ui, sans-serif";

const widths = new Map(); // measuring is slow, and names are few

export function drawNames(context, picture) {
  const {scene, camera, colors, ratio} = picture;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  Object.assign(context, {font: FONT, textAlign: "center", textBaseline: "top"});
  const taken = [];
  for (const {rank, text, box: [x0, y0, x1, y1], above, color} of wanted(picture)) {
    const [middle, bottom] = camera.toScreen((x0 + x1) / 2, y0);
    const [width, height] = [(x1 - x0) * camera.scale, (y1 - y0) * camera.scale];
    const inside = rank >= RANK.obstacle && Math.min(width, height) > LARGE;
    const py = above ? bottom - height - HEIGHT - 2 : bottom + (inside ? -height / 2 - HEIGHT / 2 : 4);
    const half = widthOf(context, text) / 2;
    const edge = half + 4; // what is seen shall have its whole name
    const seen = middle > 0 && middle < camera.width;
    const px = seen ? Math.min(Math.max(middle, edge), Math.max(camera.width - edge, edge)) : middle;
    const step = above ? -HEIGHT : HEIGHT;
    const place = (line) => [px - half, py + line * step, px + half, py + line * step + HEIGHT];
    const free = (line) => !taken.some((other) => overlap(place(line), other));
    const line = (rank < RANK.obstacle ? [0, 1, 2] : [0]).find(free);
    if (line === undefined) continue;
    taken.push(place(line));
    label(context, text, px, py + line * step, colors, color ?? colors.ink);
  }
}

/** Return what there is to write, the most important first. */
function wanted({scene, camera, options, colors}) {
  const list = [];
  const {odom, estimate} = scene.state ?? {};
  const {chair} = scene;
  const ghost = (name, pose, text) => {
    if (!pose || !options.layers[name]) return;
    const box = chair ? boxOf(chair, pose) : [pose[0], pose[1], pose[0], pose[1]];
    list.push({rank: 0.5, text, box, above: true, color: colors[name]});
  };
  ghost("odom", odom, "odometry");
  ghost("estimate", estimate?.pose, "localization");
  for (const body of scene.world.bodies) {
    const pose = body.kind === "wall" ? null : scene.poseOf(body);
    const selected = body.id === options.selected;
    if (!pose || (body.radius * camera.scale < SMALL && !selected)) continue;
    list.push({rank: selected ? 0 : body === chair ? 0.75 : (RANK[body.kind] ?? 4), text: body.name, box: boxOf(body, pose)});
  }
  return list.sort((a, b) => a.rank - b.rank);
}

function widthOf(context, text) {
  if (!widths.has(text)) widths.set(text, context.measureText(text).width);
  return widths.get(text);
}

function overlap([a0, b0, a1, b1], [c0, d0, c1, d1]) {
  return a0 < c1 && c0 < a1 && b0 < d1 && d0 < b1;
}

/** Return what a body covers of the world's axes: [x0, y0, x1, y1]. */
function boxOf({extent: [x0, y0, x1, y1]}, [x, y, yaw]) {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  const corners = [[x0, y0], [x0, y1], [x1, y0], [x1, y1]];
  const xs = corners.map(([u, v]) => x + c * u - s * v);
  const ys = corners.map(([u, v]) => y + s * u + c * v);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

/** Write with a halo of the ground's colour, so that it reads above anything. */
export function label(context, text, x, y, colors, ink = colors.ink) {
  Object.assign(context, {lineWidth: 3, lineJoin: "round", strokeStyle: colors.paper, fillStyle: ink});
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}

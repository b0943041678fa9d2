// SPDX-License-Identifier: BSD-3-Clause
// Outlines of bodies: paths to draw, sizes, and what a point hits.

/** Return a body with its path, extent [x0, y0, x1, y1] and radius, all in its own frame. */
export function prepare(body) {
  const polygons = body.polygons ?? [];
  const segments = body.segments ?? [];
  const closed = new Path2D();
  const lines = new Path2D();
  const extent = [Infinity, Infinity, -Infinity, -Infinity];
  const grow = (x, y) => {
    extent[0] = Math.min(extent[0], x);
    extent[1] = Math.min(extent[1], y);
    extent[2] = Math.max(extent[2], x);
    extent[3] = Math.max(extent[3], y);
  };
  for (const polygon of polygons) {
    polygon.forEach(([x, y], i) => {
      grow(x, y);
      if (i) closed.lineTo(x, y);
      else closed.moveTo(x, y);
    });
    closed.closePath();
  }
  for (const [x1, y1, x2, y2] of segments) {
    grow(x1, y1);
    grow(x2, y2);
    lines.moveTo(x1, y1);
    lines.lineTo(x2, y2);
  }
  const empty = extent[0] > extent[2];
  const size = empty ? [0, 0, 0, 0] : extent;
  const radius = Math.hypot(Math.max(-size[0], size[2]), Math.max(-size[1], size[3]));
  return {...body, polygons, segments, closed, lines, extent: size, empty, radius};
}

/** Say whether a point of the world lies in a body at a pose, or within `slack` [m] of its middle. */
export function covers(body, [px, py, yaw], x, y, slack) {
  const [dx, dy] = [x - px, y - py];
  if (Math.hypot(dx, dy) <= slack) return true;
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  return body.polygons.some((polygon) => inside(polygon, c * dx + s * dy, c * dy - s * dx));
}

function inside(polygon, x, y) {
  let odd = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [xi, yi] = polygon[i];
    const [xj, yj] = polygon[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) odd = !odd;
  }
  return odd;
}

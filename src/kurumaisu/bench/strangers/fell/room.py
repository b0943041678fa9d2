# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of boxes: their walls, the way light takes in them, and their files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.fell.plant import Array, Bools, Ints, Rng

Box = tuple[float, float, float, float, float]  # centre, angle, sizes


@dataclass
class Room:
    """Boxes with a flag for dark paint; walls are their edges inside of the room."""

    width: float
    height: float
    boxes: Array
    dark: Bools

    def __post_init__(self) -> None:
        walls, owner = list[Array](), list[int]()
        for i, (cx, cy, a, sx, sy) in enumerate(self.boxes):
            k = np.array([[-sx, -sy], [sx, -sy], [sx, sy], [-sx, sy]]) / 2
            p = k @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + (cx, cy)
            e = [np.concatenate([p[j], p[(j + 1) % 4]]) for j in range(4)]
            if i < 4:  # of the room's own walls only the inner side
                e = [min(e, key=lambda q: float(np.hypot(q[0] + q[2] - self.width, q[1] + q[3] - self.height)))]
            walls, owner = walls + e, owner + [i] * len(e)
        self.walls, self.owner = np.array(walls), np.array(owner)

    def shifted(self, sd: float, rng: Rng, turned: bool) -> Room:
        """Return a room whose boxes lie elsewhere than the map shows, and are turned if so."""
        boxes = self.boxes.copy()
        boxes[:, :2] += sd * np.clip(rng.standard_normal((len(boxes), 2)), -2, 2)
        boxes[:, 2] += 0.3 * sd * rng.standard_normal(len(boxes)) * turned
        return Room(self.width, self.height, boxes, self.dark)

    def mirrored(self) -> Room:
        """Return the room as a mirror shows it."""
        boxes = self.boxes * (-1, 1, -1, 1, 1) + (self.width, 0, 0, 0, 0)
        return Room(self.width, self.height, boxes, self.dark)

    def clearance(self, x: Array, y: Array) -> Array:
        """Return the distance of points from the nearest box, negative outside of the room."""
        b = self.boxes
        dx, dy, c, s = x[:, None] - b[:, 0], y[:, None] - b[:, 1], np.cos(b[:, 2]), np.sin(b[:, 2])
        u, v = np.abs(c * dx + s * dy) - b[:, 3] / 2, np.abs(c * dy - s * dx) - b[:, 4] / 2
        d = np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0)
        return np.asarray(np.min([d.min(1), x, self.width - x, y, self.height - y], 0))

    def cast(self, ox: Array, oy: Array, angle: Array) -> tuple[Array, Ints]:
        """Return ranges of rays to the walls, and the index of the wall hit."""
        dx, dy, best, which = np.cos(angle), np.sin(angle), np.full(ox.shape, 99.0), np.zeros(ox.shape, np.int64)
        for i, (x0, y0, x1, y1) in enumerate(self.walls):
            ex, ey, px, py = x1 - x0, y1 - y0, x0 - ox, y0 - oy
            den = dx * ey - dy * ex
            with np.errstate(divide="ignore", invalid="ignore"):
                t, u = (px * ey - py * ex) / den, (px * dy - py * dx) / den
                hit = (t > 1e-6) & (t < best) & (u >= -1e-9) & (u <= 1 + 1e-9)
            best[hit], which[hit] = t[hit], i
        return best, which

    def world(self) -> str:
        """Return the Stage world."""
        out = ['name "room"', 'define wall model ( color "gray30" gui_move 0 )']
        for i, ((cx, cy, a, sx, sy), dark) in enumerate(zip(self.boxes, self.dark, strict=True)):
            place = f"[{cx:.6f} {cy:.6f} 0 {np.degrees(a):.9f}] size [{sx:.6f} {sy:.6f} 1.0]"
            paint = 'color "black" ranger_return 0.2' if dark else 'color "white"'
            out.append(f'wall ( name "b{i}" pose {place} {paint} )')
        return "\n".join(out) + "\n"


def _posts(rng: Rng, w: float, h: float) -> list[Box]:
    out, u = list[Box](), rng.uniform
    for fx, fy in ((0.3, 0.3), (0.7, 0.32), (0.68, 0.72), (0.28, 0.7)):
        x, y, turn, side = w * (fx + u(-0.05, 0.05)), h * (fy + u(-0.05, 0.05)), rng.choice([0.0, 0.785]), u(0.2, 0.4)
        out.append((x, y, float(turn), side, side))
    return out


def _niches(rng: Rng, w: float, h: float) -> list[Box]:
    out, u = list[Box](), rng.uniform
    for k in range(4):
        x, deep = w * (k + u(0.3, 0.7)) / 4, u(0.25, 0.6)
        out.append((x, abs((0 if k % 2 else h) - deep / 2), 0, u(0.6, 1.4), deep))
    return out


def _things(rng: Rng, sort: str, w: float, h: float) -> list[Box]:
    u = rng.uniform
    if sort == "workshop":
        benches: list[Box] = [(w * 0.3, 0.35, 0, u(1, 1.8), 0.7), (w - 0.4, h * 0.35, 0, 0.8, u(0.8, 1.5))]
        return [*benches, (0.6, h - 0.6, u(0.3, 0.9), 0.9, 0.5)]
    if sort == "flat":
        side, x = (h - u(1.5, 1.8)) / 2, w * u(0.45, 0.55)
        out: list[Box] = [
            (x, side / 2, 0, 0.12, side),
            (x, h - side / 2, 0, 0.12, side),
            (w - 0.3, h * 0.8, 0, 0.6, 0.9),
        ]
    else:
        out = _posts(rng, w, h) if sort == "hall" else _niches(rng, w, h)
    return [*out, (w - 0.35, u(0.4, 0.6), u(0.2, 0.6), 0.5, 0.4)]


def draw_room(rng: Rng, reach: float) -> Room:
    """Draw a hall with posts, a flat, a corridor with niches, or a workshop with benches."""
    sort = str(rng.choice(["hall", "flat", "corridor", "workshop"]))
    w, h = rng.uniform(8, 12), rng.uniform(7, 9)
    if reach < 5:
        w, h, sort = rng.uniform(5.0, 6.5), rng.uniform(4.6, 6.0), "flat" if sort == "corridor" else sort
    elif sort == "corridor":
        w, h = rng.uniform(13, 18), rng.uniform(3.6, 4.5)
    w, h = round(w, 3), round(h, 3)
    boxes: list[Box] = [(w / 2, -0.05, 0, w + 0.2, 0.1), (w / 2, h + 0.05, 0, w + 0.2, 0.1)]
    boxes += [(-0.05, h / 2, 0, 0.1, h), (w + 0.05, h / 2, 0, 0.1, h), *_things(rng, sort, w, h)]
    dark = np.array([True, False, *(rng.random(len(boxes) - 2) < 0.4)])
    return Room(w, h, np.round(np.array(boxes, float), 6), dark)

# SPDX-License-Identifier: BSD-3-Clause
"""Rooms and rays in them."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import BoolArray, FloatArray, IntArray

Thing = tuple[
    str, float, float, float, float, float, list[list[float]]
]  # name, x, y, size in x, in y, yaw [deg], shape

_BOX = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
_OCTAGON = [[1, 0.414], [0.414, 1], [-0.414, 1], [-1, 0.414], [-1, -0.414], [-0.414, -1], [0.414, -1], [1, -0.414]]
_PART = 20000  # rays at once


class Room:
    """Walls as boxes and octagons; segs are their edges (x1, y1, x2, y2), ids the thing of each, dark what is black."""

    def __init__(self, width: float, depth: float, things: list[Thing]) -> None:
        self.width, self.depth, self.things = width, depth, things
        self.dark: FloatArray = np.zeros(len(things))
        segs, ids = [], []
        for k, (_, x, y, sx, sy, yaw, shape) in enumerate(things):
            c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
            p = np.array(shape) * [sx / 2, sy / 2] @ np.array([[c, s], [-s, c]]) + [x, y]
            for a, b in zip(p, np.roll(p, -1, axis=0), strict=True):
                segs.append([*a, *b])
                ids.append(k)
        self.segs: FloatArray = np.array(segs)
        self.ids: IntArray = np.array(ids)

    def clearance(self, p: FloatArray) -> FloatArray:
        """Return the distance of points (n, 2) to the nearest wall; -1 outside."""
        a, b = self.segs[:, :2], self.segs[:, 2:]
        ab = b - a
        f = np.clip(((p[:, None] - a) * ab).sum(2) / (ab**2).sum(1), 0, 1)
        d = np.sqrt(((p[:, None] - a - f[..., None] * ab) ** 2).sum(2)).min(1)
        out: BoolArray = (p[:, 0] < 0) | (p[:, 1] < 0) | (p[:, 0] > self.width) | (p[:, 1] > self.depth)
        for _, x, y, sx, sy, yaw, _ in self.things:
            c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
            q = p - [x, y]
            out |= (abs(q @ [c, s]) < sx / 2) & (abs(q @ [-s, c]) < sy / 2)
        return np.where(out, -1.0, d)

    def world(self, flip: bool = False) -> str:
        """Return the text of a Stage world, of the mirrored room if asked."""
        text = ['name "room"', "define wall model", "(", '  color "gray30"', "  gui_move 0", ")"]
        for (name, x, y, sx, sy, yaw, shape), dark in zip(self.things, self.dark.tolist(), strict=True):
            at, turn = (self.width - x, -float(yaw)) if flip else (x, yaw)
            head = f'name "{name}" pose [{at:.6g} {y:.6g} 0 {turn:.6g}] size [{sx:.6g} {sy:.6g} 1.0]'
            head += " ranger_return 0.2" * bool(dark)
            if len(shape) == 4:
                text.append(f"wall ( {head} )")
                continue
            text += ["wall", "(", "  " + head, "  block", "  (", f"    points {len(shape)}"]
            text += [f"    point[{i}] [{a:.6g} {b:.6g}]" for i, (a, b) in enumerate(shape)]
            text += ["    z [0 1]", "  )", ")"]
        return "\n".join(text) + "\n"


def draw_room(rng: np.random.Generator, small: bool) -> Room:
    """Draw a room with furniture along the walls and a few things within."""
    w, h = np.round(rng.uniform(5, 7, 2) if small else rng.uniform([7, 5.5], [14, 10]), 1)
    t = 0.1
    things: list[Thing] = [
        ("south", w / 2, -t / 2, w + 2 * t, t, 0, _BOX),
        ("north", w / 2, h + t / 2, w + 2 * t, t, 0, _BOX),
        ("west", -t / 2, h / 2, t, h, 0, _BOX),
        ("east", w + t / 2, h / 2, t, h, 0, _BOX),
    ]
    for k in range(rng.integers(2, 5)):
        sx, sy = np.round(rng.uniform([0.5, 0.3], [1.4, 0.6]), 2)
        f = round(float(rng.uniform(0.1, 0.9)), 2)
        side = rng.integers(4)
        places = [(f * w, sy / 2, 0), (f * w, h - sy / 2, 0), (sy / 2, f * h, 90), (w - sy / 2, f * h, 90)]
        x, y, yaw = places[side]
        things.append((f"cupboard{k}", np.round(x, 3), np.round(y, 3), sx, sy, yaw, _BOX))
    if rng.random() < 0.7:
        x, y = (round(a * rng.uniform(low, high), 2) for a, low, high in ((w, 0.1, 0.2), (h, 0.8, 0.88)))
        things.append(("bed", x, y, 0.9, 0.5, 30, _BOX))
    for k in range(rng.integers(0, 3)):
        s = round(float(rng.uniform(0.2, 0.45)), 2)
        x, y = np.round(rng.uniform([0.15 * w, 0.15 * h], [0.85 * w, 0.85 * h]), 2)
        things.append((f"pillar{k}", x, y, s, s, 0, _OCTAGON))
    if rng.random() < 0.4:
        x = round(w * rng.uniform(0.35, 0.65), 2)
        things.append(("partition", x, round(h - 0.15 * h, 3), 0.1, round(0.3 * h, 3), 0, _BOX))
    return Room(w, h, things)


def cast(segs: FloatArray, ox: FloatArray, oy: FloatArray, ang: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the range and the edge that is hit for each ray."""
    r, hit = np.full(ox.size, np.inf), np.zeros(ox.size, int)
    a, e = segs[:, :2], segs[:, 2:] - segs[:, :2]
    for i in range(0, ox.size, _PART):
        s = slice(i, i + _PART)
        dx, dy = np.cos(ang[s])[:, None], np.sin(ang[s])[:, None]
        qx, qy = a[:, 0] - ox[s][:, None], a[:, 1] - oy[s][:, None]
        den = dx * e[:, 1] - dy * e[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (qx * e[:, 1] - qy * e[:, 0]) / den
            f = (qx * dy - qy * dx) / den
        t = np.where((f >= 0) & (f <= 1) & (t > 1e-6), t, np.inf)
        hit[s] = t.argmin(1)
        r[s] = t[np.arange(t.shape[0]), hit[s]]
    return r, hit

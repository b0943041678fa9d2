# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of boxes, rays in them, and clearances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kurumaisu.bench.strangers.marl.things import Rng
from kurumaisu.types import FloatArray, IntArray

WALL = 0.1
Sized = tuple[float, float, float, float, float]  # middle, size, angle


class Box(NamedTuple):
    """A box: its middle, size and angle, and whether it is dark."""

    x: float
    y: float
    sx: float
    sy: float
    angle: float
    dark: bool


class Room:
    """Boxes, the segments of them that a laser hits, and where one may drive: x0, y0, x1, y1."""

    def __init__(self, boxes: Sequence[Box], free: tuple[float, float, float, float]) -> None:
        self.boxes, self.free = boxes, free
        self.seg, self.box = _segments(boxes)
        self.dark = np.array([b.dark for b in boxes], float)[self.box]

    def text(self) -> str:
        """Return the Stage world."""
        out = ['name "marl"', 'define wall model ( color "gray30" gui_move 0 )', ""]
        for i, b in enumerate(self.boxes):
            pose, size = f"{b.x:.4f} {b.y:.4f} 0 {np.degrees(b.angle):.4f}", f"{b.sx:.4f} {b.sy:.4f} 1.0"
            paint = 'color "black" ranger_return 0.2' if b.dark else 'color "white"'
            out.append(f'wall ( name "b{i}" pose [{pose}] size [{size}] {paint} )')
        return "\n".join(out) + "\n"

    def mirrored(self) -> Room:
        """Return it with left and right swapped."""
        both = self.free[0] + self.free[2]
        return Room([b._replace(x=both - b.x, angle=-b.angle) for b in self.boxes], self.free)

    def moved_to(self, other: Room) -> Room:
        """Return it with its corner where the other has it."""
        dx, dy = other.free[0] - self.free[0], other.free[1] - self.free[1]
        return Room([b._replace(x=b.x + dx, y=b.y + dy) for b in self.boxes], self.free)


def _segments(boxes: Sequence[Box]) -> tuple[FloatArray, IntArray]:
    seg, box = list[FloatArray](), list[int]()
    for i, b in enumerate(boxes):
        c, s = np.cos(b.angle), np.sin(b.angle)
        turn = np.array([[c, s], [-s, c]])
        p = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [b.sx / 2, b.sy / 2] @ turn + [b.x, b.y]
        seg += [np.r_[p[k], p[(k + 1) % 4]] for k in range(4)]
        box += [i] * 4
    return np.array(seg), np.array(box)


def _size(rng: Rng, sort: str, reach: float, radius: float) -> tuple[float, float]:
    if sort == "hall":
        w, h = rng.uniform(1.2, 2.2) * min(reach, 7) + 2, rng.uniform(1.0, 1.6) * min(reach, 6) + 2
    elif sort == "office":
        w, h = rng.uniform(6, 9), rng.uniform(5, 7)
    elif sort == "corridor":
        w, h = rng.uniform(11, 18), rng.uniform(2.2, 3.2) * min(max(1.0, radius / 0.25), 1.3)
    else:
        w, h = rng.uniform(9, 12), rng.uniform(8, 10)
    return (max(w, 8.0), max(h, 7.0)) if radius > 0.35 and sort in ("office", "hall") else (w, h)


def _along_wall(rng: Rng, bend: bool, w: float, h: float) -> Sized:
    s, side = rng.uniform([0.3, 0.15], [1.1, 0.4]), rng.integers(2)
    if bend and rng.random() < 0.5:
        return s[1] / 2 - 0.02, rng.uniform(1, h - 1), s[1], s[0], 0
    return rng.uniform(1, w - 1), s[1] / 2 - 0.02 if side or bend else h - s[1] / 2 + 0.02, s[0], s[1], 0


def _furniture(rng: Rng, w: float, h: float) -> Sized:
    s, k = rng.uniform([0.5, 0.35], [1.6, 0.8]), rng.integers(4)
    along = rng.uniform([1, 1, 1, 1], [w - 1, w - 1, h - 1, h - 1])
    x, y = [(along[0], s[1] / 2), (along[1], h - s[1] / 2), (s[0] / 2, along[2]), (w - s[0] / 2, along[3])][k]
    return x, y, s[0], s[1], rng.choice([0, 0, rng.uniform(-0.5, 0.5)])


def _pillar(rng: Rng, w: float, h: float) -> Sized:
    s = rng.uniform(0.25, 0.6)
    x, y = rng.uniform(0.8, w - 0.8), rng.uniform(0.8, h - 0.8)
    return x, y, s, s * rng.uniform(0.7, 1.5), rng.uniform(0, 1.5)


def draw_room(rng: Rng, reach: float, radius: float) -> Room:
    """Draw a hall, an office or a corridor (straight or bent), such that the laser sees something."""
    sort = str(rng.choice(["hall", "office", "corridor", "bend"]))
    w, h = _size(rng, sort, reach, radius)
    ox, oy = rng.uniform(-5, 5, 2)
    flat, tall = (w + 2 * WALL, WALL, 0), (WALL, h + 2 * WALL, 0)
    boxes: list[Sized] = [(w / 2, -WALL / 2, *flat), (w / 2, h + WALL / 2, *flat)]
    boxes += [(-WALL / 2, h / 2, *tall), (w + WALL / 2, h / 2, *tall)]
    if sort == "bend":
        a = rng.uniform(2.6, 3.4) * min(max(1.0, radius / 0.25), 1.2)
        boxes.append(((w + a) / 2 + 0.025, (h + a) / 2 + 0.025, w - a + 0.05, h - a + 0.05, 0))
    n = {"hall": rng.integers(3, 7), "office": rng.integers(4, 9), "corridor": rng.integers(5, 9), "bend": 6}[sort]
    for _ in range(n):
        if sort in ("corridor", "bend"):
            boxes.append(_along_wall(rng, sort == "bend", w, h))
        elif sort == "office" and rng.random() < 0.7:
            boxes.append(_furniture(rng, w, h))
        else:
            boxes.append(_pillar(rng, w, h))
    return Room([_rounded(rng, b, ox, oy) for b in boxes], (ox, oy, ox + w, oy + h))


def _rounded(rng: Rng, b: Sized, ox: float, oy: float) -> Box:
    x, y, sx, sy = (round(float(q), 4) for q in (b[0] + ox, b[1] + oy, b[2], b[3]))
    return Box(x, y, sx, sy, np.radians(round(float(np.degrees(b[4])), 4)), bool(rng.random() < 0.4))


def clearance(p: FloatArray, seg: FloatArray) -> FloatArray:
    """Return the distance of points (n, 2) from the nearest segment."""
    a, e = seg[:, :2], seg[:, 2:] - seg[:, :2]
    q = p[:, None] - a
    k = np.clip((q * e).sum(2) / (e * e).sum(1), 0, 1)
    return np.asarray(np.sqrt(((q - k[..., None] * e) ** 2).sum(2).min(1)))


def inside(p: FloatArray, boxes: Sequence[Box]) -> bool:
    """Return whether a point is in a box."""
    for b in boxes:
        c, s = np.cos(b.angle), np.sin(b.angle)
        u, v = c * (p[0] - b.x) + s * (p[1] - b.y), -s * (p[0] - b.x) + c * (p[1] - b.y)
        if abs(u) < b.sx / 2 and abs(v) < b.sy / 2:
            return True
    return False


def cast(o: FloatArray, a: FloatArray, seg: FloatArray) -> IntArray:
    """Return the nearest segment of rays from o (n, 2) at angles a."""
    k = np.empty(len(a), int)
    ex, ey = (seg[:, 2] - seg[:, 0]), (seg[:, 3] - seg[:, 1])
    for i in range(0, len(a), 8192):
        s = slice(i, i + 8192)
        dx, dy = np.cos(a[s])[:, None], np.sin(a[s])[:, None]
        px, py = seg[:, 0] - o[s, 0, None], seg[:, 1] - o[s, 1, None]
        den = dx * ey - dy * ex
        den[np.abs(den) < 1e-12] = 1e-12
        t = (px * ey - py * ex) / den
        u = (px * dy - py * dx) / den
        t[(t <= 1e-6) | (u < -1e-9) | (u > 1 + 1e-9)] = np.inf
        k[s] = t.argmin(1)
    return k


def slopes(a: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the directions of segments (n, 4), and their cross products with rays at angles a."""
    ex, ey = g[:, 2] - g[:, 0], g[:, 3] - g[:, 1]
    return ex, ey, np.cos(a) * ey - np.sin(a) * ex


def line(o: FloatArray, a: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ranges to the lines on which segments g lie, and the cosines of incidence."""
    ex, ey, den = slopes(a, g)
    c = np.abs(den) / np.hypot(ex, ey)
    den = np.where(np.abs(den) < 1e-9, 1e-9, den)
    return ((g[:, 0] - o[:, 0]) * ey - (g[:, 1] - o[:, 1]) * ex) / den, np.maximum(c, 0.02)

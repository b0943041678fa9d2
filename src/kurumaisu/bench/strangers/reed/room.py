# SPDX-License-Identifier: BSD-3-Clause
"""Rooms with furniture, the world file of one, and rays in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.reed.core import Array

COLOURS = {"black": 0.0, "gray30": 0.3, "gray60": 0.6, "white": 1.0}


@dataclass
class Room:
    """Boxes: middle x, y, size x, y, angle; with the colour of each."""

    boxes: Array
    colours: list[str]

    def clear(self, x: Array, y: Array) -> Array:
        """Distance to the nearest box."""
        best = np.full(x.shape, 99.0)
        for cx, cy, sx, sy, a in self.boxes:
            c, s = np.cos(a), np.sin(a)
            px, py = np.abs(c * (x - cx) + s * (y - cy)) - sx / 2, np.abs(-s * (x - cx) + c * (y - cy)) - sy / 2
            best = np.minimum(best, np.hypot(np.maximum(px, 0), np.maximum(py, 0)) + np.minimum(np.maximum(px, py), 0))
        return best

    def sides(self) -> Array:
        """The four sides of each box: x0, y0, x1, y1."""
        rows = []
        for cx, cy, sx, sy, a in self.boxes:
            c, s = np.cos(a), np.sin(a)
            corners = [
                (cx + c * u * sx / 2 - s * v * sy / 2, cy + s * u * sx / 2 + c * v * sy / 2)
                for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            rows += [(*corners[i], *corners[(i + 1) % 4]) for i in range(4)]
        return np.array(rows)

    def world(self, name: str) -> str:
        """The world file."""
        lines = [f'name "{name}"', "define block model", "(", '  color "gray30"', "  gui_move 0", ")", ""]
        for i, ((cx, cy, sx, sy, a), colour) in enumerate(zip(self.boxes.tolist(), self.colours, strict=True)):
            lines.append(
                f'block ( name "block{i}" pose [{cx:.6f} {cy:.6f} 0 {np.degrees(a):.6f}] '
                f'size [{sx:.6f} {sy:.6f} 2.0] color "{colour}" ranger_return {COLOURS[colour]} )'
            )
        return "\n".join(lines) + "\n"


def furnish(rng: np.random.Generator) -> Room:
    """A room of 5 to 9 m with cupboards along its walls, and sometimes a pillar."""
    lx, ly = rng.uniform(5.6, 9.0), rng.uniform(5.4, 8.0)
    boxes = [
        (0.0, ly / 2 + 0.05, lx + 0.2, 0.1, 0.0),
        (0.0, -ly / 2 - 0.05, lx + 0.2, 0.1, 0.0),
        (lx / 2 + 0.05, 0.0, 0.1, ly, 0.0),
        (-lx / 2 - 0.05, 0.0, 0.1, ly, 0.0),
    ]
    colours = [str(rng.choice(["gray60", "white"])) for _ in boxes]
    for i in range(int(rng.integers(4, 7))):
        long, deep = rng.uniform(0.4, 1.4), rng.uniform(0.25, 0.6)
        wall = i % 4
        along = rng.uniform(-0.5, 0.5) * ((lx if wall < 2 else ly) - long)
        if wall < 2:
            boxes.append((along, (ly / 2 - deep / 2 - 0.02) * (1 - 2 * wall), long, deep, 0.0))
        else:
            boxes.append(((lx / 2 - deep / 2 - 0.02) * (5 - 2 * wall), along, deep, long, 0.0))
        colours.append(str(rng.choice(["black", "black", "gray30", "gray60"])))
    if lx * ly > 45:
        boxes.append((rng.uniform(-0.3, 0.3) * lx, rng.uniform(-0.3, 0.3) * ly, 0.3, 0.3, rng.uniform(0, 1.5)))
        colours.append("gray30")
    shift = rng.uniform(-2, 2, size=2)
    table = np.array(boxes)
    table[:, :2] += shift
    return Room(np.round(table, 6), colours)


def hall(size: float) -> Room:
    """An empty place without walls to see: only a border that is not driven over."""
    h = size / 2
    rows = [(0.0, h, size, 0.1, 0.0), (0.0, -h, size, 0.1, 0.0), (h, 0.0, 0.1, size, 0.0), (-h, 0.0, 0.1, size, 0.0)]
    return Room(np.array(rows), ["white"] * 4)


def cast(sides: Array, o: Array, d: Array) -> tuple[Array, Array, Array]:
    """Range, side and cosine of the incidence of each ray; rays that meet nothing are 99 m long."""
    if len(o) > 6000:
        parts = [cast(sides, o[k : k + 6000], d[k : k + 6000]) for k in range(0, len(o), 6000)]
        return (
            np.concatenate([p[0] for p in parts]),
            np.concatenate([p[1] for p in parts]),
            np.concatenate([p[2] for p in parts]),
        )
    best, which, cosine = np.full(len(o), 99.0), np.full(len(o), -1.0), np.ones(len(o))
    for k, (x0, y0, x1, y1) in enumerate(sides):
        ex, ey = x1 - x0, y1 - y0
        den = d[:, 0] * ey - d[:, 1] * ex
        den = np.where(np.abs(den) < 1e-12, 1e-12, den)
        px, py = x0 - o[:, 0], y0 - o[:, 1]
        r, s = (px * ey - py * ex) / den, (px * d[:, 1] - py * d[:, 0]) / den
        hit = (r > 0) & (s >= 0) & (s <= 1) & (r < best)
        best, which = np.where(hit, r, best), np.where(hit, k, which)
        cosine = np.where(hit, np.abs(den) / np.hypot(ex, ey), cosine)
    return best, which, cosine

# SPDX-License-Identifier: BSD-3-Clause
"""A room of boxes, its distance field, and the ray caster that marches through it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .plant import Arr

Ints = NDArray[np.int64]
CELL = 0.025
REACH = 6.0


@dataclass
class Room:
    """Boxes (x, y, angle, length, thickness; a row each), which of them are dark, and the field."""

    boxes: Arr
    dark: NDArray[np.bool_]
    low: Arr = field(default_factory=lambda: np.zeros(2))
    dist: Arr = field(default_factory=lambda: np.zeros((0, 0)))
    first: Ints = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    second: Ints = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))

    def __post_init__(self) -> None:
        low, high = self.boxes[:4, :2].min(axis=0) - 0.3, self.boxes[:4, :2].max(axis=0) + 0.3
        gx, gy = (np.arange(low[i] + CELL / 2, high[i], CELL) for i in range(2))
        p = np.stack(np.meshgrid(gx, gy, indexing="ij"), axis=-1)
        shape = p.shape[:2]
        best, next_best = np.full(shape, 1e9), np.full(shape, 1e9)
        first, second = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
        for k, box in enumerate(self.boxes):
            d = box_distance(box, p)
            closer, mid = d < best, (d >= best) & (d < next_best)
            second = np.where(closer, first, np.where(mid, k, second))
            next_best = np.where(closer, best, np.where(mid, d, next_best))
            first, best = np.where(closer, k, first), np.where(closer, d, best)
        self.low, self.dist, self.first, self.second = low, best, first, second

    def cell(self, p: Arr) -> tuple[Ints, Ints]:
        """Indices of the cells that hold the points."""
        i = ((p - self.low) / CELL).astype(np.int64)
        return np.clip(i[..., 0], 0, self.dist.shape[0] - 1), np.clip(i[..., 1], 0, self.dist.shape[1] - 1)

    def clearance(self, p: Arr) -> Arr:
        """Distance to the nearest box."""
        return np.asarray(self.dist[self.cell(p)])

    def cast(self, origin: Arr, unit: Arr) -> tuple[Arr, Ints, Arr]:
        """Range (inf: nothing within reach), the box that was met (-1), and the normal there."""
        n = len(origin)
        t, out, met, normal = np.full(n, 0.03), np.full(n, np.inf), np.full(n, -1), np.zeros((n, 2))
        act = np.arange(n)
        while len(act):
            i, j = self.cell(origin[act] + t[act, None] * unit[act])
            d = self.dist[i, j]
            near = np.flatnonzero(d < 0.06)
            done = np.zeros(len(act), dtype=np.bool_)
            for ids in (self.first, self.second):
                k, box = act[near], ids[i[near], j[near]]
                hit, face = slab(self.boxes[box], origin[k], unit[k])
                good = (hit < t[k] + 0.08) & (hit < out[k])
                out[k[good]], met[k[good]], normal[k[good]] = hit[good], box[good], face[good]
                done[near[good]] = True
            t[act] += np.maximum(d - 0.02, 0.02)
            act = act[~done & (t[act] < REACH)]
        return out, met, normal

    def stage(self) -> str:
        """The same as a Stage world."""
        text = ""
        for k, (x, y, a, length, thick) in enumerate(self.boxes.tolist()):
            shine = 0.3 if self.dark[k] else 1
            text += f'model ( name "w{k + 1}" pose [ {x:.4f} {y:.4f} 0 {np.degrees(a):.4f} ] '
            text += f"size [ {length:.4f} {thick:.4f} 1.0 ] ranger_return {shine} )\n"
        return text


def box_distance(box: Arr, p: Arr) -> Arr:
    """Distance of points from a box, 0 inside."""
    c, s = np.cos(box[2]), np.sin(box[2])
    d = p - box[:2]
    qx, qy = np.abs(c * d[..., 0] + s * d[..., 1]) - box[3] / 2, np.abs(c * d[..., 1] - s * d[..., 0]) - box[4] / 2
    return np.asarray(np.hypot(np.maximum(qx, 0), np.maximum(qy, 0)))


def slab(box: Arr, o: Arr, u: Arr) -> tuple[Arr, Arr]:
    """Where each ray enters its box (inf: not), and the normal of that face."""
    c, s = np.cos(box[:, 2]), np.sin(box[:, 2])
    d = o - box[:, :2]
    ox, oy = c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]
    ux, uy = c * u[:, 0] + s * u[:, 1], c * u[:, 1] - s * u[:, 0]
    ux, uy = np.where(np.abs(ux) < 1e-12, 1e-12, ux), np.where(np.abs(uy) < 1e-12, 1e-12, uy)
    hx, hy = box[:, 3] / 2, box[:, 4] / 2
    in_x, in_y = -ox / ux - hx / np.abs(ux), -oy / uy - hy / np.abs(uy)
    out_x, out_y = -ox / ux + hx / np.abs(ux), -oy / uy + hy / np.abs(uy)
    enter, leave = np.maximum(in_x, in_y), np.minimum(out_x, out_y)
    hit = np.where((enter <= leave) & (enter > 0), enter, np.inf)
    by_x = in_x > in_y
    nx, ny = np.where(by_x, -np.sign(ux), 0.0), np.where(by_x, 0.0, -np.sign(uy))
    return hit, np.stack([c * nx - s * ny, s * nx + c * ny], axis=1)


def make_room(rng: np.random.Generator, dark: bool) -> Room:
    """Four walls and furniture along them; the middle is free."""
    lx, ly = rng.uniform(7.0, 11.5), rng.uniform(6.5, 10.0)
    x0, y0 = rng.uniform(-3, 3, 2)
    thick = 0.15
    boxes = [[x0, y0 + sign * (ly + thick) / 2, 0.0, lx + 2 * thick, thick] for sign in (-1, 1)]
    boxes += [[x0 + sign * (lx + thick) / 2, y0, np.pi / 2, ly + 2 * thick, thick] for sign in (-1, 1)]
    for _ in range(int(rng.integers(4, 9))):
        along, side = rng.uniform(-0.42, 0.42), int(rng.integers(4))
        off = rng.uniform(0.15, 0.8)
        x = along * lx if side < 2 else (lx / 2 - off) * (2 * side - 5)
        y = along * ly if side >= 2 else (ly / 2 - off) * (2 * side - 1)
        angle = float(rng.choice([0.0, np.pi / 2, rng.uniform(-np.pi, np.pi)]))
        boxes.append([x0 + x, y0 + y, angle, rng.uniform(0.3, 1.1), rng.uniform(0.2, 0.6)])
    n = len(boxes)
    return Room(np.array(boxes), (rng.random(n) < 0.45) & dark)


def moved(room: Room, shifts: Arr) -> Room:
    """The room as it really is: each box moved (n x 2)."""
    boxes = room.boxes.copy()
    boxes[:, :2] += shifts
    return Room(boxes, room.dark)

# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of boxes, some of them dark, and where rays meet them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Rng


@dataclass(frozen=True)
class Box:
    """A wall or a piece of furniture: middle, size, turned by degrees, how bright it is."""

    name: str
    x: float
    y: float
    length: float
    width: float
    turned: float
    bright: float

    def corners(self) -> Array:
        """Its four corners, counter-clockwise."""
        a = np.deg2rad(self.turned)
        half = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array([self.length, self.width])
        turn = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        return np.asarray(half @ turn + np.array([self.x, self.y]))


@dataclass(frozen=True)
class Room:
    """A rectangle with boxes in it; each side of each box is a segment."""

    boxes: tuple[Box, ...]
    length: float
    width: float

    def segments(self) -> tuple[Array, Array]:
        """From and to of all sides, in the order of the boxes."""
        c = np.stack([b.corners() for b in self.boxes])
        return c.reshape(-1, 2), np.roll(c, -1, axis=1).reshape(-1, 2)

    def bright(self) -> Array:
        """How bright each segment is."""
        return np.repeat([b.bright for b in self.boxes], 4)

    def clearance(self, points: Array) -> Array:
        """How far points are from the nearest box; negative outside of the room."""
        a, b = self.segments()
        d = b - a
        p = points[:, None, :] - a[None]
        s = np.clip((p * d).sum(-1) / (d * d).sum(-1), 0, 1)
        near = np.sqrt(((p - s[..., None] * d) ** 2).sum(-1)).min(axis=1)
        edge = np.minimum(
            np.minimum(points[:, 0], self.length - points[:, 0]), np.minimum(points[:, 1], self.width - points[:, 1])
        )
        return np.asarray(np.where(self._inside(points), -near, np.minimum(near, edge)))

    def _inside(self, points: Array) -> Array:
        out = np.zeros(len(points), dtype=bool)
        for b in self.boxes:
            a = np.deg2rad(b.turned)
            dx, dy = points[:, 0] - b.x, points[:, 1] - b.y
            u, v = np.cos(a) * dx + np.sin(a) * dy, -np.sin(a) * dx + np.cos(a) * dy
            out |= (np.abs(u) < b.length / 2) & (np.abs(v) < b.width / 2)
        return np.asarray(out)


def draw_room(rng: Rng, v_top: float) -> Room:
    """A room in which a robot of that speed has space: an office, or a hall with racks."""
    grow = float(np.clip(4.0 + 5.5 * v_top, 5.5, 9.5))
    length, width = round(grow * rng.uniform(1.0, 1.35), 2), round(grow * rng.uniform(0.85, 1.1), 2)
    dark = np.where(rng.random(12) < 0.3, np.round(rng.uniform(0.08, 0.45, 12), 2), 1.0).tolist()
    boxes = [
        Box("south", length / 2, -0.1, length + 0.4, 0.2, 0.0, dark[0]),
        Box("north", length / 2, width + 0.1, length + 0.4, 0.2, 0.0, dark[1]),
        Box("west", -0.1, width / 2, 0.2, width, 0.0, dark[2]),
        Box("east", length + 0.1, width / 2, 0.2, width, 0.0, dark[3]),
    ]
    for k in range(int(rng.integers(3, 6))):
        along = rng.random() < 0.5
        big, small = rng.uniform(0.6, 0.28 * length), rng.uniform(0.3, 0.6)
        low = 0.2 * rng.uniform(0.1, 1.0)
        x = rng.uniform(0.1, 0.9) * length if along else (low if rng.random() < 0.5 else 1 - low) * length
        y = rng.uniform(0.1, 0.9) * width if not along else (low if rng.random() < 0.5 else 1 - low) * width
        turned = float(rng.choice([0.0, 0.0, 90.0, rng.uniform(0, 180)]))
        x, y, big, small = (round(float(u), 2) for u in (x, y, big, small))
        boxes.append(Box(f"thing_{k}", x, y, big, small, round(turned, 1), dark[4 + k]))
    pillar = float(np.round(rng.uniform(0.2, 0.45), 2))
    x, y = round(rng.uniform(0.25, 0.4) * length, 2), round(rng.uniform(0.55, 0.8) * width, 2)
    boxes.append(Box("pillar", x, y, pillar, pillar, 45.0, dark[11]))
    return Room(tuple(boxes), length, width)


def cast(room: Room, origin: Array, angle: Array) -> tuple[Array, Array]:
    """Distance to the first segment along each ray, and which one (-1: none)."""
    a, b = room.segments()
    ox, oy, c, s = origin[..., 0].ravel(), origin[..., 1].ravel(), np.cos(angle).ravel(), np.sin(angle).ravel()
    best, which = np.full(ox.shape, 1e3), np.full(ox.shape, -1.0)
    for k, ((ax, ay), (bx, by)) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        dx, dy = bx - ax, by - ay
        cross = c * dy - s * dx
        px, py = ax - ox, ay - oy
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (px * dy - py * dx) / cross
            at = (px * s - py * c) / cross
        hit = (far > 1e-6) & (far < best) & (at >= 0) & (at <= 1)
        best = np.where(hit, far, best)
        which = np.where(hit, float(k), which)
    return best.reshape(angle.shape), which.reshape(angle.shape)

# SPDX-License-Identifier: BSD-3-Clause
"""Corridors, wards and offices of boxes, what a ray meets in them, and how near their walls are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array, Hidden


@dataclass(frozen=True)
class Box:
    """A wall or a piece of furniture: centre, size, turn in degrees, and how bright it is."""

    x: float
    y: float
    long: float
    wide: float
    turn: float = 0.0
    bright: float = 1.0


@dataclass(frozen=True)
class Room:
    """Boxes within a rectangle from the origin."""

    name: str
    width: float
    depth: float
    boxes: tuple[Box, ...]

    def segments(self) -> Array:
        """The sides of all boxes: x0, y0, x1, y1, brightness."""
        rows = []
        for b in self.boxes:
            a = np.radians(b.turn)
            turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
            half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [b.long / 2, b.wide / 2]
            corners = half @ turn.T + [b.x, b.y]
            rows += [[*corners[i], *corners[(i + 1) % 4], b.bright] for i in range(4)]
        return np.array(rows, dtype=float)


def _shell(width: float, depth: float, shades: Array) -> list[Box]:
    t = 0.2
    return [
        Box(width / 2, -t / 2, width + 2 * t, t, 0, shades[0]),
        Box(width / 2, depth + t / 2, width + 2 * t, t, 0, shades[1]),
        Box(-t / 2, depth / 2, t, depth, 0, shades[2]),
        Box(width + t / 2, depth / 2, t, depth, 0, shades[3]),
    ]


def _shades(rng: np.random.Generator, n: int, dark: bool) -> Array:
    values = np.round(rng.uniform(0.15, 0.7, n), 2)
    return np.where(rng.random(n) < 0.45, values, 1.0) if dark else np.ones(n)


def _ward(rng: np.random.Generator, shades: Array) -> Room:
    width, depth = np.round(rng.uniform([7.5, 5.5], [10.5, 7.5]), 2)
    boxes = _shell(width, depth, shades)
    for i, x in enumerate(np.arange(1.2, width - 1.5, 2.4)):
        boxes.append(Box(round(x + rng.uniform(-0.2, 0.2), 2), depth - 1.02, 0.95, 2.04, 0, shades[4 + i]))
        boxes.append(Box(round(x + 0.9, 2), depth - 0.24, 0.45, 0.48, 0, shades[5 + i]))
    boxes.append(Box(width - 0.35, round(rng.uniform(0.8, 1.6), 2), 0.7, 1.1, 0, shades[10]))
    boxes.append(Box(round(rng.uniform(2.5, 4.0), 2), 0.3, 1.3, 0.6, 0, shades[11]))
    return Room("ward", width, depth, tuple(boxes))


def _corridor(rng: np.random.Generator, shades: Array) -> Room:
    width, depth = np.round(rng.uniform([13.0, 5.0], [19.0, 6.5]), 2)
    boxes = _shell(width, depth, shades)
    gap, hall = round(rng.uniform(4.0, 8.0), 2), round(rng.uniform(2.3, 2.9), 2)
    boxes.append(Box(gap / 2, (hall + depth) / 2, gap, depth - hall, 0, shades[4]))
    right = gap + round(rng.uniform(2.4, 3.2), 2)
    boxes.append(Box((right + width) / 2, (hall + depth) / 2, width - right, depth - hall, 0, shades[5]))
    for i in range(3):
        x = round(width * (0.2 + 0.3 * i) + rng.uniform(-0.5, 0.5), 2)
        boxes.append(Box(x, 0.15, round(rng.uniform(0.5, 1.4), 2), 0.3, 0, shades[6 + i]))
    boxes.append(Box(width - 0.3, hall - 0.3, 0.6, 0.6, 0, shades[10]))
    return Room("corridor", width, depth, tuple(boxes))


def _office(rng: np.random.Generator, shades: Array) -> Room:
    width, depth = np.round(rng.uniform([7.0, 6.0], [9.5, 8.0]), 2)
    boxes = _shell(width, depth, shades)
    boxes.append(Box(width - 0.4, round(depth * 0.6, 2), 0.8, 1.6, 0, shades[4]))
    boxes.append(Box(0.8, depth - 0.4, 1.6, 0.8, 0, shades[5]))
    boxes.append(Box(round(width * 0.55, 2), depth - 0.9, 0.12, 1.8, 0, shades[6]))
    boxes.append(Box(round(width * 0.45, 2), round(depth * 0.42, 2), 1.2, 0.7, round(rng.uniform(15, 70)), shades[7]))
    boxes.append(Box(0.35, 1.1, 0.6, 0.9, round(rng.uniform(-12, 12)), shades[8]))
    boxes.append(Box(round(width * 0.75, 2), 0.25, 0.9, 0.5, 0, shades[9]))
    return Room("office", width, depth, tuple(boxes))


def draw_room(rng: np.random.Generator, dark: bool) -> Room:
    """A ward, a corridor or an office; some walls are dark if asked for."""
    shades = _shades(rng, 16, dark)
    return (_ward, _corridor, _office)[int(rng.integers(3))](rng, shades)


def real_room(room: Room, hidden: list[Hidden]) -> Room:
    """The room as it is: walls elsewhere than in the map, if that is hidden."""
    for h in hidden:
        if h.id == "world.map_error":
            rng = np.random.default_rng(int(h.extra * 1e6))
            moved = []
            for b in room.boxes:
                dx, dy = rng.normal(0, h.size, 2)
                turn = rng.normal(0, 0.15) if h.other else 0.0
                moved.append(replace(b, x=b.x + dx, y=b.y + dy, turn=b.turn + turn))
            return replace(room, boxes=tuple(moved))
    return room


def cast(segments: Array, x: Array, y: Array, a: Array) -> tuple[Array, Array, Array]:
    """Range, cosine of incidence and brightness of what rays from x, y in direction a meet."""
    c, s = np.cos(a), np.sin(a)
    best = np.full(a.shape, np.inf)
    slant, bright = np.ones(a.shape), np.ones(a.shape)
    for x0, y0, x1, y1, shade in segments:
        ex, ey = x1 - x0, y1 - y0
        with np.errstate(divide="ignore", invalid="ignore"):
            det = c * ey - s * ex
            r = ((x0 - x) * ey - (y0 - y) * ex) / det
            u = ((x0 - x) * s - (y0 - y) * c) / det
        hit = (r > 0.01) & (u >= 0) & (u <= 1) & (r < best)
        best = np.where(hit, r, best)
        slant = np.where(hit, np.abs(det) / np.hypot(ex, ey), slant)
        bright = np.where(hit, shade, bright)
    return best, np.clip(slant, 0.02, 1.0), bright


def clearance(segments: Array, x: Array, y: Array) -> Array:
    """How far each point is from the nearest wall."""
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    px, py = x[..., None] - segments[:, 0], y[..., None] - segments[:, 1]
    u = np.clip((px * ex + py * ey) / (ex**2 + ey**2), 0, 1)
    result: Array = np.hypot(px - u * ex, py - u * ey).min(axis=-1)
    return result


def free_spot(room: Room, rng: np.random.Generator, margin: float) -> tuple[float, float]:
    """A place away from the walls and not within a box."""
    segments = room.segments()
    for _ in range(2000):
        x, y = rng.uniform(0, room.width), rng.uniform(0, room.depth)
        inside = any(abs(x - b.x) < b.long / 2 and abs(y - b.y) < b.wide / 2 for b in room.boxes)
        if not inside and clearance(segments, np.array([x]), np.array([y]))[0] > margin:
            return x, y
    raise RuntimeError("no free place")

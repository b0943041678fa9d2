# SPDX-License-Identifier: BSD-3-Clause
"""Rooms of boxes: how they are drawn, written as a Stage world, and met by rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.holm.core import Array, chosen


@dataclass(frozen=True)
class Box:
    """A block of the world, centre and size [m], turned by yaw."""

    x: float
    y: float
    sx: float
    sy: float
    yaw: float
    shine: float


@dataclass
class Room:
    """Boxes, with their faces as segments (n, 2, 2) and how those shine."""

    boxes: list[Box]
    size: tuple[float, float]

    def __post_init__(self) -> None:
        faces = []
        for b in self.boxes:
            c, s = np.cos(b.yaw), np.sin(b.yaw)
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [b.sx / 2, b.sy / 2]
            corners = corners @ np.array([[c, s], [-s, c]]) + [b.x, b.y]
            faces += [[corners[k], corners[(k + 1) % 4]] for k in range(4)]
        self.faces = np.array(faces)
        self.shine = np.repeat([b.shine for b in self.boxes], 4)

    def clear(self, points: Array) -> float:
        """Distance of the nearest face to any of the points (n, 2)."""
        a, d = self.faces[:, 0], self.faces[:, 1] - self.faces[:, 0]
        rel = points[:, None, :] - a
        along = np.clip((rel * d).sum(-1) / (d * d).sum(-1), 0, 1)
        return float(np.sqrt(((rel - along[..., None] * d) ** 2).sum(-1).min()))

    def cast(self, origin: Array, angle: Array) -> tuple[Array, Array, Array]:
        """Range, cosine of incidence and face of each ray; origin (n, 2), angle (n,)."""
        n = angle.size
        r, cos, face = np.full(n, np.inf), np.ones(n), np.full(n, -1)
        a = self.faces[:, 0]
        e = self.faces[:, 1] - a
        length = np.hypot(e[:, 0], e[:, 1])
        for k in range(0, n, 8000):
            part = slice(k, k + 8000)
            dx, dy = np.cos(angle[part])[:, None], np.sin(angle[part])[:, None]
            qx, qy = a[:, 0] - origin[part, :1], a[:, 1] - origin[part, 1:2]
            cross = dx * e[:, 1] - dy * e[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (qx * e[:, 1] - qy * e[:, 0]) / cross
                u = (qx * dy - qy * dx) / cross
            t = np.where((t > 1e-6) & (u >= 0) & (u <= 1), t, np.inf)
            best = t.argmin(axis=1)
            rows = np.arange(best.size)
            r[part], face[part] = t[rows, best], best
            cos[part] = np.abs(cross[rows, best]) / length[best]
        return r, cos, face

    def scaled(self, factor: float, shifts: Array) -> Room:
        """The room as it really is: all lengths by factor, each box moved by its shift (n, 2)."""
        moved = [
            replace(b, x=b.x * factor + s[0], y=b.y * factor + s[1], sx=b.sx * factor, sy=b.sy * factor)
            for b, s in zip(self.boxes, shifts, strict=True)
        ]
        return Room(moved, self.size)

    def world(self) -> str:
        """The room in Stage's syntax."""
        lines = ['define wall model\n(\n  size [1.0 1.0 1.5]\n  ranger_return 1.0\n  color "grey60"\n)\n']
        for b in self.boxes:
            grey = "white" if b.shine > 0.75 else "grey60" if b.shine > 0.4 else "grey20"
            lines.append(
                f"wall ( pose [{b.x:.4f} {b.y:.4f} 0 {np.degrees(b.yaw):.4f}] "
                f"size [{b.sx:.4f} {b.sy:.4f} 1.5] "
                f'ranger_return {b.shine:.2f} color "{grey}" )'
            )
        return "\n".join(lines) + "\n"


def draw(rng: np.random.Generator) -> Room:
    """A room, a hall with pillars, or a corridor; origin near its middle."""
    kind = chosen(rng, ("room", "hall", "corridor", "room"))
    lx, ly = {
        "room": (rng.uniform(4.5, 7), rng.uniform(4, 6)),
        "hall": (rng.uniform(7, 10), rng.uniform(6, 8)),
        "corridor": (rng.uniform(9, 14), rng.uniform(2.6, 3.4)),
    }[kind]
    thick = 0.12

    def shade() -> float:
        return float(chosen(rng, (0.9, 0.9, 0.6, 0.3, 0.15)))

    boxes = []
    for side in (-1, 1):
        skew = rng.uniform(-0.06, 0.06) if rng.random() < 0.4 else 0.0
        boxes.append(Box(0, side * (ly + thick) / 2, lx + 1, thick, skew, shade()))
        skew = rng.uniform(-0.06, 0.06) if rng.random() < 0.4 else 0.0
        boxes.append(Box(side * (lx + thick) / 2, 0, thick, ly + 1, skew, shade()))
    for _ in range(int(rng.integers(2, 5)) if kind != "corridor" else int(rng.integers(3, 6))):
        side = int(rng.integers(4))
        along, deep, wide = rng.uniform(-0.42, 0.42), rng.uniform(0.15, 0.45), rng.uniform(0.3, 1.2)
        if kind == "corridor":
            deep, side = rng.uniform(0.1, 0.25), int(rng.integers(2))
        if side < 2:
            boxes.append(Box(along * lx, (side * 2 - 1) * (ly - deep) / 2, wide, deep, rng.uniform(-0.1, 0.1), shade()))
        else:
            boxes.append(Box((side * 2 - 5) * (lx - deep) / 2, along * ly, deep, wide, rng.uniform(-0.1, 0.1), shade()))
    for _ in range(int(rng.integers(2, 5)) if kind == "hall" else int(rng.integers(0, 2)) if kind == "room" else 0):
        place = rng.uniform(-0.33, 0.33, 2) * [lx, ly]
        if np.hypot(*place) > 1.5:
            wide = rng.uniform(0.2, 0.5)
            boxes.append(Box(place[0], place[1], wide, wide, rng.uniform(0, 1.5), shade()))
    wall = rng.uniform(0.3, 1)
    if rng.random() >= 0.6:
        boxes.append(Box(0.42 * lx, 0.42 * ly, 0.1, 1.2 * wall + 0.6, float(rng.uniform(0.4, 1.1)), shade()))
    return Room(
        [
            replace(
                b,
                x=round(b.x, 3),
                y=round(b.y, 3),
                yaw=float(np.radians(round(np.degrees(b.yaw), 3))),
                sx=round(b.sx, 3),
                sy=round(b.sy, 3),
            )
            for b in boxes
        ],
        (lx, ly),
    )

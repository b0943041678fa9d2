# SPDX-License-Identifier: BSD-3-Clause
"""A room of walls and blocks: rays, clearance, and its Stage world."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass
class Box:
    """An upright box: centre, size, turn, and how much of the light it returns."""

    x: float
    y: float
    a: float
    b: float
    turn: float
    bright: float

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        """A place in the box's own axes."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return c * (x - self.x) + s * (y - self.y), c * (y - self.y) - s * (x - self.x)


@dataclass
class Hits:
    """Where rays end: range, cosine of incidence, direction, bearing, place, brightness, box, when, how fast."""

    r: Array
    cos: Array
    direction: Array
    normal: Array
    bright: Array
    x: Array
    y: Array
    bearing: Array
    t: Array
    v: Array
    w: Array


@dataclass
class Room:
    """Boxes, the first four being the walls."""

    boxes: list[Box]
    width: float
    depth: float

    def cast(self, x: Array, y: Array, direction: Array) -> tuple[Array, Array, Array, Array]:
        """Range, normal's direction, brightness, and cosine of incidence of rays (infinite range: nothing met)."""
        best = np.full(x.shape, np.inf)
        normal, bright = np.zeros(x.shape), np.ones(x.shape)
        for box in self.boxes:
            px, py = box.local(x, y)
            ux, uy = np.cos(direction - box.turn), np.sin(direction - box.turn)
            ux = np.where(np.abs(ux) < 1e-9, 1e-9, ux)
            uy = np.where(np.abs(uy) < 1e-9, 1e-9, uy)
            near_x, near_y = (-np.sign(ux) * box.a / 2 - px) / ux, (-np.sign(uy) * box.b / 2 - py) / uy
            far = np.minimum((np.sign(ux) * box.a / 2 - px) / ux, (np.sign(uy) * box.b / 2 - py) / uy)
            near = np.maximum(near_x, near_y)
            met = (near < far) & (near > 1e-6) & (near < best)
            best = np.where(met, near, best)
            side = np.where(near_x > near_y, np.where(ux > 0, np.pi, 0.0), np.where(uy > 0, -np.pi / 2, np.pi / 2))
            normal = np.where(met, side + box.turn, normal)
            bright = np.where(met, box.bright, bright)
        return best, normal, bright, np.clip(-np.cos(direction - normal), 0.02, 1.0)

    def clearance(self, x: Array, y: Array) -> Array:
        """Distance of places from the nearest box."""
        best = np.full(np.shape(x), np.inf)
        for box in self.boxes:
            px, py = box.local(x, y)
            gap = np.hypot(np.maximum(np.abs(px) - box.a / 2, 0), np.maximum(np.abs(py) - box.b / 2, 0))
            best = np.minimum(best, gap)
        return best

    def moved(self, shifts: Array, factor: float) -> "Room":
        """The room as it really is: each box shifted, everything scaled."""
        new = [
            replace(b, x=(b.x + d[0]) * factor, y=(b.y + d[1]) * factor, a=b.a * factor, b=b.b * factor)
            for b, d in zip(self.boxes, shifts, strict=True)
        ]
        return replace(self, boxes=new)

    def world(self) -> str:
        """The text of a Stage world."""
        text = (
            f'name "room"\nresolution 0.01\nwindow ( size [ 700 600 ] center [ {self.width / 2} {self.depth / 2} ] )\n'
        )
        corners = " ".join(f"point[{i}] [ {p} ]" for i, p in enumerate(("0 0", "1 0", "1 1", "0 1")))
        for i, b in enumerate(self.boxes):
            text += (
                f'model ( name "box{i}" pose [ {b.x:.4f} {b.y:.4f} 0 {np.degrees(b.turn):.3f} ]'
                f" size [ {b.a:.4f} {b.b:.4f} 1.2 ]\n  block ( points 4 {corners} z [ 0 1 ] )\n"
                f'  color "gray{int(100 * b.bright)}" ranger_return {b.bright:.2f} obstacle_return 1 gui_nose 0 )\n'
            )
        return text


def furnish(rng: np.random.Generator) -> Room:
    """A room of some 7 by 6 m with blocks along the walls and perhaps one within."""
    width, depth, thick = rng.uniform(6.2, 7.6), rng.uniform(5.4, 6.6), 0.1
    dark = rng.uniform(0.2, 0.5)
    shade = [1.0, 1.0, dark, 1.0] if rng.random() < 0.5 else [1.0, dark, 1.0, 1.0]
    boxes = [
        Box(width / 2, -thick / 2, width + 2 * thick, thick, 0.0, shade[0]),
        Box(width / 2, depth + thick / 2, width + 2 * thick, thick, 0.0, shade[1]),
        Box(-thick / 2, depth / 2, thick, depth, 0.0, shade[2]),
        Box(width + thick / 2, depth / 2, thick, depth, 0.0, shade[3]),
    ]
    for _ in range(int(rng.integers(3, 7))):
        a, b, along = rng.uniform(0.3, 0.9), rng.uniform(0.2, 0.5), rng.random()
        bright = dark if rng.random() < 0.4 else 1.0
        x, y, turn = [
            (along * width, b / 2 + 0.02, 0.0),
            (along * width, depth - b / 2 - 0.02, np.pi),
            (b / 2 + 0.02, along * depth, np.pi / 2),
            (width - b / 2 - 0.02, along * depth, -np.pi / 2),
        ][int(rng.integers(4))]
        x, y = np.clip(x, a / 2, width - a / 2), np.clip(y, a / 2, depth - a / 2)
        boxes.append(Box(float(x), float(y), a, b, turn + rng.normal(0, 0.1), bright))
    if rng.random() < 0.5:
        boxes.append(Box(width / 2 + rng.normal(0, 0.2), depth / 2, 0.35, 0.3, rng.uniform(0, 1.5), dark))
    return Room(boxes, width, depth)

# SPDX-License-Identifier: BSD-3-Clause
"""What bodies are made of, and how they are stretched to a size as Stage does it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.colors import Color
from kurumaisu.world.model import Polygon, Shape

EPSILON = float(np.finfo(np.float64).eps)  # what Stage takes for an extent of 0
_BOUNDARY = 0.01  # thickness of a boundary's walls [m], as in Stage


@dataclass(frozen=True)
class Prism:
    """Corners (k, 2) and heights (2,); drawn: its sides are part of the outline."""

    corners: FloatArray
    heights: FloatArray
    drawn: bool = True


@dataclass
class Parts:
    """What a body is made of.

    segments (m, 4) with heights (m, 2) that belong to no prism, and prisms; the last `merged` of the segments' arrays
    are what is seen of prisms that are not drawn; box: corners (2, 3) that it fills beyond its parts; fixed: it is at
    its place already.
    """

    segments: list[FloatArray] = field(default_factory=list)
    heights: list[FloatArray] = field(default_factory=list)
    merged: int = 0
    prisms: list[Prism] = field(default_factory=list)
    box: FloatArray | None = None
    fixed: bool = False

    def add(self, segments: FloatArray, height: float) -> None:
        """Add segments (m, 4) from the base to a height."""
        self.segments.append(segments)
        self.heights.append(np.tile([0.0, height], (len(segments), 1)))

    @property
    def empty(self) -> bool:
        """Whether there is no body."""
        return not any(len(part) for part in (*self.segments, *(prism.corners for prism in self.prisms)))

    def bounds(self) -> FloatArray:
        """Return the lowest and highest x, y, z (2, 3)."""
        points = np.concatenate([*(s.reshape(-1, 2) for s in self.segments), *(p.corners for p in self.prisms)])
        heights = np.concatenate([*self.heights, *(p.heights[None] for p in self.prisms)])
        low = np.array([*points.min(axis=0), heights[:, 0].min()])
        high = np.array([*points.max(axis=0), heights[:, 1].max()])
        if self.box is not None:
            low, high = np.minimum(low, self.box[0]), np.maximum(high, self.box[1])
        return np.array([low, high])

    def fit(self, size: FloatArray) -> Parts:
        """Return the parts filling a size (3,), centred in x and y (libstage/blockgroup.cc, CalcSize).

        Heights are scaled as the whole is, without moving the lowest to 0.
        """
        if self.fixed or self.empty:
            return self
        low, high = self.bounds()
        extent = np.where(np.abs(high - low) < EPSILON, EPSILON, high - low)
        middle = low[:2] + extent[:2] / 2
        scale = size / extent
        return Parts(
            [((s.reshape(-1, 2) - middle) * scale[:2]).reshape(-1, 4) for s in self.segments],
            [h * scale[2] for h in self.heights],
            self.merged,
            [Prism((p.corners - middle) * scale[:2], p.heights * scale[2], p.drawn) for p in self.prisms],
            None if self.box is None else (self.box - [*middle, 0.0]) * scale,
        )

    def shape(self, origin: FloatArray, color: Color) -> Shape:
        """Return the parts as a shape, moved and turned by the origin (4,)."""
        c, s = np.cos(origin[3]), np.sin(origin[3])
        turn = np.array([[c, s], [-s, c]])
        segments = [np.empty((0, 2)), *(s.reshape(-1, 2) for s in self.segments)]
        heights = [np.empty((0, 2)), *self.heights]
        # What is upside down is hit by no ray, as in Stage.
        prisms = [p for p in self.prisms if len(p.corners) > 1 and p.heights[0] <= p.heights[1]]
        for prism in prisms:
            if prism.drawn:
                segments.append(edges(prism.corners).reshape(-1, 2))
                heights.append(np.tile(prism.heights, (len(prism.corners), 1)))
        return Shape(
            segments=np.asarray(np.concatenate(segments) @ turn + origin[:2]).reshape(-1, 4),
            heights=np.concatenate(heights) + origin[2],
            polygons=tuple(Polygon(p.corners @ turn + origin[:2], p.heights + origin[2], color) for p in prisms),
            edges=self._edges(prisms),
        )

    def _edges(self, prisms: list[Prism]) -> FloatArray:
        """Return all outlines (k, 6) as Stage draws them, of prisms that cover each other too."""
        count = len(self.segments) - self.merged
        loops = [np.hstack(pair) for pair in zip(self.segments[:count], self.heights[:count], strict=True)]
        loops += [np.hstack([edges(p.corners), np.tile(p.heights, (len(p.corners), 1))]) for p in prisms]
        return np.concatenate([np.empty((0, 6)), *loops])


def edges(corners: FloatArray) -> FloatArray:
    """Return the edges (k, 4) of a closed polygon (k, 2)."""
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def rectangle(x0: float, y0: float, x1: float, y1: float) -> FloatArray:
    """Return its corners (4, 2), counter-clockwise."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=np.float64)


def with_boundary(parts: Parts, size: FloatArray) -> Parts:
    """Return the parts with a wall along the edge of the size: outline, and prisms for its four sides.

    The sides are reckoned as in Stage, from what the parts fill (libstage/model.cc, Load).
    """
    low, high = (-size / 2, size / 2) if parts.empty or parts.fixed else parts.bounds()
    (x, y), (wide, deep), t, top = low[:2], (high - low)[:2], _BOUNDARY, size[2]
    ends = x + wide, y + deep
    parts.add(edges(rectangle(x, y, *ends)), top)
    parts.merged = 1
    if min(wide, deep) > 2 * t:
        parts.add(edges(rectangle(x + t, y + t, *(high[:2] - t))), top)
        parts.merged = 2
    right, upper = high[:2] - t
    sides = [(x, y, x + t, ends[1]), (x, y, ends[0], y + t)]
    sides += [(x, upper, ends[0], upper + t), (right, y, right + t, ends[1])]
    parts.prisms += [Prism(rectangle(*side), np.array([0.0, top]), drawn=False) for side in sides]
    return parts

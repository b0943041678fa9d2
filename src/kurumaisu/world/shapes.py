# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of Stage models: blocks, bitmaps and boxes, trimmed and stretched to the model's size as Stage does."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.world.bitmaps import Bitmap, read_bitmap
from kurumaisu.world.files import find
from kurumaisu.world.model import Polygon, Shape
from kurumaisu.world.values import Values

Color = tuple[float, float, float, float]

_BOUNDARY = 0.01  # thickness of a boundary's walls [m], as in Stage
_NOTEWORTHY = 0.01  # by how much a bitmap's scale changes before a warning says so
_MOST_POINTS = 10_000  # of a block
_EPSILON = float(np.finfo(np.float64).eps)
_NO_BODY = ("ranger", "fiducial", "blobfinder")  # unless the file gives them one


@dataclass(frozen=True)
class _Prism:
    """Corners (k, 2) and heights (2,); drawn: its sides are part of the outline."""

    corners: FloatArray
    heights: FloatArray
    drawn: bool = True


@dataclass
class _Parts:
    """What a body is made of.

    segments (m, 4) with heights (m, 2) that belong to no prism, and prisms; box: corners (2, 3) that it fills beyond
    its parts; fixed: it is at its place already.
    """

    segments: list[FloatArray] = field(default_factory=list)
    heights: list[FloatArray] = field(default_factory=list)
    prisms: list[_Prism] = field(default_factory=list)
    box: FloatArray | None = None
    fixed: bool = False

    def add(self, segments: FloatArray, height: float) -> None:
        """Add segments (m, 4) from the base to a height."""
        self.segments.append(segments)
        self.heights.append(np.tile([0.0, height], (len(segments), 1)))

    @property
    def empty(self) -> bool:
        """Whether there is no body."""
        return not self.prisms and not sum(map(len, self.segments))

    def bounds(self) -> FloatArray:
        """Return the lowest and highest x, y, z (2, 3)."""
        points = np.concatenate([*(s.reshape(-1, 2) for s in self.segments), *(p.corners for p in self.prisms)])
        heights = np.concatenate([*(h.ravel() for h in self.heights), *(p.heights for p in self.prisms)])
        low = np.array([*points.min(axis=0), heights.min()])
        high = np.array([*points.max(axis=0), heights.max()])
        if self.box is not None:
            low, high = np.minimum(low, self.box[0]), np.maximum(high, self.box[1])
        return np.array([low, high])

    def fit(self, size: FloatArray) -> _Parts:
        """Return the parts filling a size (3,), centred in x and y (libstage/blockgroup.cc, CalcSize).

        Heights are scaled as the whole is, without moving the lowest to 0.
        """
        if self.fixed or self.empty:
            return self
        low, high = self.bounds()
        extent = np.where(np.abs(high - low) < _EPSILON, _EPSILON, high - low)
        middle = low[:2] + extent[:2] / 2
        scale = size / extent
        return _Parts(
            [((s.reshape(-1, 2) - middle) * scale[:2]).reshape(-1, 4) for s in self.segments],
            [h * scale[2] for h in self.heights],
            [_Prism((p.corners - middle) * scale[:2], p.heights * scale[2], p.drawn) for p in self.prisms],
            None if self.box is None else (self.box - [*middle, 0.0]) * scale,
        )

    def shape(self, origin: FloatArray, color: Color) -> Shape:
        """Return the parts as a shape, moved and turned by the origin (4,)."""
        c, s = np.cos(origin[3]), np.sin(origin[3])
        turn = np.array([[c, s], [-s, c]])
        segments = [np.empty((0, 2)), *(s.reshape(-1, 2) for s in self.segments)]
        heights = [np.empty((0, 2)), *self.heights]
        for prism in self.prisms:
            if prism.drawn:
                segments.append(_edges(prism.corners).reshape(-1, 2))
                heights.append(np.tile(prism.heights, (len(prism.corners), 1)))
        return Shape(
            segments=np.asarray(np.concatenate(segments) @ turn + origin[:2]).reshape(-1, 4),
            heights=np.concatenate(heights) + origin[2],
            polygons=tuple(Polygon(p.corners @ turn + origin[:2], p.heights + origin[2], color) for p in self.prisms),
        )


def _edges(corners: FloatArray) -> FloatArray:
    """Return the edges (k, 4) of a closed polygon (k, 2)."""
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> FloatArray:
    """Return its corners (4, 2), counter-clockwise."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=np.float64)


@dataclass
class Shaper:
    """Makes the shapes of a world's models; top: its first file, which bitmaps are relative to."""

    top: Path
    image_extents: bool
    bitmaps: dict[Path, Bitmap] = field(default_factory=dict)

    def shape(self, values: Values, size: FloatArray, origin: FloatArray, color: Color) -> tuple[Shape, FloatArray]:
        """Return a model's shape and size (3,), which is another one for a map with its own resolution.

        Raise Error with the place.
        """
        parts = self._body(values, size)
        if values.has("bitmap"):
            parts, size = self._bitmap(values, size)
        blocks = [child for child in values.entity.children if child.type == "block"]
        if blocks and not values.has("bitmap"):
            parts = _Parts()  # the first block displaces the default body, and the boundary with it
        elif values.whole("boundary", 0):
            parts = _with_boundary(parts, size)
        parts.prisms += [_block(Values(block, values.units, values.notes)) for block in blocks]
        if not parts.empty and not parts.fixed and ((bounds := parts.bounds())[1] - bounds[0])[:2].min() < _EPSILON:
            values.notes.add(values.entity.name, f"the body of {values.entity.name.text} has no area")
        return parts.fit(size).shape(origin, color), size

    def _body(self, values: Values, size: FloatArray) -> _Parts:
        """Return what a model consists of if its file says nothing: most types are a box."""
        parts = _Parts()
        if values.entity.type == "gripper":
            parts.prisms += _gripper(values)
        elif values.entity.type not in _NO_BODY and not values.whole("boundary", 0):
            parts.prisms.append(_Prism(_rectangle(0, 0, 1, 1), np.array([0.0, 1.0])))
        return _Parts() if values.whole("noblocks", 0) else parts.fit(size)

    def _bitmap(self, values: Values, size: FloatArray) -> tuple[_Parts, FloatArray]:
        """Return the walls of a bitmap and the model's size (3,)."""
        name = values.entity.properties["bitmap"].values[0] if values.text("bitmap", "") else None
        if name is None:
            raise values.error("bitmap", "bitmap needs the name of an image")
        bitmap = self._read(values, find(name, self.top, search_path=False))
        if self.image_extents and bitmap.resolution is not None:
            return _map_parts(bitmap, size[2]), np.array([*bitmap.extent, size[2]])
        parts = _Parts()
        parts.add(bitmap.runs, 1.0)
        if parts.empty:
            values.notes.add(name, f"{bitmap.path}: has no wall pixels")
        elif self.image_extents:
            parts.box = np.array([[0, 0, 0], [bitmap.width, bitmap.height, 1]], dtype=np.float64)
        else:
            _note_stretch(values, bitmap, name.string)
        return parts.fit(size), size

    def _read(self, values: Values, path: Path) -> Bitmap:
        if path not in self.bitmaps:
            try:
                self.bitmaps[path] = read_bitmap(path)
            except Error as error:
                raise values.error("bitmap", str(error)) from error
        return self.bitmaps[path]


def _map_parts(bitmap: Bitmap, height: float) -> _Parts:
    """Return the walls of a map at its own coordinates."""
    x, y, heading = bitmap.origin
    c, s = np.cos(heading), np.sin(heading)
    points = bitmap.runs.reshape(-1, 2) * (bitmap.resolution or 1.0) @ np.array([[c, s], [-s, c]]) + [x, y]
    parts = _Parts(fixed=True)
    parts.add(np.asarray(points).reshape(-1, 4), height)
    return parts


def _note_stretch(values: Values, bitmap: Bitmap, name: str) -> None:
    """Say so if the margins that Stage trims change the scale."""
    points = bitmap.runs.reshape(-1, 2)
    factors = np.array([bitmap.width, bitmap.height]) / (points.max(axis=0) - points.min(axis=0))
    if factors.max() > 1 + _NOTEWORTHY:
        text = (
            f"{name}: its walls without its margins fill the size, as in Stage: {factors[0]:.3f} times as wide and "
            f"{factors[1]:.3f} times as high as in the whole image (image_extents takes that instead)"
        )
        values.notes.add(values.entity.properties["bitmap"].name, text)


def _with_boundary(parts: _Parts, size: FloatArray) -> _Parts:
    """Return the parts with a wall along the edge of the size: outline, and prisms for its four sides."""
    (x, y), t = size[:2] / 2, _BOUNDARY
    parts.add(_edges(_rectangle(-x, -y, x, y)), size[2])
    if min(x, y) > t:
        parts.add(_edges(_rectangle(-x + t, -y + t, x - t, y - t)), size[2])
    sides = ((-x, -y, t - x, y), (-x, -y, x, t - y), (-x, y - t, x, y), (x - t, -y, x, y))
    parts.prisms += [_Prism(_rectangle(*side), np.array([0.0, size[2]]), drawn=False) for side in sides]
    return parts


def _block(values: Values) -> _Prism:
    count = values.whole("points", 0)
    if not 2 <= count <= _MOST_POINTS:
        raise values.error("points", f"points must be 2 to {_MOST_POINTS}, not {count}")
    for i in range(count):
        if not values.has(f"point[{i}]"):
            values.notes.add(values.entity.name, f"block has no point[{i}]: it is read as [0 0], as Stage does")
    corners = np.array([values.several(f"point[{i}]", "ll", (0.0, 0.0)) for i in range(count)])
    x, y = corners.T
    if (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() < 0:
        corners = corners[::-1]  # counter-clockwise, as in Stage
    heights = np.array(values.several("z", "ll", (0.0, 0.0)))
    if heights[0] > heights[1]:
        raise values.error("z", f"z must be [MIN MAX], not {heights[0]:g}, {heights[1]:g}")
    if not values.has("z"):
        values.notes.add(values.entity.name, "block has no z: it is as flat as the floor, as in Stage", "flat block")
    return _Prism(np.ascontiguousarray(corners), heights)


def _gripper(values: Values) -> list[_Prism]:
    """Return the body and the two paddles, in shares of the size (libstage/model_gripper.cc)."""
    x, y, z = values.several("paddle_size", "lll", (0.66, 0.1, 0.4))
    shift = 0.0 if values.text("paddle_state", "open") != "closed" else 0.5 - y
    paddles = ((1 - x, shift, 1, shift + y), (1 - x, 1 - shift - y, 1, 1 - shift))
    body = _Prism(_rectangle(0, 0, 1 - x, 1), np.array([0.0, 1.0]))
    return [body, *(_Prism(_rectangle(*paddle), np.array([0.0, z])) for paddle in paddles)]

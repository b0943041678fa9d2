# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of Stage models: blocks, bitmaps and boxes, trimmed and stretched to the model's size as Stage does."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.world.bitmaps import Bitmap, read_bitmap
from kurumaisu.world.colors import Color
from kurumaisu.world.files import find
from kurumaisu.world.model import Polygon, Shape
from kurumaisu.world.parts import EPSILON, Parts, Prism, rectangle, with_boundary
from kurumaisu.world.values import Values

_NOTEWORTHY = 0.01  # by how much a bitmap's scale changes before a warning says so
_MOST_POINTS = 10_000  # of a block
_SHAPING = ("bitmap", "boundary", "noblocks", "paddle_size", "paddle_state")  # properties, beside size and origin
_NO_BODY = ("ranger", "fiducial", "blobfinder")  # unless the file gives them one


@dataclass
class Shaper:
    """Makes the shapes of a world's models; top: its first file, which bitmaps are relative to."""

    top: Path
    image_extents: bool
    bitmaps: dict[Path, Bitmap] = field(default_factory=dict)
    shapes: dict[Hashable, tuple[Shape, FloatArray]] = field(default_factory=dict)

    def shape(self, values: Values, size: FloatArray, origin: FloatArray, color: Color) -> tuple[Shape, FloatArray]:
        """Return a model's shape and size (3,), which is another one for a map with its own resolution.

        Raise Error with the place.
        """
        given = values.entity.properties
        said = [(name, t.text, t.source.path) for name in _SHAPING if name in given for t in given[name].values]
        blocks = [id(child) for child in values.entity.children if child.type == "block"]
        alike = (values.entity.type, size.tobytes(), origin.tobytes(), *said, *blocks)
        if alike not in self.shapes:
            self.shapes[alike] = self._shape(values, size, origin, color)
        shape, size = self.shapes[alike]
        if not shape.polygons or shape.polygons[0].color == color:
            return shape, size
        polygons = tuple(Polygon(polygon.corners, polygon.heights, color) for polygon in shape.polygons)
        return replace(shape, polygons=polygons), size

    def _shape(self, values: Values, size: FloatArray, origin: FloatArray, color: Color) -> tuple[Shape, FloatArray]:
        parts = self._body(values, size)
        if values.has("bitmap"):
            parts, size = self._bitmap(values, size)
        blocks = [child for child in values.entity.children if child.type == "block"]
        if blocks and not values.has("bitmap"):
            parts = Parts()  # the first block displaces the default body, and the boundary with it
        elif values.whole("boundary", 0):
            parts = with_boundary(parts.fit(size), size)
        parts = parts.fit(size)  # as often as Stage does, or the last bits differ
        parts.prisms += [_block(Values(block, values.units, values.notes)) for block in blocks]
        if not parts.empty and not parts.fixed and ((bounds := parts.bounds())[1] - bounds[0])[:2].min() < EPSILON:
            values.notes.add(values.entity.name, f"the body of {values.entity.name.text} has no area")
        return parts.fit(size).shape(origin, color), size

    def _body(self, values: Values, size: FloatArray) -> Parts:
        """Return what a model consists of if its file says nothing: most types are a box."""
        parts = Parts()
        if values.entity.type == "gripper":
            parts.prisms += _gripper(values)
        elif values.entity.type not in _NO_BODY and not values.whole("boundary", 0):
            parts.prisms.append(Prism(rectangle(0, 0, 1, 1), np.array([0.0, 1.0])))
        return Parts() if values.whole("noblocks", 0) else parts.fit(size)

    def _bitmap(self, values: Values, size: FloatArray) -> tuple[Parts, FloatArray]:
        """Return the walls of a bitmap and the model's size (3,)."""
        name = values.entity.properties["bitmap"].values[0] if values.text("bitmap", "") else None
        if name is None:
            raise values.error("bitmap", "bitmap needs the name of an image")
        bitmap = self._read(values, find(name, self.top, search_path=False))
        if self.image_extents and bitmap.resolution is not None:
            return _map_parts(bitmap, size[2]), np.array([*bitmap.extent, size[2]])
        parts = Parts()
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


def _map_parts(bitmap: Bitmap, height: float) -> Parts:
    """Return the walls of a map at its own coordinates."""
    x, y, heading = bitmap.origin
    c, s = np.cos(heading), np.sin(heading)
    points = bitmap.runs.reshape(-1, 2) * (bitmap.resolution or 1.0) @ np.array([[c, s], [-s, c]]) + [x, y]
    parts = Parts(fixed=True)
    parts.add(np.asarray(points).reshape(-1, 4), height)
    return parts


def _note_stretch(values: Values, bitmap: Bitmap, name: str) -> None:
    """Say so if the margins that Stage trims change the scale."""
    points = bitmap.runs.reshape(-1, 2)
    factors = np.array([bitmap.width, bitmap.height]) / (points.max(axis=0) - points.min(axis=0))
    if factors.max() > 1 + _NOTEWORTHY:
        text = (
            f"{name}: trimmed to its walls, then scaled to the size, as in Stage: {factors[0]:.3f} times as wide and "
            f"{factors[1]:.3f} times as high as the untrimmed image (image_extents does not trim)"
        )
        values.notes.add(values.entity.properties["bitmap"].name, text)


def _block(values: Values) -> Prism:
    count = values.whole("points", 0)
    if not 0 <= count <= _MOST_POINTS:
        raise values.error("points", f"points must be 0 to {_MOST_POINTS}, not {count}")
    if count < 3:
        values.notes.add(values.entity.name, f"a block of {count} points has no area")
    for i in range(count):
        if not values.has(f"point[{i}]"):
            values.notes.add(values.entity.name, f"block has no point[{i}]: it is read as [0 0], as Stage does")
    corners = np.array([values.several(f"point[{i}]", "ll", (0.0, 0.0)) for i in range(count)]).reshape(-1, 2)
    x, y = corners.T
    if (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() < 0:
        corners = corners[::-1]  # counter-clockwise, as in Stage
    heights = np.array(values.several("z", "ll", (0.0, 0.0)))
    if heights[0] > heights[1]:
        values.notes.add(values.entity.properties["z"].name, f"z should be [MIN MAX]: {heights[0]:g}, {heights[1]:g}")
    if not values.has("z"):
        values.notes.add(values.entity.name, "block has no z: it is as flat as the floor, as in Stage", "flat block")
    return Prism(np.ascontiguousarray(corners), heights)


def _gripper(values: Values) -> list[Prism]:
    """Return the body and the two paddles, in shares of the size (libstage/model_gripper.cc)."""
    x, y, z = values.several("paddle_size", "lll", (0.66, 0.1, 0.4))
    shift = 0.0 if values.text("paddle_state", "open") != "closed" else 0.5 - y
    paddles = ((1 - x, shift, 1, shift + y), (1 - x, 1 - shift - y, 1, 1 - shift))
    body = Prism(rectangle(0, 0, 1 - x, 1), np.array([0.0, 1.0]))
    return [body, *(Prism(rectangle(*paddle), np.array([0.0, z])) for paddle in paddles)]

# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of Stage models: blocks, bitmaps and boxes as line segments in the frame of the body."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image

from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world.syntax import Entity, Property

_BOUNDARY = 0.01  # thickness of a boundary's walls [m], as in Stage
_DARKEST_FREE = 128  # first channel of a pixel that is not a wall, as in Stage


def outline(entity: Entity, size: FloatArray, folder: Path) -> FloatArray:
    """Return the segments (m, 4) of a model, centred, its bounding box being size (2,) [m].

    As in Stage: all blocks together, or the occupied pixels of a bitmap (relative to the folder), fill the
    size; a model with neither, and without a boundary, is a box; blocks displace the boundary.
    Raise Error with file, line and column.
    """
    blocks = [child for child in entity.children if child.type == "block"]
    if blocks:
        return _fit(np.concatenate([_polygon(_points(block)) for block in blocks]), size, entity)
    parts = []
    if "bitmap" in entity.properties:
        parts.append(_fit(_pixel_outline(_occupied(entity.properties["bitmap"], folder)), size, entity))
    if "boundary" in entity.properties and entity.properties["boundary"].numbers(1, 1)[0]:
        parts += [_box(size), _box(size - 2 * _BOUNDARY)]
    return np.concatenate(parts) if parts else _box(size)


def transform(segments: FloatArray, pose: FloatArray) -> FloatArray:
    """Return map segments for segments (m, 4) in the frame of a pose (3,)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, s], [-s, c]])
    return np.asarray(segments.reshape(-1, 2) @ turn + pose[:2]).reshape(-1, 4)


def _polygon(points: FloatArray) -> FloatArray:
    return np.hstack([points, np.roll(points, -1, axis=0)])


def _box(size: FloatArray) -> FloatArray:
    return _polygon(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2)


def _points(block: Entity) -> FloatArray:
    if "points" not in block.properties:
        raise block.name.error("block needs points")
    count = block.properties["points"].numbers(1, 1)[0]
    if count != int(count) or count < 3:
        raise block.properties["points"].name.error(f"points must be a whole number of at least 3, not {count:g}")
    points = []
    for i in range(int(count)):
        if f"point[{i}]" not in block.properties:
            raise block.name.error(f"block needs point[{i}]")
        points.append(block.properties[f"point[{i}]"].numbers(2, 2))
    return np.array(points)


def _fit(segments: FloatArray, size: FloatArray, entity: Entity) -> FloatArray:
    points = segments.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    if (high <= low).any():
        raise entity.name.error(f"the shape of {entity.name.text} has no area")
    return np.asarray((points - (low + high) / 2) * (size / (high - low))).reshape(-1, 4)


def _occupied(bitmap: Property, folder: Path) -> BoolArray:
    """Return which pixels are walls, row 0 at the bottom."""
    path = folder / bitmap.text()
    try:
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))[::-1, :, 0]
    except (OSError, ValueError) as error:
        raise bitmap.name.error(f"{path}: is not a readable bitmap ({error})") from error
    occupied = np.asarray(pixels < _DARKEST_FREE)
    if not occupied.any():
        raise bitmap.name.error(f"{path}: has no wall pixels (first channel below {_DARKEST_FREE})")
    return occupied


def _pixel_outline(occupied: BoolArray) -> FloatArray:
    """Return the borders between wall and free pixels, in pixels, straight runs joined."""
    flat = _runs(occupied)
    upright = _runs(occupied.T)
    return np.concatenate([flat, upright[:, [1, 0, 3, 2]]])


def _runs(occupied: BoolArray) -> FloatArray:
    """Return the borders that run along rows: x0, y, x1, y."""
    padded = np.pad(occupied, 1).astype(np.int8)
    step = np.diff(padded, axis=0)  # +1 at the lower border of a wall, -1 at its upper border
    # A run ends where the step changes along the row; borders of opposite sense are never joined.
    segments = []
    for y in np.flatnonzero(step.any(axis=1)):
        edges = np.flatnonzero(np.diff(step[y]))
        for start, stop in pairwise(edges.tolist()):
            if step[y, start + 1]:
                segments.append((start, y, stop, y))
    return np.array(segments, dtype=np.float64).reshape(-1, 4)

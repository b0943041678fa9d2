# SPDX-License-Identifier: BSD-3-Clause
"""A world as an occupancy grid: what a perfect map of it would be."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.maps import Grid
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world.layout import placed, travels
from kurumaisu.world.model import Shape
from kurumaisu.world.parts import edges
from kurumaisu.world.world import World

_LINES = 4  # scan lines per cell and axis; walls along the axes are exact however thin they are
_LARGEST = 10**8  # cells
_MARGIN = 4  # cells around the world
_ROUNDING = 1e-6  # [cells] a wall that ends at a cell's border does not enter the next cell


def rasterise(
    outlines: Iterable[FloatArray], bounds: tuple[float, float, float, float], resolution: float, margin: int
) -> Grid:
    """Return a grid in which every cell that a solid enters is occupied and every other one is free.

    outlines: each (m, 4), the closed borders of one solid, holes by even and odd [m]; bounds: of the map [m];
    resolution [m] of a cell; margin: cells added on each side. The lower left corner is a multiple of the resolution.
    Raise Error for a grid of more than 10^8 cells.
    """
    x0, y0 = (int(np.floor(low / resolution + _ROUNDING)) - margin for low in bounds[:2])
    x1, y1 = (int(np.ceil(high / resolution - _ROUNDING)) + margin for high in bounds[2:])
    width, height = max(x1 - x0, 1), max(y1 - y0, 1)
    if width * height > _LARGEST:
        raise Error(f"a map of {width} x {height} cells of {resolution:g} m is too large; take a coarser resolution")
    occupied = np.zeros((height, width), dtype=np.bool_)
    for outline in outlines:
        cells = outline / resolution - np.array([x0, y0, x0, y0])
        _fill(occupied, cells)
        _fill(occupied.T, cells[:, [1, 0, 3, 2]])
    return Grid((100 * occupied).astype(np.int8), resolution, x0 * resolution, y0 * resolution)


def _fill(occupied: BoolArray, outline: FloatArray) -> None:
    """Mark the cells (rows, columns) that lines along the rows meet inside the outline, in units of cells."""
    rows, columns = occupied.shape
    low, high = np.minimum(outline[:, 1], outline[:, 3]), np.maximum(outline[:, 1], outline[:, 3])
    # Line k lies at (k + 0.5) / _LINES; which lines does each border cross?
    first = np.ceil(low * _LINES - 0.5).astype(np.int64)
    count = np.maximum(np.ceil(high * _LINES - 0.5).astype(np.int64) - first, 0)
    border = np.repeat(np.arange(len(outline)), count)
    line = first[border] + np.arange(len(border)) - np.repeat(np.cumsum(count) - count, count)
    ax, ay, bx, by = outline[border].T
    x = ax + ((line + 0.5) / _LINES - ay) * (bx - ax) / (by - ay)
    order = np.lexsort((x, line))
    row, x = line[order] // _LINES, x[order]
    enter = np.clip(np.floor(x[0::2] + _ROUNDING).astype(np.int64), 0, columns)
    leave = np.clip(np.ceil(x[1::2] - _ROUNDING).astype(np.int64), 0, columns)
    inside = (row[0::2] >= 0) & (row[0::2] < rows) & (leave > enter)
    steps = np.zeros((rows, columns + 1), dtype=np.int32)
    np.add.at(steps, (row[0::2][inside], enter[inside]), 1)
    np.add.at(steps, (row[0::2][inside], leave[inside]), -1)
    occupied |= np.cumsum(steps, axis=1)[:, :columns] > 0


def occupancy(world: World, resolution: float, height: float) -> Grid:
    """Return the map that a perfect laser at a height [m] would make: what moves by itself is left out.

    Raise Error for a grid that is too large, or a world of which nothing is at that height.
    """
    outlines = []
    for model in world.models:
        if travels(model, world.models) or model.ranger_return < 0:
            continue
        pose = world.poses[model.index]
        outlines += [placed(solid, pose) for solid in _solids(model.shape, height - float(pose[2]))]
    if not any(map(len, outlines)):
        raise Error(f"{world.path}: nothing is {height:g} m above the ground, so its map would be empty")
    return rasterise(outlines, world.bounds, resolution, _MARGIN)


def _solids(shape: Shape, height: float) -> Iterator[FloatArray]:
    """Yield closed borders (m, 4) of which each is solid inside, at a height [m] above the base.

    By even and odd, all borders together miss where two polygons overlap, so each polygon comes by itself as well.
    """
    yield shape.segments[(shape.heights[:, 0] <= height) & (height <= shape.heights[:, 1])]
    for polygon in shape.polygons:
        if polygon.heights[0] <= height <= polygon.heights[1]:
            yield edges(polygon.corners)

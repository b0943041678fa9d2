# SPDX-License-Identifier: BSD-3-Clause
"""How sharp a map is where there is no truth: its entropy, and how thick its walls are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label

from kurumaisu.maps import Grid
from kurumaisu.types import BoolArray

_WALL = 65  # [%] as in map_server
_FREE = 20
_LEAST = 5  # cells of a wall that is looked at: less is clutter
_NEAR = 0.3  # [m] in which a second wall, with free cells between, makes it double


@dataclass(frozen=True)
class Sharpness:
    """entropy: mean of the cells seen [bit]; thickness: mean of the walls [m]; double: share of wall cells [-]."""

    entropy: float
    thickness: float
    double: float


def sharpness(grid: Grid) -> Sharpness:
    """Judge a map. Entropy says little of one that knows only free and wall, as gmapping's."""
    seen = grid.cells >= 0
    p = np.clip(grid.cells[seen] / 100.0, 0.005, 0.995)
    entropy = float(np.mean(-p * np.log2(p) - (1 - p) * np.log2(1 - p))) if seen.any() else float("nan")
    parts, count = label(grid.cells > _WALL, structure=np.ones((3, 3)))
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    walls = (parts > 0) & (sizes[parts] >= _LEAST)
    return Sharpness(entropy, _thickness(walls) * grid.resolution, _double(grid, walls))


def _thickness(walls: BoolArray) -> float:
    """Return the mean over wall cells of how many lie in a row, across or along, whichever are fewer."""
    if not walls.any():
        return float("nan")
    rows = []
    for structure in ([[0, 0, 0], [1, 1, 1], [0, 0, 0]], [[0, 1, 0], [0, 1, 0], [0, 1, 0]]):
        parts, _ = label(walls, structure=np.array(structure))
        rows.append(np.bincount(parts.ravel())[parts[walls]])
    return float(np.mean(np.minimum(*rows)))


def _double(grid: Grid, walls: BoolArray) -> float:
    """Return the share of wall cells with another wall within reach behind a free cell."""
    reach = round(_NEAR / grid.resolution)
    free = (grid.cells >= 0) & (grid.cells < _FREE)
    found = np.zeros_like(walls)
    for dy, dx in ((0, 1), (1, 0)):
        for gap in range(2, reach + 1):
            first, last = _shifted(walls, 0, 0, gap * dy, gap * dx)
            between = np.ones_like(first)
            for step in range(1, gap):
                middle, _ = _shifted(free, step * dy, step * dx, gap * dy, gap * dx)
                between &= middle
            pair = first & last & between
            _mark(found, pair, 0, 0)
            _mark(found, pair, gap * dy, gap * dx)
    return float(np.mean(found[walls])) if walls.any() else float("nan")


def _shifted(cells: BoolArray, y: int, x: int, high: int, wide: int) -> tuple[BoolArray, BoolArray]:
    """Return cells from (y, x) on, and those at (high, wide), cut to a common shape."""
    height, width = cells.shape[0] - high, cells.shape[1] - wide
    return cells[y : y + height, x : x + width], cells[high : high + height, wide : wide + width]


def _mark(found: BoolArray, pair: BoolArray, y: int, x: int) -> None:
    found[y : y + pair.shape[0], x : x + pair.shape[1]] |= pair

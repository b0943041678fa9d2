# SPDX-License-Identifier: BSD-3-Clause
"""The ray caster over cells: counted by hand, and against the exact one."""

import math

import numpy as np
import pytest

from kurumaisu._core import Quantised, Scene
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

ROOM = np.array([[0, 0, 6, 0], [6, 0, 6, 5], [6, 5, 0, 5], [0, 5, 0, 0]], dtype=float)


def test_ranges_count_cells_along_the_nearer_axis() -> None:
    cells = Quantised(ROOM, 0.25)
    poses = np.array([[1.1, 2.1, 0.0], [1.1, 2.1, math.pi / 2], [1.1, 2.1, 0.4], [1.1, 2.1, math.pi]])
    # columns 4 and 24, rows 8 and 20: 20 columns, 12 rows, 20 columns along a slant, 4 columns
    np.testing.assert_allclose(cells.cast(poses, 8.0), [5.0, 3.0, 5.0 / math.cos(0.4), 1.0], rtol=1e-12)


def test_a_miss_is_the_maximum_exactly_and_a_start_on_a_wall_is_0() -> None:
    cells = Quantised(ROOM, 0.1)
    assert cells.cast(np.array([[3.0, 2.0, 0.3]]), 1.2345)[0] == 1.2345
    assert cells.cast(np.array([[-3.0, 2.0, math.pi]]), 9.9)[0] == 9.9
    assert cells.cast(np.array([[6.05, 2.0, 1.0]]), 9.9)[0] == 0.0
    assert Quantised(np.empty((0, 4)), 0.1).cast(np.array([[0.0, 0.0, 0.0]]), 2.0)[0] == 2.0


def test_a_wall_within_a_cell_is_invisible() -> None:
    wall = np.array([[1.01, -0.04, 1.01, 0.04]]) + 0.05  # both ends in one cell
    assert Quantised(wall, 0.1).cast(np.array([[0.05, 0.05, 0.0]]), 5.0)[0] == 5.0
    assert Quantised(wall, 0.01).cast(np.array([[0.05, 0.05, 0.0]]), 5.0)[0] == pytest.approx(1.01)


@pytest.mark.parametrize("shift", [0.0, -50.0])
def test_it_agrees_with_exact_geometry_within_cells(shift: float) -> None:
    world, resolution = load_world(shipped("worlds/building.world")), 0.02
    walls: FloatArray = world.segments + shift
    rng = np.random.default_rng(9)
    x0, y0, x1, y1 = np.array(world.bounds) + shift
    poses = rng.uniform([x0, y0, -math.pi], [x1, y1, math.pi], (3000, 3))
    scene = Scene(walls)
    met = [scene.cast_fan(pose, 0.0, 0.0, 1, 8.0) for pose in poses]
    exact, wall = np.concatenate([ranges for ranges, _ in met]), np.concatenate([walls for _, walls in met])
    hit = np.isfinite(exact)
    cells = Quantised(walls, resolution).cast(poses, 8.0)
    error = np.abs(cells - exact)[hit] / resolution
    along = np.arctan2(*(walls[wall[hit], 2:] - walls[wall[hit], :2]).T[::-1])
    across = np.abs(np.sin(poses[hit, 2] - along))
    assert np.median(error) <= 0.75
    # Seen at a grazing angle, a cell beside a wall is a long way before it: what counts is how far it is from the wall.
    assert np.percentile(error * across, 95) <= 1.5
    assert np.median(error) > 0.05  # cells it is, not exact geometry again


@pytest.mark.parametrize(
    ("walls", "resolution", "message"),
    [
        (ROOM, 0.0, "resolution must be positive, not 0"),
        (ROOM, math.nan, "resolution must be positive, not nan"),
        (ROOM, 1e-6, "cells are more than 1e9"),
        (ROOM, 1e-300, "more than 1e9 cells away"),
        (np.full((1, 4), math.nan), 0.1, "wall 0 is not finite"),
        (np.zeros((1, 3)), 0.1, r"\(m, 4\)"),
    ],
)
def test_bad_walls(walls: FloatArray, resolution: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Quantised(walls, resolution)


@pytest.mark.parametrize(
    ("pose", "range_max", "message"),
    [
        ([math.nan, 0, 0], 1.0, "a pose is not finite"),
        ([0, 0, math.inf], 1.0, "a pose is not finite"),
        ([1e300, 0, 0], 1.0, "a pose is not finite, or more"),
        ([0, 0, 0], 0.0, "range_max must be positive"),
        ([0, 0, 0], math.inf, "range_max must be positive and finite"),
        ([0, 0], 1.0, r"\(n, 3\)"),
    ],
)
def test_bad_rays(pose: list[float], range_max: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Quantised(ROOM, 0.1).cast(np.array([pose]), range_max)

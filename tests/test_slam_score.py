# SPDX-License-Identifier: BSD-3-Clause
"""Scores of maps and trajectories against known answers and scipy's own fit of a rotation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kurumaisu import geometry, slam_score
from kurumaisu.maps import Grid


def path(n, seed):
    rng = np.random.default_rng(seed)
    return np.column_stack([np.cumsum(rng.normal(0, 0.3, (n, 2)), axis=0), rng.uniform(-3, 3, n)])


def test_a_moved_copy_has_no_error():
    truth = path(50, 1)
    moved = geometry.compose(np.broadcast_to([3.0, -2.0, 2.5], truth.shape), truth)
    assert slam_score.trajectory_error(moved, truth) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_alignment_against_scipy():
    truth, estimate = path(40, 2), path(40, 2)
    estimate = geometry.compose(np.broadcast_to([1.0, 0.5, -0.7], truth.shape), estimate)
    estimate[:, :2] += np.random.default_rng(3).normal(0, 0.05, (40, 2))
    a = np.column_stack([truth[:, :2] - truth[:, :2].mean(axis=0), np.zeros(40)])
    b = np.column_stack([estimate[:, :2] - estimate[:, :2].mean(axis=0), np.zeros(40)])
    rotation, _ = Rotation.align_vectors(a, b)
    assert slam_score.align(estimate, truth)[2] == pytest.approx(rotation.as_euler("zyx")[0], abs=1e-9)


def test_a_known_error_is_measured():
    truth = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    estimate = truth + np.array([[0, 0.1, 0.02], [0, -0.1, 0.02], [0, -0.1, 0.02], [0, 0.1, 0.02]])
    assert slam_score.trajectory_error(estimate, truth) == pytest.approx((0.1, 0.02))


def test_distance_to_walls_by_hand():
    walls = np.array([[0.0, 0.0, 2.0, 0.0], [5.0, 5.0, 5.0, 5.0]])
    points = np.array([[1.0, 0.3], [-3.0, 4.0], [2.5, 0.0], [5.0, 4.9]])
    np.testing.assert_allclose(slam_score.distance_to_walls(points, walls), [0.3, 5.0, 0.5, 0.1], atol=1e-12)


def test_map_error_of_a_map_turned_and_moved_in_the_world():
    """A wall of cells along x = 1.05 in the map; in the world it lies along y = 3.05, the true wall along y = 3."""
    cells = np.zeros((10, 30), dtype=np.int8)
    cells[:, 10] = 100
    cells[0, 0] = -1
    grid = Grid(cells, 0.1, 0.0, 0.0)
    error = slam_score.map_error(grid, np.array([5.0, 2.0, np.pi / 2]), np.array([[0.0, 3.0, 9.0, 3.0]]))
    np.testing.assert_allclose(error, np.full(10, 0.05), atol=1e-9)

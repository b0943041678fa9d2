# SPDX-License-Identifier: BSD-3-Clause
"""How good a map and a trajectory are, against the truth."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.maps import Grid
from kurumaisu.types import FloatArray

_WALL = 65  # [%] occupancy from which a cell counts as wall, as in map_server


def align(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """Return truth_from_estimate (3,), the rigid motion that fits positions (n, 3) to the truth (n, 3) best."""
    a, b = estimate[:, :2] - estimate[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    angle = np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
    c, s = np.cos(angle), np.sin(angle)
    shift = truth[:, :2].mean(axis=0) - np.array([[c, -s], [s, c]]) @ estimate[:, :2].mean(axis=0)
    return np.array([*shift, angle])


def trajectory_error(estimate: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Return the root mean square errors of position [m] and heading [rad] of poses (n, 3) after alignment."""
    aligned = geometry.compose(np.broadcast_to(align(estimate, truth), estimate.shape), estimate)
    position = np.sqrt(np.mean(np.sum((aligned - truth)[:, :2] ** 2, axis=1)))
    heading = np.sqrt(np.mean(geometry.wrap((aligned - truth)[:, 2]) ** 2))
    return float(position), float(heading)


def map_error(grid: Grid, world_from_map: FloatArray, segments: FloatArray) -> FloatArray:
    """Return the distance [m] of every wall cell of a map to the nearest of the true walls (m, 4) of the world."""
    rows, columns = np.nonzero(grid.cells > _WALL)
    x, y = grid.x + (columns + 0.5) * grid.resolution, grid.y + (rows + 0.5) * grid.resolution
    centres = np.column_stack([x, y, np.zeros(len(x))])
    in_world = geometry.compose(np.broadcast_to(world_from_map, centres.shape), centres)
    return distance_to_walls(in_world[:, :2], segments)


def distance_to_walls(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Return the distance [m] of points (n, 2) to the nearest of segments (m, 4), (n,)."""
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-12)
    offset = points[:, None, :] - start
    share = np.clip(np.sum(offset * along, axis=2) / length2, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1))

# SPDX-License-Identifier: BSD-3-Clause
"""Conservative advancement against dense sampling, and its refusals."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from kurumaisu._core import Clearance, arcs
from kurumaisu.types import FloatArray

NEAR = 1e-3  # [m] counts as touching
LIMIT = 1.0  # [s]


def ring(rng: np.random.Generator) -> FloatArray:
    """Return the edges of a random quadrilateral about the origin, from the floor to 1 m."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, 4))
    corners = rng.uniform(0.1, 0.6, 4)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([corners, np.roll(corners, -1, axis=0), np.tile([0.0, 1.0], (4, 1))], axis=1)


def at(edges: FloatArray, pose: FloatArray) -> FloatArray:
    c, s = np.cos(pose[3]), np.sin(pose[3])
    return np.asarray((edges[:, :4].reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + pose[:2]).reshape(-1, 4))


def gap(a: FloatArray, b: FloatArray) -> float:
    """Return the smallest distance from an end of one set of segments (n, 4) to a segment of the other."""
    found = []
    for points, edges in ((a, b), (b, a)):
        p = points.reshape(-1, 1, 2)
        start, along = edges[None, :, :2], edges[None, :, 2:] - edges[None, :, :2]
        share = np.clip(((p - start) * along).sum(-1) / (along**2).sum(-1), 0, 1)
        found.append(np.linalg.norm(p - start - share[..., None] * along, axis=-1).min())
    return float(min(found))


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6))
@example(seed=539041)  # begins within NEAR and opens
def test_touches_are_found_in_time_and_not_before(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wall = np.array([[*rng.uniform(-3, 3, 4), 0.0, 1.0]])
    rings = [ring(rng), ring(rng)]
    poses = np.array([[*rng.uniform(-2, 2, 2), 0.0, rng.uniform(-3, 3)] for _ in rings])
    twists = rng.uniform(-2, 2, (2, 3)) * [1, 1, 3]
    clearance = Clearance(wall, np.array([9]))
    bodies = np.array([clearance.add_body(edges, tree) for tree, edges in enumerate(rings)])
    times, _ = clearance.free_times(bodies, poses, twists, LIMIT, NEAR)

    def gaps(time: float) -> list[float]:
        now = [at(edges, pose) for edges, pose in zip(rings, arcs(poses, twists, time), strict=True)]
        both = gap(*now)
        return [min(both, gap(own, wall[:, :4])) for own in now]

    for body, time in enumerate(times):
        before = [gaps(t)[body] for t in np.linspace(0, float(time), 60)]
        assert min(before) >= min(NEAR, before[0]) * (1 - 1e-6)  # what is near at the start may go away from it
        if 0 < time < LIMIT:
            assert before[-1] <= NEAR * 1.02


def test_heights_and_trees_part_bodies_from_walls() -> None:
    edges = np.array([[0.1, -0.1, 0.1, 0.1, 0.0, 1.0]])
    walls = np.array([[1.0, -1.0, 1.0, 1.0, 1.0, 2.0]])
    ahead = np.array([[2.0, 0.0, 0.0]])
    for height, tree, time in [(0.0, 1, LIMIT), (0.5, 1, 0.45), (0.5, 7, LIMIT)]:
        clearance = Clearance(walls, np.array([7]))
        body = np.array([clearance.add_body(edges, tree)])
        times, pairs = clearance.free_times(body, np.array([[0, 0, height, 0.0]]), ahead, LIMIT, 1e-9)
        assert times[0] == pytest.approx(time, abs=1e-6)
        assert pairs.shape == (0, 2)


def test_near_finds_what_a_search_through_all_finds() -> None:
    rng = np.random.default_rng(5)
    ends = rng.uniform(-20, 20, (300, 2))
    walls = np.concatenate([ends, ends + rng.uniform(-8, 8, (300, 2)), np.tile([0.0, 1.0], (300, 1))], axis=1)
    clearance = Clearance(walls, np.zeros(300, dtype=np.int64))
    body = np.array([clearance.add_body(np.empty((0, 6)), 1)])
    for _ in range(50):
        place, reach = rng.uniform(-22, 22, 2), rng.uniform(0, 3)
        point = np.array([[*place, *place]])
        everyone = [i for i in range(300) if gap_to(point, walls[i : i + 1, :4]) <= reach]
        assert clearance.near(body, np.array([[*place, 0.0, 0.0]]), reach) == everyone


def gap_to(point: FloatArray, edge: FloatArray) -> float:
    along = edge[0, 2:] - edge[0, :2]
    share = np.clip((point[0, :2] - edge[0, :2]) @ along / (along @ along), 0, 1)
    return float(np.hypot(*(point[0, :2] - edge[0, :2] - share * along)))


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="must have 6 columns"):
        Clearance(np.zeros((1, 4)), np.zeros(1, np.int64))
    with pytest.raises((ValueError, IndexError)):
        Clearance(np.zeros((2, 6)), np.zeros(1, np.int64))
    clearance = Clearance(np.empty((0, 6)), np.empty(0, np.int64))
    with pytest.raises(IndexError):
        clearance.near(np.array([0]), np.zeros((1, 4)), 1.0)
    with pytest.raises(ValueError, match="poses must have 4 columns and a row for each body"):
        clearance.near(np.array([0]), np.zeros((2, 4)), 1.0)
    with pytest.raises(ValueError, match="edges must be finite"):
        clearance.add_body(np.full((1, 6), np.nan), 0)

# SPDX-License-Identifier: BSD-3-Clause
"""The ray caster's Python face against an oracle in numpy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kurumaisu._core import Scene
from kurumaisu.geometry import compose
from kurumaisu.params import load_model, shipped
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

ROOM = np.array([[0, 0, 6, 0], [6, 0, 6, 5], [6, 5, 0, 5], [0, 5, 0, 0]], dtype=float)


def brute_force(segments: FloatArray, poses: FloatArray, angles: FloatArray) -> FloatArray:
    """Every ray against every segment, solving o + t d = a + f (b - a) as a 2 x 2 system."""
    d = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
    e = (segments[:, 2:] - segments[:, :2])[None]
    to_a = segments[None, :, :2] - poses[:, None, :2]
    cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_a[..., 0] * e[..., 1] - to_a[..., 1] * e[..., 0]) / cross
        f = (to_a[..., 0] * d[..., 1] - to_a[..., 1] * d[..., 0]) / cross
    return np.where((t >= 0) & (f >= 0) & (f <= 1) & (cross != 0), t, np.inf).min(axis=1)


def agree(cast: FloatArray, oracle: FloatArray, segments: FloatArray, poses: FloatArray) -> bool:
    """Equal to rounding, except where a ray grazes an end of a segment or starts on one: both are right."""
    same = np.isclose(cast, oracle, rtol=1e-9, atol=1e-9) | (np.isinf(cast) & np.isinf(oracle))
    ends = segments.reshape(-1, 2)
    for i in np.flatnonzero(~same):
        offset = ends - poses[i, :2]
        across = np.cos(poses[i, 2]) * offset[:, 1] - np.sin(poses[i, 2]) * offset[:, 0]
        if np.abs(across).min() > 1e-9 and distance(segments, poses[i, :2]) > 1e-9:
            return False
    return True


def distance(segments: FloatArray, point: FloatArray) -> float:
    a, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip(((point - a) * along).sum(axis=1) / squared, 0, 1)
    return float(np.hypot(*(a + part[:, None] * along - point).T).min())


coordinates = st.floats(-10, 10, allow_nan=False).map(lambda x: round(x, 3))


@settings(max_examples=300)
@given(
    segments=st.integers(1, 30).flatmap(lambda m: arrays(np.float64, (m, 4), elements=coordinates)),
    poses=st.integers(1, 20).flatmap(lambda n: arrays(np.float64, (n, 3), elements=coordinates)),
)
def test_any_segments_agree_with_brute_force(segments: FloatArray, poses: FloatArray) -> None:
    cast = Scene(segments).cast(poses, np.zeros(len(poses)), math.inf)
    assert agree(cast, brute_force(segments, poses, poses[:, 2]), segments, poses)


@pytest.mark.parametrize("name", ["room", "building"])
def test_shipped_worlds_agree_with_brute_force(name: str) -> None:
    world = load_world(shipped(f"worlds/{name}.world"))
    x0, y0, x1, y1 = world.bounds
    rng = np.random.default_rng(3)
    poses = rng.uniform([x0, y0, -np.pi], [x1, y1, np.pi], (20_000, 3))
    cast = Scene(world.segments).cast(poses, np.zeros(len(poses)), math.inf)
    assert agree(cast, brute_force(world.segments, poses, poses[:, 2]), world.segments, poses)
    assert np.isfinite(cast).all()  # the outer walls leave no gap


def test_flat_wall_at_known_distance() -> None:
    bearings = load_model(shipped("launch/md100.yaml")).laser.bearings
    ahead = bearings[np.abs(bearings) < 1.4]
    cast = Scene(np.array([[1.0, -20.0, 1.0, 20.0]])).cast(np.zeros(3), ahead, math.inf)
    np.testing.assert_allclose(cast, 1 / np.cos(ahead), rtol=1e-12)


@pytest.mark.parametrize("max_range", [5.6, math.inf])
def test_a_fan_is_its_beams(max_range: float) -> None:
    world = load_world(shipped("worlds/building.world"))
    scene = Scene(world.segments)
    x0, y0, x1, y1 = world.bounds
    rng = np.random.default_rng(6)
    for pose in rng.uniform([x0, y0, -np.pi], [x1, y1, np.pi], (50, 3)):
        first, increment, samples = rng.uniform(-3, 3), rng.uniform(-0.1, 0.1), int(rng.integers(1, 700))
        bearings = first + increment * np.arange(samples)
        ranges, segments = scene.cast_fan(pose, first, increment, samples, max_range)
        np.testing.assert_allclose(ranges, scene.cast(pose, bearings, max_range), rtol=1e-12, atol=1e-12)
        assert ((segments == -1) == np.isinf(ranges)).all()
        for i in np.flatnonzero(segments >= 0):
            alone = Scene(world.segments[segments[i] : segments[i] + 1])
            assert math.isclose(alone.cast(pose, bearings[i : i + 1], math.inf)[0], ranges[i], abs_tol=1e-9)


def test_a_fan_of_nothing() -> None:
    ranges, segments = Scene(ROOM).cast_fan(np.array([3.0, 2.5, 0.0]), 0.0, 0.1, 0, 1.0)
    assert ranges.shape == segments.shape == (0,)
    ranges, segments = Scene(ROOM).cast_fan(np.array([3.0, math.nan, 0.0]), 0.0, 0.1, 3, 1.0)
    assert np.isinf(ranges).all()
    assert (segments == -1).all()


@pytest.mark.parametrize("max_range", [-1.0, math.nan])
def test_a_bad_fan(max_range: float) -> None:
    with pytest.raises(ValueError, match="max_range"):
        Scene(ROOM).cast_fan(np.zeros(3), 0.0, 0.1, 3, max_range)


def test_every_beam_from_its_own_pose() -> None:
    poses = np.stack([np.linspace(1, 4, 50), np.full(50, 2.0), np.linspace(0, 0.3, 50)], axis=-1)
    cast = Scene(ROOM).cast(poses, -poses[:, 2], math.inf)
    np.testing.assert_allclose(cast, 6 - poses[:, 0], rtol=1e-14)


def test_turning_the_world_changes_no_range() -> None:
    rng = np.random.default_rng(4)
    poses = rng.uniform([0.1, 0.1, -3], [5.9, 4.9, 3], (500, 3))
    frame = np.array([3.0, -7.0, 1.1])
    corners = np.concatenate([ROOM.reshape(-1, 2), np.zeros((8, 1))], axis=-1)
    turned = compose(frame, corners)[:, :2].reshape(-1, 4)
    bearings = rng.uniform(-3, 3, 500)
    np.testing.assert_allclose(
        Scene(turned).cast(compose(frame, poses), bearings, math.inf),
        Scene(ROOM).cast(poses, bearings, math.inf),
        rtol=1e-12,
    )


def test_nothing_within_reach() -> None:
    scene = Scene(ROOM)
    inside = np.array([3.0, 2.5, 0.0])
    assert scene.cast(inside, np.zeros(1), 2.999)[0] == math.inf
    assert scene.cast(inside, np.zeros(1), 3.0)[0] == 3.0
    assert Scene(np.empty((0, 4))).cast(inside, np.zeros(1), math.inf)[0] == math.inf
    assert len(scene) == 4


@pytest.mark.parametrize(
    ("segments", "message"),
    [(np.zeros((3, 3)), r"\(m, 4\)"), (np.zeros(4), r"\(m, 4\)"), (np.full((2, 4), np.nan), "segment 0")],
)
def test_bad_segments(segments: FloatArray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Scene(segments)


@pytest.mark.parametrize(
    ("poses", "bearings", "max_range"),
    [
        (np.zeros((3, 3)), np.zeros(4), 1.0),
        (np.zeros(2), np.zeros(4), 1.0),
        (np.zeros((2, 3)), np.zeros((2, 1)), 1.0),
        (np.zeros(3), np.zeros(4), -1.0),
        (np.zeros(3), np.zeros(4), math.nan),
    ],
)
def test_bad_beams(poses: FloatArray, bearings: FloatArray, max_range: float) -> None:
    with pytest.raises(ValueError, match="must"):
        Scene(ROOM).cast(poses, bearings, max_range)

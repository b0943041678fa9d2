# SPDX-License-Identifier: BSD-3-Clause
"""Bumpers and fiducial finders against geometry, and against their rules written out one by one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensing import BruteRays, make_model, rectangle

from kurumaisu.geometry import wrap
from kurumaisu.sim.sensors.bumper import BumperSensor, BumperSettings
from kurumaisu.sim.sensors.fiducial import FiducialFinder, Sightings
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Bumper, Fiducial, Model

HERE = np.array([[0.0, 0, 0, 0]])
ME = np.array([0])
# Front, left and rear of a robot of 0.6 x 0.4 m.
STRIPS = Bumper(
    poses=np.array([[0.3, 0, 0.1, 0], [0, 0.2, 0.1, math.pi / 2], [-0.3, 0, 0.1, math.pi]]),
    lengths=np.array([0.4, 0.6, 0.4]),
)


def wall(ax: float, ay: float, bx: float, by: float) -> BruteRays:
    return BruteRays(np.array([[ax, ay, bx, by, 0, 1.0]]))


@pytest.mark.parametrize(
    ("walls", "expected"),
    [
        (wall(0.2, 0.0, 0.4, 0.01), [True, False, False]),
        (wall(-0.2, 0.1, 0.1, 0.5), [False, True, False]),
        (wall(-0.5, 0.19, 0.5, 0.19), [True, False, True]),
        (wall(0.301, -1, 0.301, 1), [False, False, False]),
        (wall(0.2, -1, 0.2, 1), [False, True, False]),
        (wall(0.2, 0.21, 0.4, 0.21), [False, False, False]),
    ],
)
def test_a_strip_feels_what_crosses_its_line(walls: BruteRays, expected: list[bool]) -> None:
    assert BumperSensor(BumperSettings(STRIPS, 0.0)).read(walls, HERE, ME).tolist() == [expected]


def test_a_strip_with_travel_feels_ahead() -> None:
    sensor = BumperSensor(BumperSettings(STRIPS, 0.02))
    assert sensor.read(wall(0.315, -1, 0.315, 1), HERE, ME).tolist() == [[True, False, False]]
    assert sensor.read(wall(0.325, -1, 0.325, 1), HERE, ME).tolist() == [[False, False, False]]
    assert sensor.read(wall(0.31, 0.005, 0.31, -0.005), HERE, ME).tolist() == [[True, False, False]]  # on its middle


def test_bumpers_of_turned_robots_do_not_feel_their_own_tree() -> None:
    walls = BruteRays(np.array([[0.9, 2.2, 1.1, 2.4, 0, 1.0]]), trees=np.array([1]))
    poses = np.array([[1.0, 2.0, 0, math.pi / 2]] * 2)
    assert BumperSensor(BumperSettings(STRIPS, 0.0)).read(walls, poses, np.array([0, 1])).tolist() == [
        [True, False, False],
        [False, False, False],
    ]


def test_no_strips() -> None:
    none = Bumper(np.empty((0, 4)), np.empty(0))
    assert BumperSensor(BumperSettings(none, 0.0)).read(wall(0, 0, 1, 1), HERE, ME).shape == (1, 0)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), heading=st.floats(-4, 4), ends=st.tuples(*[st.floats(-1, 1)] * 4))
@settings(max_examples=200)
def test_any_segment_against_signed_areas(x: float, y: float, heading: float, ends: tuple[float, ...]) -> None:
    """Two segments cross if the ends of each are on different sides of the other."""
    pose = np.array([[x, y, 0.0, heading]])
    felt = BumperSensor(BumperSettings(STRIPS, 0.0)).read(wall(*ends), pose, ME)[0]
    c, s = math.cos(heading), math.sin(heading)
    a, b = np.array(ends[:2]), np.array(ends[2:])
    for strip, length, answer in zip(STRIPS.poses, STRIPS.lengths, felt, strict=True):
        along = np.array([-math.sin(strip[3]), math.cos(strip[3])]) * length / 2
        p, q = (np.array([[c, -s], [s, c]]) @ (strip[:2] + k * along) + [x, y] for k in (-1, 1))
        sides = [_area(p, q, a), _area(p, q, b), _area(a, b, p), _area(a, b, q)]
        if min(map(abs, sides)) > 1e-9:
            assert answer == (sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0)


def _area(p: FloatArray, q: FloatArray, r: FloatArray) -> float:
    return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))


def world_walls(models: list[Model], poses: FloatArray) -> BruteRays:
    rows, trees = [], []
    for model, pose in zip(models, poses, strict=True):
        c, s = math.cos(pose[3]), math.sin(pose[3])
        ends = model.shape.segments.reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + pose[:2]
        rows.append(np.hstack([ends.reshape(-1, 4), model.shape.heights + pose[2]]))
        trees += [model.root] * len(model.shape.segments)
    return BruteRays(np.concatenate([np.empty((0, 6)), *rows]), trees=np.array(trees))


FINDER = Fiducial(range_min=0.0, range_max=8.0, range_max_id=5.0, fov=math.pi, ignore_zloc=False, key=0)
BOX = rectangle(0.4, 0.4)


def find(models: list[Model], poses: list[list[float]], finder: Fiducial = FINDER) -> Sightings:
    at = np.array([[0.0, 0, 0.5, 0]])
    placed = np.array(poses, dtype=float)
    return FiducialFinder(finder, models).find(world_walls(models, placed), at, np.array([99]), placed)


def test_range_bearing_heading_and_id() -> None:
    models = [make_model(i, BOX, fiducial=(10 + i, 0)) for i in range(3)]
    seen = find(models, [[3, 4, 0, 2.0], [0.0, -5.5, 0, -3.0], [0, 7.9, 0, 0]])
    np.testing.assert_array_equal(seen.model, [0, 1, 2])
    np.testing.assert_array_equal(seen.finder, 0)
    np.testing.assert_array_equal(seen.id, [0, 0, 0])  # 5 m is not below 5 m
    np.testing.assert_allclose(seen.range, [5, 5.5, 7.9])
    np.testing.assert_allclose(seen.bearing, [math.atan2(4, 3), -math.pi / 2, math.pi / 2])
    np.testing.assert_allclose(seen.heading, [2.0, -3.0, 0.0])
    assert find(models[:1], [[3, 3.9, 0, 2.0]]).id.tolist() == [10]


@pytest.mark.parametrize(
    ("model", "pose"),
    [
        (make_model(0, BOX), [2, 0, 0, 0]),  # not marked
        (make_model(0, BOX, fiducial=(1, 7)), [2, 0, 0, 0]),  # another key
        (make_model(0, BOX, fiducial=(1, 0), root=99), [2, 0, 0, 0]),  # the finder's own tree
        (make_model(0, BOX, fiducial=(1, 0)), [8.0, 0, 0, 0]),  # not nearer than range_max
        (make_model(0, BOX, fiducial=(1, 0)), [-0.01, 3, 0, 0]),  # beside the field of view
        (make_model(0, BOX, (0.0, 0.4), fiducial=(1, 0)), [2, 0, 0, 0]),  # below the finder
        (make_model(0, fiducial=(1, 0)), [2, 0, 0, 0]),  # without a body
    ],
)
def test_not_seen(model: Model, pose: list[float]) -> None:
    assert len(find([model], [pose]).model) == 0


def test_hidden_behind_another() -> None:
    models = [make_model(0, BOX, fiducial=(1, 0)), make_model(1, BOX)]
    assert len(find(models, [[4, 0, 0, 0], [2, 0, 0, 0]]).model) == 0
    assert len(find(models, [[4, 0, 0, 0], [2, 0.3, 0, 0]]).model) == 1
    assert len(find(models, [[4, 0, 0, 0], [5, 0, 0, 0]]).model) == 1


def test_ignore_zloc_sees_what_is_lower_but_nothing_through_walls() -> None:
    ignoring = Fiducial(0.0, 8.0, 5.0, math.pi, True, 0)
    low = make_model(0, BOX, (0.0, 0.4), fiducial=(1, 0))
    assert find([low], [[2, 0, 0, 0]], ignoring).id.tolist() == [1]
    assert len(find([low, make_model(1, BOX)], [[2, 0, 0, 0], [5, 0, 0, 0]], ignoring).model) == 0


coordinate = st.integers(-900, 900).map(lambda cm: cm / 100)
targets = st.lists(st.tuples(coordinate, coordinate, st.floats(-3, 3), st.integers(0, 2)), max_size=8)


@given(targets=targets, heading=st.floats(-4, 4))
@settings(max_examples=60)
def test_any_field_of_boxes_by_the_rules_one_by_one(
    targets: list[tuple[float, float, float, int]], heading: float
) -> None:
    models = [make_model(i, BOX, fiducial=(t[3], 0)) for i, t in enumerate(targets)]
    poses = np.array([[x, y, 0, a] for x, y, a, _ in targets]).reshape(-1, 4)
    at = np.array([[0.0, 0, 0.5, heading]])
    seen = FiducialFinder(FINDER, models).find(world_walls(models, poses), at, np.array([99]), poses)
    expected = []
    for i, (x, y, _, mark) in enumerate(targets):
        ray = np.array([[0, 0, 0.5, math.atan2(y, x)]])
        alone = world_walls([models[i]], poses[i : i + 1]).cast(ray, np.array([99]), 8.0)[0][0]
        everything = world_walls(models, poses).cast(ray, np.array([99]), 8.0)[0][0]
        ahead = abs(float(wrap(math.atan2(y, x) - heading))) <= math.pi / 2
        if mark and math.hypot(x, y) < 8 and ahead and alone <= min(everything + 1e-9, 8.0):
            expected.append(i)
    assert seen.model.tolist() == expected

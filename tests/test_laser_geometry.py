# SPDX-License-Identifier: BSD-3-Clause
"""Where tilted, late and displaced beams go, how they meet walls, and walls that are not where the map has them."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from kurumaisu import effects
from kurumaisu._core import Scene
from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.params import EffectSetting

N = 7
BEARINGS = np.linspace(-1.5, 1.5, N)
BEAM = [effect for effect in effects.LASER if issubclass(effect, effects.BeamEffect)]


def chain(name, **values):
    nulls = {p.name: p.null for p in effects.by_id(name).parameters}
    return effects.build_laser((EffectSetting(name, {**nulls, **values}),), np.random.default_rng(0))


def beams(stamp=10.0):
    return effects.Beams(stamp, stamp + 0.01 * np.arange(N), np.array([0.3, 0.1, 0.2]), 0.4, BEARINGS, np.zeros(N))


@pytest.mark.parametrize("effect", BEAM, ids=lambda effect: effect.id)
def test_null_geometry_is_absent(effect):
    out = chain(effect.id).aim(beams())
    for field in fields(out):
        np.testing.assert_allclose(getattr(out, field.name), getattr(beams(), field.name), atol=1e-15)


def test_geometry_at_chosen_values():
    np.testing.assert_allclose(chain("laser.mount_x", x=0.02).aim(beams()).mount, [0.32, 0.1, 0.2])
    np.testing.assert_allclose(chain("laser.mount_y", y=0.02).aim(beams()).mount, [0.3, 0.12, 0.2])
    np.testing.assert_allclose(chain("laser.mount_yaw", yaw=0.02).aim(beams()).mount, [0.3, 0.1, 0.22])
    i = np.arange(N)
    np.testing.assert_allclose(chain("laser.latency", delay=0.02).aim(beams()).times, 9.98 + 0.01 * i)
    np.testing.assert_allclose(chain("laser.clock_skew", skew=0.01).aim(beams()).times, (10 + 0.01 * i) / 1.01)
    in_a_run = replace(beams(), start=4.0)
    np.testing.assert_allclose(chain("laser.clock_skew", skew=0.01).aim(in_a_run).times, 4 + (6 + 0.01 * i) / 1.01)
    np.testing.assert_allclose(
        chain("laser.clock_skew", skew=0.01, through=1.0).aim(in_a_run).times, (10 + 0.01 * i) / 1.01
    )
    np.testing.assert_allclose(chain("laser.sweep", stretch=0.5).aim(beams()).times, 10 + 0.015 * i)
    np.testing.assert_allclose(chain("laser.sweep", stretch=-1.0).aim(beams()).times, 10.0)


@given(pitch=st.floats(-0.4, 0.4), roll=st.floats(-0.4, 0.4))
@settings(max_examples=50)
def test_tilted_beams_are_turned_directions(pitch, roll):
    """Against rotation matrices; and a wall or the floor is met where the ray in space meets it."""
    cp, sp, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    turn = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    x, y, z = turn @ np.array([np.cos(BEARINGS), np.sin(BEARINGS), np.zeros(N)])
    out = chain("laser.tilt", pitch=pitch, roll=roll).aim(beams())
    level = np.cos(out.elevations)
    turned = [level * np.cos(out.bearings), level * np.sin(out.bearings), np.sin(out.elevations)]
    np.testing.assert_allclose(turned, [x, y, z], atol=1e-12)
    away = np.where(x > 0, 2 * np.hypot(x, y) / np.maximum(x, 1e-9), np.inf)  # a wall at x = 2, on the level
    ranges = effects.slanted(away, out)
    with np.errstate(divide="ignore", over="ignore"):
        wall = np.where(x > 0, 2 / np.maximum(x, 1e-9), np.inf)
        floor = np.where(z < 0, -0.4 / z, np.inf)
    np.testing.assert_allclose(ranges, np.minimum(wall, floor), rtol=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50)
def test_incidence_is_the_angle_to_the_walls_normal(seed):
    """A triangle round the laser: the angle of each beam against each side's normal, by the side that it meets."""
    rng = np.random.default_rng(seed)
    corners = np.array([[np.cos(a), np.sin(a)] for a in np.array([0.3, 2.4, 4.5]) + rng.uniform(-0.3, 0.3, 3)]) * 3
    segments = np.hstack([corners, np.roll(corners, -1, axis=0)])
    pose, bearings = np.append(rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3)), np.linspace(-3, 3, 101)
    poses = compose(pose, np.zeros((101, 3)))
    scene = Scene(segments)

    def cast(poses, bearings):
        return scene.cast(poses, bearings, np.inf)

    ranges = cast(poses, bearings)
    angles = pose[2] + bearings
    ends = pose[:2] + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    sides = corners[[1, 2, 0]] - corners
    normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1) / np.linalg.norm(sides, axis=1)[:, None]
    apart = np.abs(((ends[:, None] - corners) * normals).sum(axis=2))
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cosines = np.abs(directions @ normals.T)[np.arange(101), apart.argmin(axis=1)]
    clear = np.sort(apart, axis=1)[:, 1] > 1e-4  # of corners
    found = effects.incidence(cast, poses, bearings, ranges)
    np.testing.assert_allclose(np.cos(found)[clear], cosines[clear], atol=1e-6)


def test_incidence_of_nothing_is_none():
    scene = Scene(np.array([[2.0, -1.0, 2.0, 1.0]]))
    found = effects.incidence(
        lambda poses, bearings: scene.cast(poses, bearings, np.inf),
        np.zeros((2, 3)),
        np.array([0.2, 2.0]),
        np.array([2 / np.cos(0.2), np.inf]),
    )
    np.testing.assert_allclose(found, [0.2, 0.0], atol=1e-6)


def walls(scale: float, sd: float) -> effects.WorldEffect:
    setting = EffectSetting("world.map_error", {"scale": scale, "sd": sd})
    return effects.build_world((setting,), np.random.default_rng(0))[0]


def test_walls_are_scaled_and_stay_closed():
    square = np.array([[0.0, 0, 2, 0], [2, 0, 2, 2], [2, 2, 0, 2], [0, 2, 0, 0]])
    np.testing.assert_allclose(walls(0.01, 0.0).apply(square), 1.01 * square)
    many = np.concatenate([square + 5.0 * k for k in range(500)])
    moved = walls(0.0, 0.01).apply(many).reshape(500, 4, 4)
    np.testing.assert_array_equal(moved[:, :, 2:], np.roll(moved[:, :, :2], -1, axis=1))
    shifts = (moved - many.reshape(500, 4, 4))[:, :, :2].ravel()
    assert stats.kstest(shifts / 0.01, "norm").pvalue > 1e-4
    np.testing.assert_array_equal(walls(0.0, 0.0).apply(many), many)
    with pytest.raises(Error, match=r"world\.map_error: sd must be 0 to 0\.2 m: -1"):
        walls(0.0, -1.0)

# SPDX-License-Identifier: BSD-3-Clause
"""Effects on where and when beams are fired, and on walls: the simulator against a ray caster of its own kind."""

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle_rays import Arc, Laser, Room, ray

from kurumaisu import effects
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

MODEL = load_model(shipped("launch/md100.yaml"))
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
ROOM = Room(-4.0, 5.0, -3.0, 6.0)
BEARINGS = [-2.086214 + 0.006135923 * i for i in range(682)]
DELAYS = [97.65625e-6 * i for i in range(682)]
SOME = range(0, 682, 11)  # beams that are compared
START = (0.5, 1.0, 0.4)


def drive(folder, name, values, v, w, seconds):
    """Return the scans of an exact laser on the arc, the first one from 0 on."""
    text = []
    for x, y, a, b in [(-4.5, 1.5, 1, 30), (5.5, 1.5, 1, 30), (0.5, -3.5, 30, 1), (0.5, 6.5, 30, 1)]:
        text.append(f"model ( pose [{x} {y} 0 0] size [{a} {b} 3] )")
    x, y, heading = START
    text.append(f"position ( pose [{x} {y} 0 {np.degrees(heading)!r}] )")
    (folder / "room.world").write_text("\n".join(text))
    law = type(MODEL.laser.error)(
        scale=1.0, datum_offset=0.0, sigma=[0.0] * 3, resolution=0.0, range_min=0.0, range_max=1e6
    )
    model = replace(
        MODEL, laser=replace(MODEL.laser, error=law), effects=(EffectSetting(name, values),) if name else ()
    )
    it = ChairSimulator(model, load_world(folder / "room.world"), DYNAMICS)
    it.reset(3)
    volts = float(model.translation.volts(v)), float(model.steering.volts(w))
    told = Command(*volts, float(np.sign(v)), float(np.sign(w)))
    seen = [it.step(told).scan for _ in range(round(seconds / it.step_time))]
    return [scan for scan in seen if scan is not None]


def compare(scans, room, laser, fired, v, w, rtol=2e-5):
    """Chords of 10 ms in place of arcs leave some micrometres."""
    assert len(scans) >= 3
    for k, scan in enumerate(scans[-3:], len(scans) - 3):
        truth = [ray(room, Arc(*START, v, w), laser, BEARINGS[i], fired(0.1 * k, DELAYS[i])) for i in SOME]
        np.testing.assert_allclose(scan.ranges[list(SOME)], truth, rtol=rtol)


def as_said(stamp, later):
    return stamp + later


V, W = 0.5, 0.7  # [m/s], [rad/s]
CASES = {
    "laser.mount_x": ({"x": 0.2}, ROOM, Laser(x=0.5), as_said),
    "laser.mount_y": ({"y": -0.15}, ROOM, Laser(y=-0.15), as_said),
    "laser.mount_yaw": ({"yaw": 0.2}, ROOM, Laser(yaw=0.2), as_said),
    "laser.tilt": ({"pitch": 0.1, "roll": -0.07}, ROOM, Laser(pitch=0.1, roll=-0.07), as_said),
    "laser.sweep": ({"stretch": 0.4}, ROOM, Laser(), lambda stamp, later: stamp + 1.4 * later),
    "laser.latency": ({"delay": 0.13}, ROOM, Laser(), lambda stamp, later: stamp + later - 0.13),
    "laser.clock_skew": ({"skew": 0.04}, ROOM, Laser(), lambda stamp, later: (stamp + later) / 1.04),
    "world.map_error": ({"scale": 0.05, "sd": 0.0}, ROOM.scaled(1.05), Laser(), as_said),
}
TESTED = list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_ranges_on_an_arc(tmp_path, name):
    values, room, laser, fired = CASES[name]
    compare(drive(tmp_path, name, values, V, W, 1.2), room, laser, fired, V, W)


@pytest.mark.parametrize("name", CASES)
def test_the_same_arc_without_it_is_another(tmp_path, name):
    """The null: what the comparison above must tell apart."""
    _, room, laser, fired = CASES[name]
    plain = drive(tmp_path, None, {}, V, W, 1.2)
    compare(plain, ROOM, Laser(), as_said, V, W)
    with pytest.raises(AssertionError, match="Not equal"):
        compare(plain, room, laser, fired, V, W)


@pytest.mark.parametrize(("pitch", "roll"), [(0.3, 0.0), (0.0, 0.3), (-0.2, 0.25)])
def test_a_tilted_laser_sees_the_floor(tmp_path, pitch, roll):
    laser = Laser(pitch=pitch, roll=roll)
    scans = drive(tmp_path, "laser.tilt", {"pitch": pitch, "roll": roll}, 0.0, 0.0, 0.5)
    compare(scans, ROOM, laser, as_said, 0.0, 0.0)
    level = [ray(ROOM, Arc(*START, 0.0, 0.0), Laser(), BEARINGS[i], 0.0) for i in SOME]
    assert (scans[-1].ranges[list(SOME)] < 0.8 * np.array(level)).any()


def test_corners_move_at_random_once_and_walls_stay_closed():
    """A street map of 60 x 60 squares: each corner belongs to up to four walls."""
    side = 60
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    corners = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    number = corners[:, 1] * side + corners[:, 0]
    east = corners[:, 0] < side - 1
    north = corners[:, 1] < side - 1
    walls = np.concatenate(
        [np.hstack([corners[east], corners[east] + [1, 0]]), np.hstack([corners[north], corners[north] + [0, 1]])]
    )
    scale, sd = 0.01, 0.03
    (effect,) = effects.build_world(
        (EffectSetting("world.map_error", {"scale": scale, "sd": sd}),), np.random.default_rng(5)
    )
    moved = effect.apply(walls)
    ends, was = moved.reshape(-1, 2), walls.reshape(-1, 2)
    first = {}
    for end, old in zip(ends, was, strict=True):
        known = first.setdefault(tuple(old), end)
        np.testing.assert_array_equal(end, known)  # where two walls met they still do
    assert len(first) == len(number)
    errors = np.array([first[tuple(old)] - 1.01 * old for old in corners])
    count = errors.size
    assert abs(errors.mean()) < 4 * sd / np.sqrt(count)
    assert errors.std() == pytest.approx(sd, rel=4 / np.sqrt(2 * count))
    for a, b in ((errors[:, 0], errors[:, 1]), (errors[:-1, 0], errors[1:, 0])):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4 / np.sqrt(count / 2)


def test_walls_are_met_at_the_angle_of_geometry(tmp_path):
    """An offset by the incidence, of which the simulator knows what two rays beside each beam tell."""
    scans = drive(tmp_path, "laser.incidence_bias", {"k": 0.05}, 0.0, 0.0, 0.5)
    x, y, heading = START
    expected, near_corner = [], []
    for bearing in (BEARINGS[i] for i in SOME):
        arc = Arc(*START, 0.0, 0.0)
        length = ray(ROOM, arc, Laser(), bearing, 0.0)
        turn = heading + bearing
        end = (
            x + 0.3 * math.cos(heading) + length * math.cos(turn),
            y + 0.3 * math.sin(heading) + length * math.sin(turn),
        )
        on_side = min(abs(end[0] - ROOM.east), abs(end[0] - ROOM.west)) < 1e-9
        along = abs(math.cos(turn)) if on_side else abs(math.sin(turn))
        expected.append(length + 0.05 * (min(1 / along, 1 / math.cos(math.radians(80))) - 1))
        near_corner.append(abs(ray(ROOM, arc, Laser(), bearing + 1e-5, 0.0) - length) > 1e-3)
    assert sum(near_corner) < 5
    keep = ~np.array(near_corner)
    np.testing.assert_allclose(scans[-1].ranges[list(SOME)][keep], np.array(expected)[keep], atol=1e-5)

# SPDX-License-Identifier: BSD-3-Clause
"""Bumpers, cameras and fiducial finders of the world file, and what is the same to the last bit."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sim_worlds import LASER, ROOM, drive, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.geometry import attached, wrap
from kurumaisu.params import shipped
from kurumaisu.settings import load
from kurumaisu.sim import Simulator
from kurumaisu.sim.options import read_options
from kurumaisu.sim.sensors.camera import CameraSensor, Scenery, mounted_eye, stage_eye
from kurumaisu.types import FloatArray

# Strips 0.01 m ahead of the robot's front and rear, 0.1 m above the ground
BUMPER = "bumper ( pose [0 0 -0.3 0] bcount 2 bpose[0] [0.21 0 0 0] bpose[1] [-0.21 0 0 180] blength 0.3 )"
FINDER = "fiducial ( range_max 4 range_max_id 3 fov 180 )"
CAMERA = "camera ( pose [0.1 0 0 90] resolution [8 6] range [0.2 8] fov [70 40] pantilt [10 0] )"


def build(folder: Path, text: str, *devices: str, **options: Any) -> Simulator:
    return simulator(folder, text, devices=devices, **options)


def test_bumpers_feel_what_is_before_them(tmp_path: Path) -> None:
    sim = build(tmp_path, robot(BUMPER, "4.76 0 0 0") + ROOM + robot(BUMPER, "0 0 0 0"), "bumper")
    first, second = (i for i, model in enumerate(sim.models) if model.type == "bumper")
    assert sim.observe().devices == {}  # nothing before the first update
    seen = drive(sim, (0, 0, 0), 1)[-1].devices
    assert seen[first].tolist() == [False, False]
    sim.set_pose(sim.robots[0], [4.785, 0, 0, 0])
    seen = drive(sim, (0, 0, 0), 1)[-1].devices
    assert seen[first].tolist() == [True, False]
    assert seen[second].tolist() == [False, False]
    sim.set_pose(sim.robots[1], [4.785 - 0.425, 0, 0, 0])  # behind the first one's rear
    seen = drive(sim, (0, 0, 0), 1)[-1].devices
    assert (seen[first].tolist(), seen[second].tolist()) == ([True, True], [True, False])


def test_a_bumper_feels_what_lasers_do_not_see(tmp_path: Path) -> None:
    wall = "model ( pose [0.265 0 0 0] size [0.1 1 1] ranger_return -1 )"
    sim = build(tmp_path, wall + robot(BUMPER), "bumper")
    assert next(iter(drive(sim, (0, 0, 0), 1)[-1].devices.values())).tolist() == [True, False]


def test_finders_see_marked_models(tmp_path: Path) -> None:
    marked = "model ( pose [2 1 0 90] size [0.3 0.3 2] fiducial_return 7 ) model ( pose [0 3.5 0 0] fiducial_return 8 )"
    sim = build(tmp_path, marked + robot(FINDER) + robot(FINDER + " fiducial_return 5", "1 -2 0 90"), "fiducial")
    seen = drive(sim, (0, 0, 0), 1)[-1].devices
    one, two = (seen[i] for i, model in enumerate(sim.models) if model.type == "fiducial")
    assert sorted(zip(one.model.tolist(), one.id.tolist(), strict=True)) == [(0, 7), (1, 0), (4, 5)]
    k = one.model.tolist().index(0)
    assert one.range[k] == pytest.approx(math.sqrt(5))
    assert (one.bearing[k], one.heading[k]) == pytest.approx((math.atan2(1, 2), math.pi / 2))
    assert (two.model.tolist(), two.id.tolist()) == ([0], [0])  # 3.2 m are too far to tell which it is
    assert two.range[0] == pytest.approx(math.sqrt(10))


def test_cameras_take_the_picture_of_the_camera_sensor(tmp_path: Path) -> None:
    text = ROOM + robot(CAMERA, "1 0 0 0")
    for semantics in ("stage", "physical"):
        sim = build(tmp_path, text, "camera", semantics=semantics)
        ((number, picture),) = drive(sim, (0, 0, 0.5), 3)[-1].devices.items()
        camera, poses = sim.models[number], sim.model_poses
        eyes = {
            "stage": stage_eye(camera.device, poses[camera.parent], poses[number]),  # type: ignore[arg-type]
            "physical": mounted_eye(camera.device, poses[number]),  # type: ignore[arg-type]
        }
        sensor = CameraSensor(camera.device)  # type: ignore[arg-type]
        expected = sensor.take(Scenery(sim.models), poses, eyes[semantics], camera.root)
        np.testing.assert_array_equal(picture.depth, expected.depth)
        np.testing.assert_array_equal(picture.rgba, expected.rgba)


def test_only_what_was_asked_for_is_read_when_it_is_due(tmp_path: Path) -> None:
    text = ROOM + robot(BUMPER + FINDER.replace("(", "( update_interval 300"))
    assert drive(build(tmp_path, text), (0, 0, 0), 3)[-1].devices == {}
    sim = build(tmp_path, text, "bumper", "fiducial")
    counts = [len(o.devices) for o in drive(sim, (0, 0, 0), 6)]
    assert counts == [1, 1, 2, 1, 1, 2]


def test_devices_change_no_state_and_come_and_go_with_models(tmp_path: Path) -> None:
    noisy = LASER.replace("fov 180", "fov 180 noise [0.01 0 0]")
    text = ROOM + robot('name "one"' + BUMPER + noisy)
    asked, silent = build(tmp_path, text, "bumper"), build(tmp_path, text)
    for one, two in zip(drive(asked, (0.4, 0, 0.1), 9), drive(silent, (0.4, 0, 0.1), 9), strict=True):
        np.testing.assert_array_equal(one.scans.ranges, two.scans.ranges)
    asked.spawn(robot(BUMPER), [0, 3, 0, 0])
    assert len(drive(asked, (0, 0, 0), 1)[-1].devices) == 2
    asked.delete("one")
    assert len(drive(asked, (0, 0, 0), 1)[-1].devices) == 1


def test_unknown_devices_are_named() -> None:
    values = load(shipped("launch/simulator.yaml"))
    values.take("devices")
    values._values["devices"] = ["nose"]
    with pytest.raises(Error, match=r"devices: must be a list of some of bumper, camera, fiducial: \['nose'\]"):
        read_options(values)


def test_headings_are_above_minus_pi_and_up_to_pi_as_in_stage(tmp_path: Path) -> None:
    text = robot('localization "odom" odom_error [0 0 0 0] localization_origin [0 0 0 0]', "0 0 0 180") + robot(
        "", "0 3 0 180"
    )
    for semantics in ("stage", "physical"):
        seen = drive(simulator(tmp_path, text, semantics=semantics), (0.1, 0, 0), 2)[-1]
        assert seen.poses[:, 3].tolist() == [math.pi] * 2
        assert seen.odometry[:, 2].tolist() == [math.pi] * 2


def test_angles_in_range_are_left_alone() -> None:
    angles = np.random.default_rng(1).uniform(-math.pi, math.pi, 1000)
    np.testing.assert_array_equal(wrap(angles), angles)
    np.testing.assert_allclose(wrap(angles + 6 * math.pi), angles, atol=1e-14)
    np.testing.assert_array_equal(wrap(np.array([math.pi, -math.pi, 0.0])), [math.pi, math.pi, 0.0])


def layouts(poses: FloatArray) -> list[FloatArray]:
    """The same values, here and there in memory."""
    wide = np.zeros((len(poses), 11))
    wide[:, 3:7] = poses
    return [poses, np.asfortranarray(poses), wide[:, 3:7], np.repeat(poses, 2, axis=0)[::2]]


def test_where_a_sensor_is_does_not_depend_on_the_layout_of_memory() -> None:
    poses = np.random.default_rng(2).uniform(-3, 3, (997, 4))
    mount = np.array([0.3, -0.2, 0.1, 0.7])
    first, *others = (attached(layout, mount) for layout in layouts(poses))
    for other in others:
        np.testing.assert_array_equal(first, other)
    for one in range(0, 997, 83):  # nor on how many there are
        np.testing.assert_array_equal(attached(poses[one : one + 1], mount)[0], first[one])

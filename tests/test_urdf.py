# SPDX-License-Identifier: BSD-3-Clause
"""The robot description: the model's footprint and mountings, in URDF that others' parsers take."""

import math
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kurumaisu import urdf
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.chair.body import outline

MODEL = load_model(shipped("launch/md100.yaml"))
IMU = ("imu_link", urdf.Pose((0.1, -0.2, 0.3), (math.pi, 0.0, 0.5)))


def numbers(element, key):
    return np.array([float(text) for text in element.get(key).split()])


def footprint(robot):
    """Return the corners (4, 2) of what collides, anticlockwise from the right rear."""
    collision = robot.find("link[@name='base_link']/collision")
    centre, size = numbers(collision.find("origin"), "xyz"), numbers(collision.find("geometry/box"), "size")
    assert np.array_equal(numbers(collision.find("origin"), "rpy"), np.zeros(3))
    assert centre[2] == size[2] / 2  # it stands on the floor
    return centre[:2] + size[:2] / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def test_what_collides_is_what_collides_in_the_simulator():
    corners = footprint(ElementTree.fromstring(urdf.robot_description(MODEL, "base_link")))
    ours = sorted(map(tuple, np.round(outline(MODEL.chassis), 9)))
    assert sorted(map(tuple, np.round(corners, 9))) == ours


def test_frames_are_where_they_are_mounted():
    robot = ElementTree.fromstring(urdf.robot_description(MODEL, "base_link", IMU))
    joints = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    assert set(joints) == {"laser", "imu_link"}
    assert {joint.find("parent").get("link") for joint in joints.values()} == {"base_link"}
    mount = MODEL.laser.mount
    assert numbers(joints["laser"].find("origin"), "xyz").tolist() == [mount.x, mount.y, mount.z]
    up = Rotation.from_euler("xyz", numbers(joints["imu_link"].find("origin"), "rpy")).apply([0, 0, 1])
    assert up == pytest.approx([0, 0, -1], abs=1e-5)  # z down, which the odometry asks tf for


def test_another_parser_takes_it(tmp_path):
    path = tmp_path / "chair.urdf"
    path.write_text(urdf.robot_description(MODEL, "base_link", IMU))
    result = subprocess.run(["check_urdf", path], capture_output=True, text=True, timeout=20, check=False)
    assert result.returncode == 0, result.stderr
    assert "root Link: base_link has 2 child(ren)" in result.stdout
    assert result.stderr == ""


@pytest.mark.parametrize("arguments", [[], ["model"], ["model", "base", "imu"], ["model", "base", "imu", "1 2 3"]])
def test_wrong_arguments_are_named(arguments, monkeypatch, capsys):
    model = [str(shipped("launch/md100.yaml")) if a == "model" else a for a in arguments]
    monkeypatch.setattr(sys, "argv", ["urdf", *model])
    with pytest.raises(SystemExit):
        urdf.main()
    error = capsys.readouterr().err
    assert ("BASE_FRAME" if len(arguments) < 2 else "X Y Z ROLL PITCH YAW") in error

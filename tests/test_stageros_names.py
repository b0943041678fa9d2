# SPDX-License-Identifier: BSD-3-Clause
"""What stageros calls things, against the table of stage_ros 1.8.0's mapName, and its settings."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.ros.stageros.names import names_of
from kurumaisu.ros.stageros.node import parse
from kurumaisu.ros.stageros.plan import plan_world
from kurumaisu.ros.stageros.settings import read_settings
from kurumaisu.world.model import Camera, Fan, Model, Place, Position, Ranger, Shape

PLACE = Place(Path("a.world"), 1, 1)
EMPTY = Shape(np.zeros((0, 4)), np.zeros((0, 2)), ())
BASE = Position("diff", "gps", None, None, np.zeros((4, 2)), None, 1.0, np.zeros(4))
CAMERA = Camera(32, 32, 1.2, 0.7, 0.2, 8.0, 0.0, 0.0)


def fan(samples=5, pose=(0, 0, 0, 0)):
    return Fan(np.array(pose, float), 0.02, 0.0, 5.0, math.pi, samples, np.zeros(3), PLACE)


def world(*robots):
    """robots: (name, devices); a device is a Ranger or a Camera, on a body 0.3 m high, at 0.1, 0.2, 0.05 m, 30 deg."""
    models = []
    for name, devices in robots:
        root = len(models)
        models.append(model(root, -1, root, name, BASE, (0, 0, 0, 0)))
        for device in devices:
            models.append(model(len(models), root, root, None, device, (0.1, 0.2, 0.05, math.radians(30))))
    return models


def model(index, parent, root, name, device, pose):
    return Model(
        *(index, parent, root, type(device).__name__.lower(), name, PLACE),
        *(np.array(pose, float), np.array([0.5, 0, 0, 0]), np.array([0.4, 0.4, 0.3]), (1, 0, 0, 1), EMPTY),
        *(True, 1.0, True, 0, 0, False, 0.0, None, 0.1, None, device),
    )


def settings(**values):
    return read_settings(values, "/stageros")


def plans_of(models, use_model_names=False, **values):
    read = settings(**values)
    return plan_world(models, names_of(models, read, use_model_names), read)


def names(models, use_model_names=False, **values):
    """Return (odom topic, odom frame, scan topics, scan frames) of each robot."""
    plans = plans_of(models, use_model_names, **values)
    return [
        (p.names.topic("odom"), p.names.frame("odom"), [s.topic for s in p.scans], [s.frame for s in p.scans])
        for p in plans
    ]


ONE = Ranger((fan(),))


def test_one_robot_has_relative_names():
    assert names(world((None, [ONE]))) == [("odom", "odom", ["base_scan"], ["base_laser_link"])]


def test_two_lasers_of_one_robot_have_absolute_numbered_names():
    assert names(world(("r", [ONE, ONE]))) == [
        ("odom", "odom", ["/base_scan_0", "/base_scan_1"], ["/base_laser_link_0", "/base_laser_link_1"])
    ]


def test_several_robots_are_numbered():
    assert names(world(("a", [ONE]), (None, []), ("b", [ONE, ONE]))) == [
        ("/robot_0/odom", "/robot_0/odom", ["/robot_0/base_scan"], ["/robot_0/base_laser_link"]),
        ("/robot_1/odom", "/robot_1/odom", [], []),
        (
            *("/robot_2/odom", "/robot_2/odom", ["/robot_2/base_scan_0", "/robot_2/base_scan_1"]),
            ["/robot_2/base_laser_link_0", "/robot_2/base_laser_link_1"],
        ),
    ]


def test_model_names_where_there_are_some():
    assert [n[0] for n in names(world(("ann", []), (None, []), ("c:1", [])), use_model_names=True)] == [
        *("/ann/odom", "/robot_1/odom", "/robot_2/odom")
    ]
    assert names(world(("ann", [ONE])), use_model_names=True)[0][2:] == (["/ann/base_scan"], ["/ann/base_laser_link"])
    assert names(world((None, [ONE])), use_model_names=True)[0][0] == "/robot_0/odom"


def test_a_name_that_ros_does_not_take_is_refused_with_its_place():
    with pytest.raises(Error, match=r"a.world:1:1: .*'my robot'"):
        names(world(("my robot", [])), use_model_names=True)


def test_cameras_are_numbered_as_lasers_are():
    (one,) = plans_of(world((None, [CAMERA])))
    assert [c.frame for c in one.cameras] == ["camera"]
    first, second = plans_of(world((None, [CAMERA, ONE, CAMERA]), (None, [CAMERA])))
    assert [c.frame for c in first.cameras] == ["/robot_0/camera_0", "/robot_0/camera_1"]
    assert [c.number for c in (*first.cameras, *second.cameras)] == [0, 1, None]


def test_devices_on_a_device_do_not_count():
    models = world((None, [ONE]))
    models.append(model(2, 1, 0, None, ONE, (0, 0, 0, 0)))
    assert names(models)[0][2] == ["base_scan"]


def test_only_the_first_sensor_of_a_ranger_counts():
    ring = Ranger((fan(1), fan(1), fan(1)))
    (plan,) = plans_of(world((None, [ring, ONE])))
    assert [(s.topic, s.index) for s in plan.scans] == [("/base_scan_0", 0), ("/base_scan_1", 3)]


def test_all_sensors_are_where_their_beams_start():
    ring = Ranger((fan(1), fan(1, (0.2, 0.0, 0.01, math.pi / 2))))
    (plan,) = plans_of(world((None, [ring])), sensors="all")
    assert [(s.topic, s.index) for s in plan.scans] == [("/base_scan_0", 0), ("/base_scan_1", 1)]
    along = math.radians(30)  # the ranger's origin is 0.5 m ahead of its pose, the sensor 0.2 m ahead of that
    place = (0.1 + 0.7 * math.cos(along), 0.2 + 0.7 * math.sin(along), 0.3 + 0.05 + 0.01 + 0.01, along + math.pi / 2)
    assert plan.scans[1].mount == pytest.approx(place)


def test_stage_ros_frame_leaves_out_origin_and_sensor():
    (plan,) = plans_of(world((None, [Ranger((fan(5, (0.2, 0, 0, 0)),))])))
    assert plan.scans[0].mount == pytest.approx((0.1, 0.2, 0.35, math.radians(30)))


def test_a_ranger_without_sensor_has_a_frame_and_counts():
    (plan,) = plans_of(world((None, [Ranger(()), ONE])))
    assert [(s.topic, s.fan is None) for s in plan.scans] == [("/base_scan_0", True), ("/base_scan_1", False)]


def test_sonars_are_apart_when_asked():
    models = world((None, [Ranger((fan(1), fan(1))), ONE]))
    (plan,) = plans_of(models, sensors="all", sonar_as_range=True)
    assert [(s.topic, s.frame, s.is_range) for s in plan.scans] == [
        ("base_scan", "base_laser_link", False),
        ("/base_sonar_0", "/base_sonar_link_0", True),
        ("/base_sonar_1", "/base_sonar_link_1", True),
    ]


@pytest.mark.parametrize("names", [("r", "r"), ("robot_1", None)])
def test_two_robots_of_one_name_are_refused_with_both_places(names):
    with pytest.raises(Error, match=r"a\.world:1:1: with -u .* of the robot at a\.world:1:1: both are"):
        names_of(world(*((name, []) for name in names)), read_settings({}, "/stageros"), True)
    assert len(names_of(world(*((name, []) for name in names)), read_settings({}, "/stageros"), False)) == 2


def test_switches_of_names():
    two = world((None, [ONE]), (None, []))
    assert names(two, strip_leading_slash=True)[0][:2] == ("/robot_0/odom", "robot_0/odom")
    assert names(two, relative_topics=True)[0][:2] == ("robot_0/odom", "/robot_0/odom")
    assert names(two, robot_prefix="never")[0][0] == "odom"
    assert names(two, robot_prefix="never")[1][0] == "/robot_1/odom"
    assert names(world((None, [ONE])), robot_prefix="always")[0][0] == "/robot_0/odom"
    assert names(two, frame_base_laser_link="laser")[0][3] == ["/robot_0/laser"]
    with pytest.raises(Error, match="2 of 2"):
        names(world((None, [ONE]), (None, [ONE])), robot_prefix="never")


def test_shipped_settings_are_stage_ros():
    shipped_ones = settings()
    assert (shipped_ones.watchdog_timeout, shipped_ones.depth_canonical) == (0.2, True)
    assert set(shipped_ones.pose_variances) == {0.0}
    switches = (shipped_ones.strip_leading_slash, shipped_ones.set_child_frame_id, shipped_ones.all_sensors)
    assert not any(switches)


def test_every_shipped_key_can_be_given():
    tree = yaml.safe_load(shipped("launch/stageros.yaml").read_text())
    assert read_settings(tree, "/stageros") == settings()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"base_watchdog_timeout": "0.2"}, "base_watchdog_timeout: must be a number"),
        ({"is_depth_canonical": 1}, "is_depth_canonical: must be true or false: 1"),
        ({"simulator": {"semantics": "real"}}, "simulator.semantics: must be one of world, stage, physical: 'real'"),
        ({"simulator": {"semantic": "stage"}}, "simulator/semantic is not a parameter; did you mean semantics?"),
        ({"robot_prefix": "none"}, "robot_prefix: must be one of stage, always, never: 'none'"),
        ({"frame_odom": "/odom"}, "frame_odom: must not start with a slash"),
        ({"frame_odom": "base_link"}, "base_link"),
        ({"rates": {"odom": -1.0}}, "rates.odom"),
        ({"rates": {"odo": 1.0}}, "rates.odo: is not a known key"),
        ({"rates": 5}, "rates"),
        ({"fill_covariance": True, "pose_variances": [1.0]}, "pose_variances: must be a list of 6 numbers"),
        ({"pose_variances": [-1.0, 0, 0, 0, 0, 0]}, "must not be negative"),
        ({"seed": -1}, "seed"),
        ({"parameters": [1]}, "parameters: must be a mapping"),
    ],
)
def test_bad_values_are_refused(values, message):
    with pytest.raises(Error, match=message) as caught:
        settings(**values)
    assert "/stageros" in str(caught.value)


def test_a_key_nobody_reads_is_said_not_refused():
    """As stage_ros starts with it."""
    assert settings(base_watchdog_timout=1).unknown == (
        "/stageros/base_watchdog_timout is not a parameter; did you mean base_watchdog_timeout?",
    )


def test_covariance_is_filled_on_the_diagonal_only_when_asked():
    variances = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert settings(pose_variances=variances).pose_variances == (0.0,) * 6
    assert settings(fill_covariance=True, pose_variances=variances).pose_variances == tuple(variances)


def test_the_command_line():
    assert parse([]) is None
    assert parse(["-g", "a.world"]).headless
    assert parse(["a.world", "-g"]) is None  # the last one is the file
    both = parse(["-u", "-g", "a.world"])
    assert (both.headless, both.use_model_names, both.world) == (True, True, Path("a.world"))

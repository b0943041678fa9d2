# SPDX-License-Identifier: BSD-3-Clause
"""The viewer of a robot: what its topics say is laid where it belongs. No master: messages are handed over."""

import io
import json
import math
import threading
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseArray, PoseWithCovarianceStamped, Quaternion, TransformStamped
from nav_msgs.msg import OccupancyGrid
from PIL import Image
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from kurumaisu.params import load_model, shipped
from kurumaisu.ros.viewer import source
from kurumaisu.ros.viewer.maps import Maps
from kurumaisu.ros.viewer.robot import Robot
from kurumaisu.ros.viewer.topics import PlanarTransforms
from kurumaisu.viewer import Hub


@dataclass
class Wire:
    """A message as rospy.AnyMsg has it."""

    _buff: bytes
    _connection_header: dict[str, str]


class Topics:
    """Takes the place of the master: whoever subscribes is told what is published here."""

    def __init__(self) -> None:
        self._heard: dict[str, Any] = {}

    def clock(self, now: float) -> None:
        self.publish("/clock", Clock(rospy.Time.from_sec(now)))

    def subscriber(self, name: str, kind: type, callback: Any, **_: Any) -> Any:
        self._heard[name] = callback
        return self

    def unregister(self) -> None:
        pass

    def publish(self, name: str, message: Any, caller: str = "/somebody") -> None:
        packed = io.BytesIO()
        message.serialize(packed)
        self._heard[name](Wire(packed.getvalue(), {"callerid": caller}))

    def tf(self, parent: str, child: str, x: float, y: float, yaw: float) -> None:
        one = TransformStamped()
        one.header.frame_id, one.child_frame_id = parent, child
        one.transform.translation.x, one.transform.translation.y = x, y
        one.transform.rotation = turned(yaw)
        self.publish("/tf", TFMessage([one]), caller=f"/{parent}{child}")


@pytest.fixture
def topics(monkeypatch):
    one = Topics()
    monkeypatch.setattr(rospy, "Subscriber", one.subscriber)
    monkeypatch.setattr(rospy, "get_param", lambda name, _=None: name == "/use_sim_time")
    return one


def turned(yaw: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


class Shown:
    """Maps, or a robot, and what a page would be told of them."""

    def __init__(self, make: Any) -> None:
        self.hub = Hub()
        self._mailbox = self.hub.join(lambda: None)
        self.transforms = PlanarTransforms()
        self.what = make(self.hub, self.transforms)
        self.transforms.open()
        self.what.open()

    def news(self) -> dict[str, Any]:
        """Return what is new by kind; particles (n, 3)."""
        found: dict[str, Any] = {}
        for payload in self._mailbox.take():
            if isinstance(payload, bytes):
                found["particles"] = np.frombuffer(payload, "<f4", offset=8).reshape(-1, 3)
            else:
                content = json.loads(payload)
                found[content["type"]] = content
        return found


@pytest.fixture
def maps(topics):
    return Shown(lambda hub, transforms: Maps(hub, transforms, "map", "base_link"))


@pytest.fixture
def robot(topics):
    model = load_model(shipped("launch/md100.yaml"))
    return Shown(lambda hub, transforms: Robot(hub, model, transforms, ("map", "odom", "base_link")))


def belief(variances: dict[int, float]) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    covariance = [0.0] * 36
    for place, value in variances.items():
        covariance[place] = value
    message.pose.covariance = covariance
    return message


def grid(cells: list[list[int]], x: float, y: float, yaw: float) -> OccupancyGrid:
    message = OccupancyGrid()
    message.info.width, message.info.height, message.info.resolution = len(cells[0]) if cells else 0, len(cells), 0.5
    message.info.origin = Pose(Point(x, y, 0.0), turned(yaw))
    message.data = [value for row in cells for value in row]
    return message


def test_nothing_is_believed_before_tf_says_so(maps):
    assert maps.what.estimate(np.zeros(3)) is None
    assert "particles" not in maps.news()


def test_who_localises_is_in_the_map_of_the_world(topics, maps):
    topics.tf("map", "odom", 1.0, 2.0, math.pi / 2)
    topics.tf("odom", "base_link", 3.0, 0.0, 0.5)
    topics.publish("amcl_pose", belief({0: 0.04, 1: 0.01, 6: 0.01, 7: 0.09, 35: 0.02}))
    cloud = [(0.5, -1.0, 3.0), (2.0, 1.0, -2.0)]
    topics.publish("particlecloud", PoseArray(poses=[Pose(Point(x, y, 0.0), turned(yaw)) for x, y, yaw in cloud]))
    estimate = maps.what.estimate(np.array([9.0, 9.0, 9.0]))
    assert estimate.pose == pytest.approx((1.0, 5.0, math.pi / 2 + 0.5))  # whatever the truth is
    assert estimate.covariance == pytest.approx((0.04, 0.01, 0.09, 0.02))
    np.testing.assert_allclose(maps.news()["particles"], cloud, atol=1e-6)


def test_who_maps_from_nothing_says_no_covariance_and_begins_at_the_truth(topics, maps):
    topics.tf("map", "base_link", 0.0, 0.0, 0.0)
    truth = np.array([2.0, 1.0, math.pi / 2])
    estimate = maps.what.estimate(truth)
    assert estimate.covariance is None
    assert estimate.pose == pytest.approx(truth)
    topics.tf("map", "base_link", 1.0, 0.0, 0.0)
    topics.publish("map", grid([[0, 100]], -1.0, 0.0, 0.0))
    assert maps.what.estimate(np.array([8.0, 8.0, 0.0])).pose == pytest.approx((2.0, 2.0, math.pi / 2))
    assert maps.news()["map"]["origin"] == pytest.approx([2.0, 0.0, math.pi / 2])  # laid there with the pose


def test_a_map_is_a_picture_with_its_first_row_below(topics, maps):
    topics.tf("map", "base_link", 0.0, 0.0, 0.0)
    topics.publish("map", grid([[0, 100, -1], [-1, -1, 0]], -2.0, 3.0, 0.25))
    maps.what.estimate(None)
    said = maps.news()["map"]
    assert (said["width"], said["height"], said["resolution"]) == (3, 2, 0.5)
    assert said["origin"] == pytest.approx([-2.0, 3.0, 0.25])
    picture = np.asarray(Image.open(io.BytesIO(maps.hub.maps[said["number"]])))
    assert picture.tolist() == [[205, 205, 254], [254, 0, 205]]  # shades of map_saver


def test_an_empty_map_is_not_shown(topics, maps):
    topics.tf("map", "base_link", 0.0, 0.0, 0.0)
    topics.publish("map", grid([], 0.0, 0.0, 0.0))
    maps.what.estimate(None)
    assert "map" not in maps.news()


def test_frames_that_go_round_in_a_circle_are_no_pose(topics, maps):
    topics.tf("base_link", "odom", 0.0, 0.0, 0.0)
    topics.tf("odom", "base_link", 0.0, 0.0, 0.0)
    assert maps.what.estimate(None) is None


def scan(stamp: float, ranges: list[float], intensities: list[float]) -> LaserScan:
    message = LaserScan(angle_min=-1.0, angle_increment=0.5, range_min=0.1, range_max=4.0)
    message.header.stamp = rospy.Time.from_sec(stamp)
    message.ranges, message.intensities = ranges, intensities
    return message


def test_a_robot_is_where_tf_has_it_in_the_map_before_odometry(topics, robot):
    topics.clock(5.0)
    assert robot.what.moment() == ({"t": 5.0}, {})  # nobody knows
    topics.tf("odom", "base_link", 1.0, 0.0, 0.0)
    parts, _ = robot.what.moment()
    assert parts["poses"] == {"chair": pytest.approx((1.0, 0.0, 0.0))}
    topics.tf("map", "odom", 0.0, 2.0, 0.0)
    parts, _ = robot.what.moment()
    assert parts["poses"] == {"chair": pytest.approx((1.0, 2.0, 0.0))}
    (body,) = robot.news()["world"]["bodies"]
    assert (body["id"], body["movable"], body["drivable"]) == ("chair", False, True)


def test_a_scan_is_laid_where_the_laser_was_when_it_was_taken(topics, robot):
    model = load_model(shipped("launch/md100.yaml"))
    mount = model.laser.mount
    for now, x, yaw in ((10.0, 0.0, 3.0), (10.2, 0.4, -3.0 + 0.2)):  # over half a turn: it goes the short way
        topics.clock(now)
        topics.tf("odom", "base_link", x, 1.0, yaw)
        robot.what.moment()
    topics.publish("scan", scan(10.1, [1.0, float("nan"), 5.0], [7.0, 8.0, 9.0]))
    _, scans = robot.what.moment()
    fan = scans[0, 0]
    heading = (3.0 + 2 * math.pi - 2.8) / 2
    c, s = math.cos(heading), math.sin(heading)
    assert fan.pose[:2] == pytest.approx((0.2 + c * mount.x - s * mount.y, 1.0 + s * mount.x + c * mount.y))
    assert math.remainder(fan.pose[2] - heading - mount.yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_array_equal(fan.ranges, np.array([1.0, np.nan, 5.0], "f4"))
    np.testing.assert_array_equal(fan.intensities, np.array([7.0, 8.0, 9.0], "f4"))
    assert fan.error is None  # nobody knows how far the beams went
    assert robot.what.moment()[1] == {}  # it is shown once


def test_intensities_that_do_not_fit_are_left_out(topics, robot):
    topics.clock(1.0)
    topics.tf("odom", "base_link", 0.0, 0.0, 0.0)
    topics.publish("scan", scan(1.0, [1.0, 2.0], []))
    assert robot.what.moment()[1][0, 0].intensities is None


def test_a_clock_that_was_set_back_forgets_what_was(topics, robot):
    for now, x in ((10.0, 0.0), (11.0, 5.0), (2.0, 1.0)):
        topics.clock(now)
        topics.tf("odom", "base_link", x, 0.0, 0.0)
        robot.what.moment()
    mount = load_model(shipped("launch/md100.yaml")).laser.mount
    topics.publish("scan", scan(10.5, [1.0], []))
    assert robot.what.moment()[1][0, 0].pose[0] == pytest.approx(1.0 + mount.x)  # not between 0 and 5


def test_a_machine_so_busy_that_every_moment_is_late_does_not_end_the_viewer(monkeypatch):
    """Between two questions for the time, a second passes."""
    asked, watched, clock, slept = threading.Event(), threading.Event(), iter(range(100)), []

    def slow(seconds):
        slept.append(seconds)
        if len(slept) == 3:
            asked.set()

    monkeypatch.setattr(source, "time", SimpleNamespace(monotonic=lambda: float(next(clock)), sleep=slow))
    watched.set()
    source.RosSource.run(SimpleNamespace(_watched=watched, _open=True, _show=lambda: None), 20.0, asked)
    assert len(slept) == 3
    assert all(0 < seconds <= 0.1 for seconds in slept)

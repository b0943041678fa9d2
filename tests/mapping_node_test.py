#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""mapping_node as slam.launch starts it, in a room whose scans are computed here."""

from __future__ import annotations

import subprocess
import sys
import time
import unittest
from collections.abc import Callable

import numpy as np
import roslib.packages
import rospy
import rostest
import tf2_msgs.msg
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

from kurumaisu.geometry import between, compose, wrap

DEADLINE = 30.0  # [s] of the wall clock, for any one thing to happen
STEP = 0.1  # [s] between scans
BEAMS, ANGLE_MIN, INCREMENT = 682, -2.086214, 0.006135923
MOUNT = np.array([0.3, 0.05, 0.1])
# x0, y0, x1, y1 [m]: 10 x 8 m with a box and a screen
WALLS = np.array(
    [
        [-5, -4, 5, -4],
        [5, -4, 5, 4],
        [5, 4, -5, 4],
        [-5, 4, -5, -4],
        [2, 1, 3, 1],
        [3, 1, 3, 2.5],
        [3, 2.5, 2, 2.5],
        [2, 2.5, 2, 1],
        [-5, 1, -3, 1.5],
    ],
    dtype=float,
)


def truth(t: float) -> np.ndarray:
    """The chair's pose in the room: an oval in 40 s."""
    a = 2 * np.pi * t / 40
    return np.array([-0.5 + 2 * np.cos(a), -1.5 + 1.2 * np.sin(a), a + 1.6])


def scan_ranges(pose: np.ndarray) -> np.ndarray:
    """Distances to the nearest wall, (BEAMS,)."""
    laser = compose(pose, MOUNT)
    angles = laser[2] + ANGLE_MIN + INCREMENT * np.arange(BEAMS)
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    edge, d = WALLS[:, 2:] - WALLS[:, :2], WALLS[:, :2] - laser[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = c * edge[:, 1] - s * edge[:, 0]
        along = (d[:, 0] * edge[:, 1] - d[:, 1] * edge[:, 0]) / across
        part = (d[:, 0] * s - d[:, 1] * c) / across
    along[~((along > 0) & (part >= 0) & (part <= 1))] = np.inf
    ranges = along.min(axis=1)
    ranges[ranges > 5.6] = np.inf
    return ranges


def transform(parent: str, child: str, pose: np.ndarray, stamp: rospy.Time) -> TransformStamped:
    out = TransformStamped()
    out.header.stamp, out.header.frame_id, out.child_frame_id = stamp, parent, child
    out.transform.translation.x, out.transform.translation.y = pose[0], pose[1]
    out.transform.rotation.z, out.transform.rotation.w = np.sin(pose[2] / 2), np.cos(pose[2] / 2)
    return out


def pose_of(message: TransformStamped) -> np.ndarray:
    t, q = message.transform.translation, message.transform.rotation
    return np.array([t.x, t.y, 2 * np.arctan2(q.z, q.w)])


def wait_for(condition: Callable[[], bool], what: str) -> None:
    """Return when the condition holds; fail after DEADLINE."""
    end = time.monotonic() + DEADLINE
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"no {what} within {DEADLINE} s")
        time.sleep(0.01)


class MappingNode(unittest.TestCase):
    """What slam.launch has started; every test begins anew by setting the clock back."""

    begin = 10000.0  # [s] simulated time of a test's first scan; each test begins earlier than the last one

    @classmethod
    def setUpClass(cls) -> None:
        cls.clock = rospy.Publisher("clock", Clock, queue_size=100)
        cls.scan = rospy.Publisher("scan", LaserScan, queue_size=100)
        cls.tf = rospy.Publisher("tf", tf2_msgs.msg.TFMessage, queue_size=100)
        cls.static = tf2_ros.StaticTransformBroadcaster()
        cls.static.sendTransform(transform("base_link", "laser", MOUNT, rospy.Time(0)))
        for publisher in (cls.clock, cls.scan, cls.tf):
            wait_for(lambda p=publisher: p.get_num_connections() > 0, f"subscriber of {publisher.name}")

    def setUp(self) -> None:
        MappingNode.begin -= 1000
        self.maps: list[OccupancyGrid] = []
        self.map_from_odom: list[TransformStamped] = []
        self.odom = np.array([1.0, 2.0, 0.5])
        self.origin = compose(self.odom, between(truth(0), np.zeros(3)))  # map_from_room
        self.at(-1.0)
        self.subscribers = [
            rospy.Subscriber("map", OccupancyGrid, self.on_map),
            rospy.Subscriber("/tf", tf2_msgs.msg.TFMessage, self.on_tf),
        ]

    def tearDown(self) -> None:
        for subscriber in self.subscribers:
            subscriber.unregister()

    def on_map(self, message: OccupancyGrid) -> None:
        if abs(message.header.stamp.to_sec() - self.begin) < 500:  # not the latched one of the test before
            self.maps.append(message)

    def on_tf(self, message: tf2_msgs.msg.TFMessage) -> None:
        for t in message.transforms:
            if t.header.frame_id == "map" and abs(t.header.stamp.to_sec() - self.begin) < 500:
                self.map_from_odom.append(t)

    def at(self, t: float) -> rospy.Time:
        """Set the clock to a time of the test [s]."""
        stamp = rospy.Time.from_sec(self.begin + t)
        self.clock.publish(stamp)
        return stamp

    def step(self, t: float, *, with_tf: bool = True) -> None:
        """Publish odometry, which drives 4 % too far and turns 5 % too little, and a scan."""
        stamp = self.at(t)
        if with_tf:
            self.tf.publish([transform("odom", "base_link", self.odom, stamp)])
        message = LaserScan(
            angle_min=ANGLE_MIN,
            angle_increment=INCREMENT,
            angle_max=ANGLE_MIN + INCREMENT * (BEAMS - 1),
            range_min=0.06,
            range_max=5.6,
            ranges=1.004587 * scan_ranges(truth(t)) + 0.058826,  # equation (4), as the laser of the default model reads
        )
        message.header.stamp, message.header.frame_id = stamp, "laser"
        self.scan.publish(message)
        motion = between(truth(t), truth(t + STEP)) * [1.04, 1.04, 0.95]
        self.odom = compose(self.odom, motion)

    def drive(self, seconds: float) -> float:
        """Drive; return the time of the last scan. Paced by the wall clock, so that nothing is dropped."""
        times = np.arange(0, seconds, STEP)
        for t in times:
            self.step(float(t))
            time.sleep(0.015)
        return float(times[-1])

    def estimate(self, odom: np.ndarray) -> np.ndarray:
        return compose(pose_of(self.map_from_odom[-1]), odom)

    def test_1_map_and_pose(self) -> None:
        last = self.drive(20.0)
        odom_at_last = compose(self.odom, between(truth(last + STEP), truth(last)) * [1.04, 1.04, 0.95])
        expected = compose(self.origin, truth(last))

        def close() -> bool:
            if not self.map_from_odom:
                return False
            error = between(expected, self.estimate(odom_at_last))
            return bool(np.hypot(*error[:2]) < 0.05 and abs(wrap(error[2])) < 0.02)

        wait_for(close, f"map -> odom that puts the chair at {expected}")
        drift = between(expected, odom_at_last)
        assert np.hypot(*drift[:2]) > 0.1  # odometry alone would not do
        self.at(last + 0.5)
        wait_for(
            lambda: abs(self.map_from_odom[-1].header.stamp.to_sec() - self.begin - last - 0.6) < 1e-3,
            "map -> odom stamped transform_tolerance ahead",
        )
        self.check_map()

    def check_map(self) -> None:
        wait_for(lambda: bool(self.maps) and self.maps[-1].info.width > 180, "map of the whole room")
        grid = self.maps[-1]
        assert grid.header.frame_id == "map"
        assert abs(grid.info.resolution - 0.05) < 1e-6
        cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
        rows, columns = np.nonzero(cells > 65)
        corner = np.array([grid.info.origin.position.x, grid.info.origin.position.y])
        points = corner + (np.stack([columns, rows], axis=-1) + 0.5) * grid.info.resolution
        room_from_map = between(self.origin, np.zeros(3))
        room = compose(room_from_map, np.column_stack([points, np.zeros(len(points))]))[:, :2]
        edge = WALLS[:, 2:] - WALLS[:, :2]
        part = np.einsum("nwi,wi->nw", room[:, None] - WALLS[:, :2], edge) / (edge**2).sum(axis=1)
        foot = WALLS[:, :2] + np.clip(part, 0, 1)[..., None] * edge
        off = np.linalg.norm(room[:, None] - foot, axis=-1).min(axis=1)
        assert len(off) > 300
        assert (off < 0.1).mean() > 0.98, np.sort(off)[-20:]
        meta = rospy.wait_for_message("map_metadata", MapMetaData, DEADLINE)
        assert (meta.width, meta.height) == (grid.info.width, grid.info.height)
        rospy.wait_for_service("dynamic_map", DEADLINE)
        served = rospy.ServiceProxy("dynamic_map", GetMap)().map
        assert served.header.frame_id == "map"
        assert served.info.width >= grid.info.width

    def test_2_starts_afresh_when_the_clock_is_set_back(self) -> None:
        self.drive(1.0)
        self.at(1.0)
        wait_for(lambda: bool(self.maps), "a map of the new time")
        wait_for(lambda: bool(self.map_from_odom), "map -> odom of the new time")
        # This second's drift, not that of the 20 s before.
        np.testing.assert_allclose(pose_of(self.map_from_odom[-1]), np.zeros(3), atol=0.05)

    def test_3_scans_without_transforms_are_dropped_and_the_rest_mapped(self) -> None:
        self.step(0.0, with_tf=False)
        self.odom = np.array([1.0, 2.0, 0.5])
        self.origin = compose(self.odom, between(truth(STEP), np.zeros(3)))
        self.step(STEP)
        self.step(2 * STEP)
        wait_for(lambda: bool(self.maps), "a map from the scans that have transforms")
        assert self.maps[0].header.stamp.to_sec() - self.begin > STEP / 2

    def test_4_bad_configuration_stops_it(self) -> None:
        good = rospy.get_param("/mapping_node")
        node = roslib.packages.find_node("kurumaisu", "mapping_node")[0]
        for section, key, value, message in (
            ("mapper", "particles", 0, "/bad_mapping/mapper: particles: must be 1 to 10000: 0"),
            ("mapper", "partciles", 30, "/bad_mapping/mapper/partciles: is not a known key"),
            ("node", "map_frame", 3, "/bad_mapping/node/map_frame: must be a string"),
        ):
            bad = {name: dict(values) for name, values in good.items()}
            bad[section][key] = value
            rospy.set_param("/bad_mapping", bad)
            done = subprocess.run(
                [node, "__name:=bad_mapping"], capture_output=True, text=True, timeout=DEADLINE, check=False
            )
            rospy.delete_param("/bad_mapping")
            assert done.returncode == 1
            assert "[FATAL]" in done.stderr
            assert message in done.stderr


if __name__ == "__main__":
    rospy.init_node("mapping_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "mapping_node_test", MappingNode, sys.argv)

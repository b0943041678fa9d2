#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""localization_node as localization.launch starts it: AMCL's contract, and what may go wrong, in a room made here."""

from __future__ import annotations

import subprocess
import sys
import time
import unittest

import numpy as np
import roslib.packages
import rospy
import rostest
import tf2_msgs.msg
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import SetMap
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty

from kurumaisu.geometry import between, compose, wrap
from kurumaisu.ros.testing import Topic, deviation, pose_of, wait_for

DEADLINE = 40.0  # [s] of the wall clock
STEP = 0.1  # [s] between scans
BEAMS, ANGLE_MIN, INCREMENT = 682, -2.086214, 0.006135923
MOUNT = np.array([0.3, 0.05, 0.1])
EDGE, MARGIN = 0.05, 0.525  # [m] the walls lie in the middle of their cells
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


def truth(t):
    """The chair's pose in the room: an oval in 40 s."""
    a = 2 * np.pi * t / 40
    return np.array([-0.5 + 2 * np.cos(a), -1.5 + 1.2 * np.sin(a), a + 1.6])


def ranges_at(pose):
    """Return equation (4)'s mean readings, (BEAMS,), as the laser of the default model has them."""
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
    return 1.004587 * ranges + 0.058826


def room_map():
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = EDGE, 221, 181
    message.info.origin.position.x, message.info.origin.position.y = -5 - MARGIN, -4 - MARGIN
    message.info.origin.orientation.w = 1.0
    cells = np.zeros((181, 221), dtype=np.int8)
    for x0, y0, x1, y1 in WALLS:
        part = np.linspace(0, 1, 1000)
        x, y = x0 + (x1 - x0) * part, y0 + (y1 - y0) * part
        cells[((y + 4 + MARGIN) / EDGE).astype(int), ((x + 5 + MARGIN) / EDGE).astype(int)] = 100
    message.data = cells.ravel().tolist()
    return message


def transform(parent, child, pose, stamp):
    out = TransformStamped()
    out.header.stamp, out.header.frame_id, out.child_frame_id = stamp, parent, child
    out.transform.translation.x, out.transform.translation.y = pose[0], pose[1]
    out.transform.rotation.z, out.transform.rotation.w = np.sin(pose[2] / 2), np.cos(pose[2] / 2)
    return out


class LocalizationNode(unittest.TestCase):
    """Every test begins anew by setting the clock back."""

    begin = 20000.0  # [s] simulated time of a test's first scan

    @classmethod
    def setUpClass(cls):
        cls.clock = rospy.Publisher("clock", Clock, queue_size=100)
        cls.scan = rospy.Publisher("scan", LaserScan, queue_size=100)
        cls.tf = rospy.Publisher("tf", tf2_msgs.msg.TFMessage, queue_size=100)
        cls.map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        cls.initial = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=1)
        cls.static = tf2_ros.StaticTransformBroadcaster()
        cls.static.sendTransform(transform("base_link", "laser", MOUNT, rospy.Time(0)))
        cls.diagnostics = Topic("/diagnostics", DiagnosticArray)
        cls.poses = Topic("amcl_pose", PoseWithCovarianceStamped)
        cls.clouds = Topic("particlecloud", PoseArray)
        cls.transforms = Topic("/tf", tf2_msgs.msg.TFMessage)
        for publisher in (cls.clock, cls.scan, cls.tf, cls.map, cls.initial):
            wait_for(lambda p=publisher: p.get_num_connections() > 0, f"subscriber of {publisher.name}", DEADLINE)

    def setUp(self):
        LocalizationNode.begin -= 1000
        self.odom = np.array([1.0, 2.0, 0.5])
        self.at(-1.0)

    def at(self, t):
        stamp = rospy.Time.from_sec(self.begin + t)
        self.clock.publish(stamp)
        return stamp

    def step(self, t, *, with_tf=True, ranges=None):
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
            ranges=ranges_at(truth(t)) if ranges is None else ranges,
        )
        message.header.stamp, message.header.frame_id = stamp, "laser"
        self.scan.publish(message)
        self.odom = compose(self.odom, between(truth(t), truth(t + STEP)) * [1.04, 1.04, 0.95])

    def drive(self, seconds, first=0.0, **options):
        """Drive; return the time of the last scan. Paced by the wall clock, so that nothing is skipped."""
        times = first + np.arange(0, seconds, STEP)
        for t in times:
            self.step(float(t), **options)
            time.sleep(0.02)
        return float(times[-1])

    def of_this_test(self, messages):
        return [m for m in messages if abs(m.header.stamp.to_sec() - self.begin) < 500]

    def last_pose(self, t):
        """Return amcl_pose at least as late as a time of the test."""

        def found():
            late = [
                m for m in self.of_this_test(self.poses.messages) if m.header.stamp.to_sec() - self.begin > t - 0.01
            ]
            return late[-1] if late else None

        return wait_for(found, f"amcl_pose at {t} s", DEADLINE)

    def status(self):
        for array in reversed(self.diagnostics.messages):
            for status in array.status:
                if status.name == "localization_node: localization":
                    return status
        return None

    def wait_for_status(self, level, words):
        wait_for(
            lambda: self.status() and self.status().level == level and words in self.status().message,
            f"diagnostics of level {level} with {words!r}",
            DEADLINE,
        )

    def assert_close(self, message, distance=0.06, turn=0.03):
        error = pose_of(message) - truth(message.header.stamp.to_sec() - self.begin)
        assert np.hypot(*error[:2]) < distance, error
        assert abs(wrap(error[2])) < turn, error

    def test_1_without_a_map_it_says_so(self):
        self.wait_for_status(2, "LOCALIZATION_NO_MAP")
        self.map.publish(room_map())
        wait_for(lambda: "NO_MAP" not in self.status().message, "the map to be taken", DEADLINE)

    def test_2_follows_the_chair(self):
        last = self.drive(12.0)
        message = self.last_pose(last - 0.5)
        assert message.header.frame_id == "map"
        self.assert_close(message)
        assert deviation(message) < 0.2
        wait_for(lambda: self.of_this_test(self.clouds.messages), "particlecloud", DEADLINE)
        assert len(self.of_this_test(self.clouds.messages)[-1].poses) >= 100
        sent = [t for m in self.transforms.messages for t in m.transforms if t.header.frame_id == "map"]
        ours = [t for t in sent if abs(t.header.stamp.to_sec() - self.begin) < 500]
        assert ours[-1].child_frame_id == "odom"
        ahead = (ours[-1].header.stamp.to_sec() - self.begin) % STEP
        assert min(ahead, STEP - ahead) < 1e-3  # a scan's stamp and transform_tolerance, 0.1 s
        self.wait_for_status(0, "tracking")
        values = {item.key: item.value for item in self.status().values}
        assert float(values["processor time per scan [ms]"]) < 5
        wait_for(
            lambda: abs(rospy.get_param("/localization_node/initial_pose_x") - 1.5) > 0.1, "a saved pose", DEADLINE
        )

    def test_3_starts_afresh_when_the_clock_is_set_back(self):
        last = self.drive(3.0)
        self.assert_close(self.last_pose(last - 0.5))

    def test_4_initial_pose_and_global_localization(self):
        self.drive(2.0)
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = 4.0, 3.0
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[0] = message.pose.covariance[7] = message.pose.covariance[35] = 0.01
        self.initial.publish(message)
        begin = len(self.poses.messages)
        t = self.drive(1.0, first=2.0)
        wrong = wait_for(lambda: self.poses.messages[begin:], "poses", DEADLINE)
        assert any(np.hypot(*(pose_of(m)[:2] - [4.0, 3.0])) < 0.8 for m in wrong)
        rospy.ServiceProxy("global_localization", Empty)()
        begin = len(self.poses.messages)
        t = self.drive(18.0, first=3.0)
        assert any(deviation(m) > 0.5 for m in self.poses.messages[begin:])
        found = self.last_pose(t - 0.5)
        self.assert_close(found)
        assert deviation(found) < 0.3

    def test_5_an_update_at_rest_on_demand(self):
        self.drive(2.0)
        self.last_pose(1.5)
        ranges = ranges_at(truth(2.0))
        for i in range(5):  # at rest
            self.tf.publish([transform("odom", "base_link", self.odom, self.at(2.0 + i * STEP))])
        rospy.ServiceProxy("request_nomotion_update", Empty)()
        begin = len(self.poses.messages)
        rest = self.odom
        for i in range(5, 10):
            self.odom = rest
            self.step(2.0 + i * STEP, ranges=ranges)
        wait_for(lambda: len(self.poses.messages) > begin, "amcl_pose at rest", DEADLINE)

    def test_6_scans_without_transforms_are_counted_and_said(self):
        begin = time.monotonic()
        while time.monotonic() - begin < 4.0 and not (self.status() and "NO_TRANSFORM" in self.status().message):
            self.step((time.monotonic() - begin), with_tf=False)
            time.sleep(0.05)
        self.wait_for_status(2, "LOCALIZATION_NO_TRANSFORM")
        values = {item.key: item.value for item in self.status().values}
        assert int(values["dropped without transform"]) > 0
        self.wait_for_status(2, "LOCALIZATION_NO_SCAN")

    def test_7_nonsense_is_dropped_and_the_rest_used(self):
        t = self.drive(1.0)
        for i, bad in enumerate(
            ([], [1.0], [float("nan")] * BEAMS, [float("inf")] * BEAMS, [-1.0] * BEAMS, [0.0] * BEAMS)
        ):
            self.step(t + (i + 1) * STEP, ranges=bad)
        t = self.drive(3.0, first=t + 7 * STEP)
        self.assert_close(self.last_pose(t - 0.5))

    def test_8_a_map_that_makes_no_sense_is_refused_and_said(self):
        bad = room_map()
        bad.data = bad.data[:-1]
        set_map = rospy.ServiceProxy("set_map", SetMap)
        assert not set_map(bad, PoseWithCovarianceStamped()).success
        self.wait_for_status(2, "LOCALIZATION_BAD_MAP")
        good = PoseWithCovarianceStamped()
        good.pose.pose.position.x, good.pose.pose.position.y = truth(0)[:2]
        good.pose.pose.orientation.z, good.pose.pose.orientation.w = np.sin(0.8), np.cos(0.8)
        good.pose.covariance[0] = good.pose.covariance[7] = good.pose.covariance[35] = 0.01
        assert set_map(room_map(), good).success
        t = self.drive(2.0)
        self.assert_close(self.last_pose(t - 0.5))

    def test_9_bad_configuration_stops_it(self):
        good = rospy.get_param("/localization_node")
        node = roslib.packages.find_node("kurumaisu", "localization_node")[0]
        for key, value, message in (
            ("min_particles", 0, "/bad_localization: min_particles: must be 1 to 1e+06: 0"),
            ("min_particels", 30, "/bad_localization/min_particels: is not a known key"),
            ("odom_frame_id", 3, "/bad_localization/odom_frame_id: must be a string"),
            ("initial_cov_xx", 0.0, "/bad_localization/initial_cov_xx: must be above 0"),
            ("save_pose_rate", 0.0, "/bad_localization/save_pose_rate: must be above 0, or -1"),
        ):
            rospy.set_param("/bad_localization", {**good, key: value})
            done = subprocess.run(
                [node, "__name:=bad_localization"], capture_output=True, text=True, timeout=DEADLINE, check=False
            )
            rospy.delete_param("/bad_localization")
            assert done.returncode == 1
            assert message in done.stderr, done.stderr


if __name__ == "__main__":
    rospy.init_node("localization_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "localization_node_test", LocalizationNode, sys.argv)

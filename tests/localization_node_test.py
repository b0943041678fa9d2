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
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.srv import SetMap
from rosgraph_msgs.msg import Log
from std_srvs.srv import Empty

from kurumaisu.geometry import wrap
from kurumaisu.ros.testing.nodes import Topic, deviation, pose_of, unexplained, wait_for
from kurumaisu.ros.testing.room import BEAMS, STEP, WALLS, Room, ranges_at, transform, truth

DEADLINE = 40.0  # [s] of the wall clock
EDGE, MARGIN = 0.05, 0.525  # [m] the walls lie in the middle of their cells


def _covariance(message, **values):
    for place, value in values.items():
        message.pose.covariance[int(place[1:])] = value


def _frame(message, name):
    message.header.frame_id = name


def _stamp(message, ahead):
    message.header.stamp = rospy.Time.now() + rospy.Duration(ahead)


def _position(message, x):
    message.pose.pose.position.x = x


def _orientation(message, w):
    message.pose.pose.orientation.w = w


# What localization_node says of an initial pose, and what is wrong with it.
BAD_POSES = {
    "frame_id: must be map, or empty: odom": lambda m: _frame(m, "/odom"),
    "stamp: must be at most 10 s ahead of this clock": lambda m: _stamp(m, 1000),
    "position.x: must be a number from -1e+07 to 1e+07 m: 1e+300": lambda m: _position(m, 1e300),
    "position.x: must be a number from -1e+07 to 1e+07 m: nan": lambda m: _position(m, np.nan),
    "orientation: must be a quaternion of finite numbers, not all 0": lambda m: _orientation(m, 0.0),
    "variance of x: must be a number from 0 to 1e+06 m^2 or rad^2: 1e+300": lambda m: _covariance(m, c0=1e300),
    "variance of y: must be a number from 0 to 1e+06 m^2 or rad^2: -1": lambda m: _covariance(m, c7=-1.0),
    "must be positive semi-definite: its least eigenvalue is -0.99": lambda m: _covariance(m, c1=1.0, c6=1.0),
    "covariance of x and y: must be the same number twice": lambda m: _covariance(m, c1=0.005),
}


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


class LocalizationNode(unittest.TestCase):
    """Every test begins anew by setting the clock back."""

    @classmethod
    def setUpClass(cls):
        cls.room = Room(20000.0)
        cls.map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        cls.initial = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=1)
        cls.diagnostics = Topic("/diagnostics", DiagnosticArray)
        cls.poses = Topic("amcl_pose", PoseWithCovarianceStamped)
        cls.clouds = Topic("particlecloud", PoseArray)
        cls.room.wait_for_subscribers()
        cls.transforms = Topic("/tf", tf2_msgs.msg.TFMessage)  # last: it would count as one of them
        for publisher in (cls.map, cls.initial):
            wait_for(lambda p=publisher: p.get_num_connections() > 0, f"subscriber of {publisher.name}", DEADLINE)

    def setUp(self):
        self.room.begin_anew()

    def last_pose(self, t):
        """Return amcl_pose at least as late as a time of the test."""

        def found():
            late = [m for m in self.room.of_this_test(self.poses.messages) if self.room.time_of(m) > t - 0.01]
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
        error = pose_of(message) - truth(self.room.time_of(message))
        assert np.hypot(*error[:2]) < distance, error
        assert abs(wrap(error[2])) < turn, error

    def test_help_names_all_that_the_node_has(self):
        assert unexplained("/localization_node", "localization_node") == set()

    def test_1_without_a_map_it_says_so(self):
        self.wait_for_status(2, "LOCALIZATION_NO_MAP")
        self.map.publish(room_map())
        wait_for(lambda: "NO_MAP" not in self.status().message, "the map to be taken", DEADLINE)

    def test_2_follows_the_chair(self):
        last = self.room.drive(12.0)
        message = self.last_pose(last - 0.5)
        assert message.header.frame_id == "map"
        self.assert_close(message)
        assert deviation(message) < 0.2
        wait_for(lambda: self.room.of_this_test(self.clouds.messages), "particlecloud", DEADLINE)
        assert len(self.room.of_this_test(self.clouds.messages)[-1].poses) >= 100
        sent = [t for m in self.transforms.messages for t in m.transforms if t.header.frame_id == "map"]
        ours = [t for t in sent if abs(self.room.time_of(t)) < 500]
        assert ours[-1].child_frame_id == "odom"
        ahead = self.room.time_of(ours[-1]) % STEP
        assert min(ahead, STEP - ahead) < 1e-3  # a scan's stamp and transform_tolerance, 0.1 s
        self.wait_for_status(0, "tracking")
        values = {item.key: item.value for item in self.status().values}
        assert float(values["processor time per scan [ms]"]) < 5

        def saved():  # two seconds of the wall clock after the last time, if a scan comes then
            nonlocal last
            last = self.room.drive(0.5, first=last + STEP)
            return abs(rospy.get_param("/localization_node/initial_pose_x") - 1.5) > 0.1

        wait_for(saved, "a saved pose", DEADLINE)

    def test_3_starts_afresh_when_the_clock_is_set_back(self):
        last = self.room.drive(3.0)
        self.assert_close(self.last_pose(last - 0.5))

    def test_4_initial_pose_and_global_localization(self):
        self.room.drive(2.0)
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = 4.0, 3.0
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[0] = message.pose.covariance[7] = message.pose.covariance[35] = 0.01
        begin = len(self.poses.messages)
        self.initial.publish(message)
        t = self.room.drive(1.0, first=2.0)
        self.poses.wait(lambda m: np.hypot(*(pose_of(m)[:2] - [4.0, 3.0])) < 0.8, "a wrong pose", DEADLINE, since=begin)
        rospy.ServiceProxy("global_localization", Empty)()
        begin = len(self.poses.messages)
        t = self.room.drive(18.0, first=3.0)
        assert any(deviation(m) > 0.5 for m in self.poses.messages[begin:])
        found = self.last_pose(t - 0.5)
        self.assert_close(found)
        assert deviation(found) < 0.3

    def test_5_an_update_at_rest_on_demand(self):
        self.room.drive(2.0)
        self.last_pose(1.5)
        ranges = ranges_at(truth(2.0))
        for i in range(5):  # at rest
            self.room.tf.publish([transform("odom", "base_link", self.room.odom, self.room.at(2.0 + i * STEP))])
        rospy.ServiceProxy("request_nomotion_update", Empty)()
        begin = len(self.poses.messages)
        rest = self.room.odom
        for i in range(5, 10):
            self.room.odom = rest
            self.room.step(2.0 + i * STEP, ranges=ranges)
        wait_for(lambda: len(self.poses.messages) > begin, "amcl_pose at rest", DEADLINE)

    def test_5_scans_that_show_nothing_are_said_at_rest(self):
        t = self.room.drive(2.0)
        rest = self.room.odom

        def said():
            nonlocal t
            t += STEP
            self.room.odom = rest
            self.room.step(t, ranges=[float("nan")] * BEAMS)
            time.sleep(0.05)
            return "LOCALIZATION_BLIND" in self.status().message and self.values()["knowledge"] == "blind"

        wait_for(said, "scans that show nothing said", DEADLINE)

    def test_6_scans_without_transforms_are_counted_and_said(self):
        self.room.step_until(
            lambda: self.status() and "NO_TRANSFORM" in self.status().message,
            "no transform said",
            DEADLINE,
            with_tf=False,
        )
        self.wait_for_status(2, "LOCALIZATION_NO_TRANSFORM")
        values = {item.key: item.value for item in self.status().values}
        assert int(values["dropped without transform"]) > 0
        self.wait_for_status(2, "LOCALIZATION_NO_SCAN")

    def test_7_nonsense_is_dropped_and_the_rest_used(self):
        t = self.room.drive(1.0)
        for i, bad in enumerate(
            ([], [1.0], [float("nan")] * BEAMS, [float("inf")] * BEAMS, [-1.0] * BEAMS, [0.0] * BEAMS)
        ):
            self.room.step(t + (i + 1) * STEP, ranges=bad)
        t = self.room.drive(3.0, first=t + 7 * STEP)
        self.assert_close(self.last_pose(t - 0.5))

    def values(self):
        return {item.key: item.value for item in self.status().values}

    def counted(self, key, least):
        wait_for(lambda: int(self.values()[key]) >= least, f"{least} counted as {key}", DEADLINE)

    def test_7_stamps_of_another_time_are_counted_and_the_pose_stays(self):
        odometry = rospy.Publisher("odom", Odometry, queue_size=10)
        wait_for(odometry.get_num_connections, "odom to be heard", DEADLINE)
        t = self.room.drive(3.0)
        begin = len(self.poses.messages)
        for i in range(3):
            self.room.of_another_time(t)
            message = Odometry()
            message.header.stamp = rospy.Time(4294967295)
            odometry.publish(message)
            t = self.room.drive(1.0, first=t + STEP, frame="/laser" if i else "laser")
        self.assert_close(self.last_pose(t - 0.5))
        for message in self.room.of_this_test(self.poses.messages[begin:]):
            self.assert_close(message, 0.15, 0.1)
        for key, least in (("dropped as too old", 3), ("refused transforms", 9), ("refused odometry", 3)):
            self.counted(key, least)
        odometry.unregister()

    def test_8_a_pose_that_makes_no_sense_is_refused_with_the_reason(self):
        said = Topic("/rosout", Log)
        wait_for(lambda: said.is_published, "rosout", DEADLINE)
        last = self.room.drive(2.0)
        refused = int(self.values()["refused initial poses"])
        for k, (words, spoil) in enumerate(BAD_POSES.items()):
            message = PoseWithCovarianceStamped()
            message.header.frame_id = "/map"
            message.pose.pose.position.x, message.pose.pose.position.y = truth(2.0)[:2]
            message.pose.pose.orientation.w = 1.0
            message.pose.covariance = [0.01 if i in (0, 7, 35) else 0.0 for i in range(36)]
            spoil(message)
            begin = len(said.messages)
            self.initial.publish(message)
            said.wait(lambda m, words=words: words in m.msg, words, DEADLINE, since=begin)
            self.counted("refused initial poses", refused + k + 1)
        last = self.room.drive(2.0, first=last + STEP)
        self.assert_close(self.last_pose(last - 0.5))
        message = PoseWithCovarianceStamped()  # of a sender that does not know of simulated time
        message.header.stamp = rospy.Time.from_sec(time.time())
        message.pose.pose.position.x, message.pose.pose.position.y = 4.0, 3.0
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance = [0.01 if i in (0, 7, 35) else 0.0 for i in range(36)]
        begin, start = len(said.messages), len(self.poses.messages)
        self.initial.publish(message)
        said.wait(lambda m: "LOCALIZATION_POSE_STAMP: initialpose: stamp" in m.msg, "its stamp said", since=begin)
        self.room.drive(1.0, first=last + STEP)
        self.poses.wait(lambda m: np.hypot(*(pose_of(m)[:2] - [4.0, 3.0])) < 0.8, "that pose", DEADLINE, since=start)
        said.close()

    def test_8_a_map_that_makes_no_sense_is_refused_and_said(self):
        bad = room_map()
        bad.data = bad.data[:-1]
        set_map = rospy.ServiceProxy("set_map", SetMap)
        assert not set_map(bad, PoseWithCovarianceStamped()).success
        self.wait_for_status(2, "LOCALIZATION_BAD_MAP")
        bad = room_map()
        bad.info.origin.orientation.w = np.nan
        assert not set_map(bad, PoseWithCovarianceStamped()).success
        self.wait_for_status(2, "LOCALIZATION_BAD_MAP: info.origin.orientation")
        good = PoseWithCovarianceStamped()
        good.pose.pose.position.x, good.pose.pose.position.y = truth(0)[:2]
        good.pose.pose.orientation.z, good.pose.pose.orientation.w = np.sin(0.8), np.cos(0.8)
        good.pose.covariance[0] = good.pose.covariance[7] = good.pose.covariance[35] = 0.01
        assert set_map(room_map(), good).success
        t = self.room.drive(2.0)
        self.assert_close(self.last_pose(t - 0.5))

    def test_9_bad_configuration_stops_it(self):
        good = rospy.get_param("/localization_node")
        node = roslib.packages.find_node("kurumaisu", "localization_node")[0]
        for key, value, message in (
            ("min_particles", 0, "/bad_localization: min_particles: must be 1 to 1e+06: 0"),
            ("min_particels", 30, "/bad_localization/min_particels: is not a known key"),
            ("odom_frame_id", 3, "/bad_localization/odom_frame_id: must be a string"),
            ("initial_cov_xx", 0.0, "/bad_localization/initial_cov_xx: must be above 0"),
            ("initial_cov_xx", 1e300, "/bad_localization/initial_cov_xx: must be at most"),
            ("initial_pose_x", 1e300, "/bad_localization/initial_pose_x: must be from -1e+07 to 1e+07: 1e+300"),
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

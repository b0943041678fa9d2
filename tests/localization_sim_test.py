#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Simulator, base_node, map_server, localization_node: a drive on an uneven floor; a chair that is carried away."""

import sys
import unittest

import numpy as np
import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from kurumaisu.srv import SetPose, SetPoseRequest
from nav_msgs.msg import Odometry

from kurumaisu import geometry
from kurumaisu.driving import RouteFollower, load_route
from kurumaisu.params import shipped
from kurumaisu.ros.testing.nodes import Commander, Topic, deviation, pose_of, wait_for

WAY = 12.0  # [m]
PATIENCE = 90.0  # [s] of wall time
SURE = 0.3  # [m] a deviation of the position below which a pose is meant


class LocalizationInTheSimulator(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.truth = Topic("ground_truth", Odometry)
        cls.poses = Topic("amcl_pose", PoseWithCovarianceStamped)
        cls.diagnostics = Topic("/diagnostics", DiagnosticArray)
        cls.commander = Commander("cmd_vel")
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        wait_for(lambda: cls.truth.last and cls.poses.last, "ground_truth and amcl_pose", PATIENCE)
        cls.commander.release()

    def tearDown(self):
        self.commander.silence()

    def true_at(self, stamps):
        truth = self.truth.messages[:]  # a thread appends meanwhile
        times = np.array([m.header.stamp.to_sec() for m in truth])
        poses = np.array([pose_of(m) for m in truth])
        poses[:, 2] = np.unwrap(poses[:, 2])
        return geometry.interpolate(times, poses, np.array(stamps))

    def off(self, messages):
        """Return the distance [m] and the turn [rad] of poses from the truth."""
        error = np.array([pose_of(m) for m in messages]) - self.true_at([m.header.stamp.to_sec() for m in messages])
        return np.hypot(error[:, 0], error[:, 1]), np.abs(geometry.wrap(error[:, 2]))

    def level(self):
        """Return level and text of our last diagnostics."""
        for array in reversed(self.diagnostics.messages):
            for status in array.status:
                if status.name == "localization_node: localization":
                    return status.level, status.message
        return None

    def drive(self, metres):
        """Follow the round for so many metres."""
        driver = RouteFollower(load_route(shipped("launch/round.yaml")))
        way, last = 0.0, pose_of(self.truth.last)
        seen = self.truth.last

        def step():
            nonlocal way, last, seen
            if self.truth.last is seen:
                return False
            seen = self.truth.last
            pose = pose_of(seen)
            way, last = way + np.hypot(*(pose - last)[:2]), pose
            self.commander.say(*driver.command(pose))
            return way > metres

        wait_for(step, f"{metres} m driven", PATIENCE)
        self.commander.say(0.0, 0.0)

    def test_1_follows_the_chair(self):
        begin = len(self.poses.messages)
        self.drive(WAY)
        drive = self.poses.messages[begin:]
        last = self.truth.last.header.stamp
        wait_for(lambda: self.truth.last.header.stamp > drive[-1].header.stamp, "truth of the last pose")
        distance, turn = self.off(drive)
        assert len(drive) > 100
        assert np.sqrt(np.mean(distance**2)) < 0.06, distance
        assert distance.max() < 0.25
        assert np.sqrt(np.mean(turn**2)) < 0.03
        assert max(deviation(m) for m in drive[10:]) < SURE
        wait_for(lambda: self.level() and self.level()[0] == 0, f"good diagnostics, not {self.level()}")
        wait_for(lambda: self.buffer.can_transform("map", "base_link", last), "map -> base_link")
        found = self.buffer.lookup_transform("map", "base_link", last).transform
        seen = np.array([found.translation.x, found.translation.y])
        assert np.hypot(*(seen - self.true_at([last.to_sec()])[0, :2])) < 0.1

    def test_2_notices_that_it_was_carried_away_and_finds_itself(self):
        begin, carried = len(self.poses.messages), rospy.get_time()
        request = SetPoseRequest(name="chair")
        request.pose.position.x, request.pose.position.y = 6.2, 7.2
        request.pose.orientation.w = 1.0
        answer = rospy.ServiceProxy("set_pose", SetPose)(request)
        assert answer.success, answer.message
        self.commander.say(0.0, 0.5)
        doubt = wait_for(
            lambda: next((m for m in self.poses.messages[begin:] if deviation(m) > SURE), None), "doubt", PATIENCE
        )
        assert doubt.header.stamp.to_sec() - carried < 3.0
        wait_for(lambda: self.level()[0] > 0, "bad diagnostics")

        def later(message):
            return message.header.stamp > doubt.header.stamp

        sure = wait_for(
            lambda: next((m for m in self.poses.messages if later(m) and deviation(m) < SURE), None), "a pose", PATIENCE
        )
        wait_for(lambda: self.truth.last.header.stamp > sure.header.stamp, "truth of that pose")
        distance, turn = self.off([sure])
        assert distance[0] < 0.15
        assert turn[0] < 0.05


if __name__ == "__main__":
    import rostest

    rospy.init_node("localization_sim_test")
    rostest.rosrun("kurumaisu", "localization_sim_test", LocalizationInTheSimulator, sys.argv)

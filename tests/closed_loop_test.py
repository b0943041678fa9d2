#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_node drives the simulated chair: what the odometry says is what the chair does, and silence stops it."""

import sys
import unittest

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Twist
from kurumaisu.msg import Voltages
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from kurumaisu import geometry
from kurumaisu.ros.testing.nodes import Commander, Topic, pose_of, wait_for


def at(topic, stamp):
    """The pose of a topic interpolated at a time [s]."""
    messages = list(topic.messages)  # more come while they are looked at
    times = np.array([message.header.stamp.to_sec() for message in messages])
    poses = np.array([pose_of(message) for message in messages])
    poses[:, 2] = np.unwrap(poses[:, 2])
    return geometry.interpolate(times, poses, np.array([stamp]))[0]


class ClosedLoop(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.odom, cls.truth = Topic("odom", Odometry), Topic("ground_truth", Odometry)
        cls.voltages, cls.scans = Topic("voltages", Voltages), Topic("scan", LaserScan)
        cls.commander = Commander("cmd_vel")
        wait_for(lambda: cls.odom.last and cls.truth.last and cls.voltages.last, "odom, ground_truth and voltages")
        cls.commander.release()
        cls.commander.silence()

    def tearDown(self):
        self.commander.silence()
        self.rest()

    def rest(self):
        wait_for(lambda: self.odom.last.twist.twist == Odometry().twist.twist, "odometry at rest")
        return self.truth.wait(
            lambda m: m.twist.twist.linear.x == 0 and m.twist.twist.angular.z == 0, "the chair at rest"
        )

    def drive(self, v, w, seconds):
        """Drive for a while of simulated time; return the motion by odometry and the true one, at rest after it."""
        start = self.rest().header.stamp.to_sec()
        self.commander.say(v, w)
        self.truth.wait(lambda m: m.header.stamp.to_sec() > start + seconds, "time to pass")
        self.commander.say(0.0, 0.0)
        end = self.rest().header.stamp.to_sec()
        wait_for(lambda: self.odom.last.header.stamp.to_sec() > end, "odometry of the end")
        return tuple(geometry.between(at(topic, start), at(topic, end)) for topic in (self.odom, self.truth))

    def test_odometry_is_what_the_chair_does(self):
        """Without effects the plant inverts the voltages exactly: only the step of the simulator is between them."""
        for v, w in ((0.4, 0.0), (0.0, 0.1), (0.0, -0.1), (-0.3, 0.0), (0.3, -0.5)):
            odometry, truth = self.drive(v, w, 1.5)
            step = 0.03  # [s] a command begins and ends between the steps of both nodes
            atol = 2 * step * max(abs(v), abs(w)) + 1e-3
            np.testing.assert_allclose(odometry, truth, atol=atol, err_msg=f"{v=}, {w=}")
            expected = v if w == 0 else w
            moved = truth[0] if w == 0 else truth[2]
            assert np.sign(moved) == np.sign(expected)
            assert abs(moved) > abs(expected), f"{v=}, {w=}: {truth}"

    def test_silence_is_neutral(self):
        self.commander.say(0.4, 0.3)
        self.truth.wait(lambda m: m.twist.twist.linear.x > 0.3, "the chair to move")
        self.commander.silence()
        neutral = self.voltages.wait(lambda m: m.translation == 0 and m.steering == 0, "neutral voltages")
        assert (neutral.v, neutral.w) == (0.0, 0.0)
        self.rest()

    def test_nan_does_not_move_the_chair(self):
        before = pose_of(self.rest())
        twist = Twist()
        twist.linear.x = float("nan")
        stamp = self.truth.last.header.stamp.to_sec()
        self.commander.publisher.publish(twist)
        self.truth.wait(lambda m: m.header.stamp.to_sec() > stamp + 1.0, "time to pass")
        np.testing.assert_array_equal(pose_of(self.truth.last), before)

    def test_the_laser_hangs_on_the_odometry(self):
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)

        def placed():
            """A scan of the last second whose place in odom is known."""
            return next(
                (
                    scan
                    for scan in self.scans.messages[-10:]
                    if buffer.can_transform("odom", scan.header.frame_id, scan.header.stamp, rospy.Duration(0))
                ),
                None,
            )

        scan = wait_for(placed, "odom -> laser at a scan's stamp")
        assert len(scan.ranges) == 682


if __name__ == "__main__":
    import rostest

    rospy.init_node("closed_loop_test")
    rostest.rosrun("kurumaisu", "closed_loop_test", ClosedLoop, sys.argv)

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""All of robot.launch: a joystick drives it, an IMU steers its odometry, its laser scans, its frames are known."""

from __future__ import annotations

import math
import sys
import unittest
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovariance
from kurumaisu.msg import Voltages
from kurumaisu.srv import SetOdometry
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, Joy, LaserScan
from std_srvs.srv import Trigger

from kurumaisu.ros.rotation import yaw_of
from kurumaisu.ros.testing.nodes import PATIENCE, Repeated, Topic, wait_for

HELD = [0, 0, 0, 0, 1, 0, 0, 0]


def is_neutral(message: Voltages) -> bool:
    return (message.translation, message.steering) == (0.0, 0.0)


def joy(forward: float, left: float, buttons: list[int]) -> Joy:
    return Joy(axes=[left, forward], buttons=buttons)


def imu(rate: float) -> Imu:
    """Return what a sensor that is mounted upside down says of a yaw rate [rad/s]."""
    message = Imu()
    message.header.stamp = rospy.Time.now()
    message.header.frame_id = "imu_link"
    message.angular_velocity.z = -(rate + 0.01)
    message.angular_velocity_covariance[8] = 1.0e-6
    return message


class Robot(unittest.TestCase):
    """The chair that robot.launch has started."""

    def setUp(self) -> None:
        self.voltages = Topic("/voltages", Voltages)
        self.odom = Topic("/odom", Odometry)
        self.joy = Repeated("/joy", Joy, 0.02)
        self.imu = Repeated("/imu", Imu, 0.01)
        self.rate = 0.0  # what the gyro measures [rad/s]
        wait_for(lambda: self.odom.last, "odometry")
        self.voltages.wait(is_neutral, "neutral before the test")

    def tearDown(self) -> None:
        for topic in (self.joy, self.imu, self.voltages, self.odom):
            topic.close()

    def status(self, name: str) -> str | None:
        """Return the summary of a status of /diagnostics_agg."""
        array = self.aggregated.last
        return next((s.message for s in array.status if s.name == name), None) if array else None

    def test_the_parts_are_there(self) -> None:
        self.aggregated = Topic("/diagnostics_agg", DiagnosticArray)
        scans = Topic("/scan", LaserScan)
        scan = wait_for(lambda: scans.last, "a scan")
        assert np.isfinite(scan.ranges).sum() > 100
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        wait_for(
            lambda: any(buffer.can_transform("odom", m.header.frame_id, m.header.stamp) for m in scans.messages[-5:]),
            "odom -> laser at a scan",
        )
        scans.close()
        transform = buffer.lookup_transform("base_link", "laser", rospy.Time(0)).transform.translation
        assert (transform.x, transform.y, transform.z) == (0.3, 0.0, 0.4)
        listener.unregister()
        for name in ("/chair/base/base_node: odometry", "/chair/laser/laser_node: Hardware Status"):
            wait_for(lambda name=name: self.status(name), name)
        self.aggregated.close()

    def test_a_joystick_drives_while_its_dead_man_is_held(self) -> None:
        self.joy.say(lambda: joy(1.0, 0.0, [0] * 8))
        neutral = len(self.voltages.messages)
        wait_for(lambda: len(self.voltages.messages) > neutral + 25, "half a second without the dead-man")
        assert all(is_neutral(m) for m in self.voltages.messages[neutral:])
        self.joy.say(lambda: joy(1.0, 0.0, HELD))
        self.voltages.wait(lambda m: m.v == 0.4, "motion", PATIENCE)
        self.joy.say(None)  # the joystick is unplugged
        self.voltages.wait(is_neutral, "neutral without the joystick")

    def test_odometry_goes_by_the_gyro(self) -> None:
        self.imu.say(lambda: imu(self.rate))
        self.aggregated = Topic("/diagnostics_agg", DiagnosticArray)
        name = "/chair/base/base_node: odometry"
        wait_for(lambda: self.status(name) == "yaw by the gyro", "a bias, from standstill")
        self.joy.say(lambda: joy(0.5, 0.0, HELD))
        self.voltages.wait(lambda m: m.v == 0.2, "motion")
        self.rate = 0.3  # the floor turns the chair, no voltage does
        self.odom.wait(lambda m: abs(m.twist.twist.angular.z - 0.3) < 0.02, "the gyro's rate in odometry")
        self.imu.say(None)
        self.odom.wait(lambda m: m.twist.twist.angular.z == 0, "open loop without the gyro")
        wait_for(lambda: self.status(name) == "the gyro stopped sending", "a warning")
        self.aggregated.close()

    def after(self, service: Callable[[], Any]) -> tuple[Odometry, float]:
        """Call a service; return the odometry after it, and the longest way [m] that 0.4 m/s may lead since."""
        begin = rospy.Time.now()
        assert service().success
        end = rospy.Time.now()
        here = self.odom.wait(lambda m: m.header.stamp > end, "odometry after it", since=0)
        return here, 0.4 * (here.header.stamp - begin).to_sec() + 0.01

    def test_odometry_is_set_while_the_chair_moves(self) -> None:
        self.joy.say(lambda: joy(1.0, 0.0, HELD))
        self.voltages.wait(lambda m: m.v == 0.4, "motion")
        here, way = self.after(rospy.ServiceProxy("/base_node/reset_odometry", Trigger))
        assert 0 < here.pose.pose.position.x < way
        assert here.pose.covariance[0] < 0.01 + 0.01 * way
        assert abs(yaw_of(here.pose.pose.orientation)) < 0.1
        pose = PoseWithCovariance()
        pose.pose.position.x, pose.pose.position.y = 5.0, -3.0
        pose.pose.orientation.z = pose.pose.orientation.w = math.sqrt(0.5)
        pose.covariance = [0.04 if i in (0, 7, 35) else 0.0 for i in range(36)]
        put = rospy.ServiceProxy("/base_node/set_odometry", SetOdometry)
        here, way = self.after(lambda: put(pose))
        assert abs(here.pose.pose.position.x - 5) < 0.05 + 0.1 * way
        assert -3 < here.pose.pose.position.y < -3 + way  # it drives on, to the left of before
        assert abs(here.pose.covariance[0] - 0.04) < 0.01 + 0.01 * way
        assert not is_neutral(self.voltages.last)
        pose.pose.orientation.w = math.nan
        assert "quaternion" in put(pose).message
        pose.pose.orientation.w = 1.0
        for x, variance, words in (
            (1e308, 0.04, "position.x: must be a number from -1e+07 to 1e+07 m: 1e+308"),
            (5.0, 1e308, "variance of x: must be"),
            (5.0, -1.0, "variance of x: must be"),
        ):
            pose.pose.position.x, pose.covariance[0] = x, variance
            answer = put(pose)
            assert not answer.success
            assert words in answer.message


if __name__ == "__main__":
    rospy.init_node("robot_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "robot_test", Robot, sys.argv)

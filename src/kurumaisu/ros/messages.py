# SPDX-License-Identifier: BSD-3-Clause
"""Poses, scans and voltages as ROS messages and back."""

from __future__ import annotations

import math

import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from kurumaisu.msg import Voltages
from kurumaisu.params import Laser
from kurumaisu.plausible import require
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.sim.chair.simulator import Command
from kurumaisu.types import FloatArray


def stamp_of(nanoseconds: int) -> rospy.Time:
    """Return a stamp for whole nanoseconds."""
    return rospy.Time(*divmod(nanoseconds, 1_000_000_000))


def odometry(stamp: rospy.Time, frame: str, child: str, pose: FloatArray, rates: FloatArray) -> Odometry:
    """Return a pose (3,) in a frame and rates (3,) in the child frame; covariances of 0: the truth."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.child_frame_id = child
    message.pose.pose.position.x, message.pose.pose.position.y = float(pose[0]), float(pose[1])
    message.pose.pose.orientation = quaternion_of(float(pose[2]))
    message.twist.twist.linear.x, message.twist.twist.linear.y = float(rates[0]), float(rates[1])
    message.twist.twist.angular.z = float(rates[2])
    return message


def laser_scan(stamp: rospy.Time, laser: Laser, ranges: FloatArray) -> LaserScan:
    """Return a scan whose stamp is its first beam's; +inf and NaN as in REP-117."""
    message = LaserScan()
    message.header.stamp = stamp
    message.header.frame_id = laser.frame
    message.angle_min = laser.angle_min
    message.angle_max = laser.angle_min + laser.angle_increment * (laser.beams - 1)
    message.angle_increment = laser.angle_increment
    message.time_increment = laser.time_increment
    message.scan_time = laser.scan_time
    message.range_min, message.range_max = laser.range_min, laser.range_max
    message.ranges = ranges.tolist()
    return message


def laser_transform(stamp: rospy.Time, laser: Laser, base_frame: str) -> TransformStamped:
    """Return base_from_laser as the model file gives it."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = base_frame
    message.child_frame_id = laser.frame
    translation = message.transform.translation
    translation.x, translation.y, translation.z = laser.mount.x, laser.mount.y, laser.mount.z
    message.transform.rotation = quaternion_of(laser.mount.yaw)
    return message


def command_of(message: Voltages) -> Command:
    """Return voltages with the signs of the rates that they stand for; NaN stays NaN: unknown.

    Raise Error unless they make sense.
    """
    translation = require("voltage", "translation", message.translation)
    steering = require("voltage", "steering", message.steering)
    return Command(translation, steering, _sign(message.v), _sign(message.w))


def _sign(rate: float) -> float:
    return rate if math.isnan(rate) else float((rate > 0) - (rate < 0))

# SPDX-License-Identifier: BSD-3-Clause
"""Messages that come in: checked there, and dropped, counted and warned of where they make no sense."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Twist

from kurumaisu.errors import Error, one_line
from kurumaisu.plausible import require, require_covariance
from kurumaisu.ros.rotation import planar

Rates = tuple[float, float, float]

_WARNING_PERIOD = 5.0  # [s] of wall time between two warnings of a topic
_AHEAD = 86400.0  # [s] a stamp farther in the future is of another clock


class Refusals:
    """What was refused of a topic."""

    def __init__(self, code: str, topic: str) -> None:
        """code: in front of warnings, for who looks for them."""
        self.count = 0
        self._code, self._topic = code, topic
        self._due = 0.0

    def add(self, error: Error) -> None:
        """Count a message, and warn unless that was done lately."""
        self.count += 1
        now = time.monotonic()
        if now >= self._due:
            self._due = now + _WARNING_PERIOD
            rospy.logwarn(f"{self._code} {self._topic}: refused, {self.count} so far: {one_line(error)}")


def subscribe(
    topic: str, kind: type, hear: Callable[[Any], None], code: str, *, queue_size: int, tcp_nodelay: bool = False
) -> rospy.Subscriber:
    """Have messages heard; those for which `hear` raises Error are refused."""
    refusals = Refusals(code, rospy.resolve_name(topic))

    def checked(message: Any) -> None:
        try:
            hear(message)
        except Error as error:
            refusals.add(error)

    return rospy.Subscriber(topic, kind, checked, queue_size=queue_size, tcp_nodelay=tcp_nodelay)


def seconds_of(message: Any) -> float:
    """Return the stamp of a message [s]. Raise Error unless it makes sense, and for one of the future."""
    stamp = require("stamp", "stamp", message.header.stamp.to_sec())
    now = rospy.get_time() if rospy.rostime.is_rostime_initialized() else 0.0
    if now > 0 and stamp > now + _AHEAD:  # 0: no time yet
        raise Error(f"stamp: must be at most {_AHEAD:g} s ahead of this clock, {now:.3f} s: {stamp:.3f} s")
    return stamp


def nanoseconds_of(message: Any) -> int:
    """Return the stamp of a message [ns]. Raise Error unless it makes sense."""
    seconds_of(message)
    return int(message.header.stamp.to_nsec())


def rates_of(twist: Twist) -> Rates:
    """Return forward, leftward speed [m/s], yaw rate [rad/s]. Raise Error unless they make sense."""
    return (
        require("speed", "linear.x", twist.linear.x),
        require("speed", "linear.y", twist.linear.y),
        require("yaw rate", "angular.z", twist.angular.z),
    )


def check_scan(message: Any) -> None:
    """Raise Error unless all that is not a reading of a scan makes sense."""
    seconds_of(message)
    require("angle", "angle_min", message.angle_min)
    require("angle", "angle_increment", message.angle_increment)
    sweep = message.time_increment * len(message.ranges)
    require("duration", "time_increment, times the number of readings", sweep)
    require("range", "range_min", message.range_min)
    if not message.range_max > 0:  # inf: the sensor has no limit
        raise Error(f"range_max: must be above 0 m: {message.range_max}")


def check_odometry(message: Any) -> None:
    """Raise Error unless pose and rates of an Odometry make sense."""
    planar(message.pose.pose)
    rates_of(message.twist.twist)


def check_covariance(values: Any) -> None:
    """Raise Error unless this (36,) can be the covariance of a pose, seen from above."""
    rows = [0, 1, 5]  # x, y, yaw among six
    require_covariance(np.asarray(values, dtype=np.float64).reshape(6, 6)[np.ix_(rows, rows)])

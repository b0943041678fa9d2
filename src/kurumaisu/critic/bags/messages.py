# SPDX-License-Identifier: BSD-3-Clause
"""What each message type says, as a row of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.critic.values.recording import PARTS, Fan
from kurumaisu.errors import Error
from kurumaisu.plausible import yaw_or_nan

# The field of a message that gives the covariate its plain name; others are called topic.field.
MAIN_FIELD = {
    "sensor_msgs/msg/BatteryState": "voltage",
    "sensor_msgs/msg/Temperature": "temperature",
}
# Ranges are float32 in a bag: rounding to this many decimals gives back what the sensor reported in metres.
RANGE_DECIMALS = 6

FIX = "sensor_msgs/NavSatFix"  # whose rows are latitude and longitude [rad]

Converter = Callable[[Any], Any]


class ScanRow(NamedTuple):
    """A scan: its fan, ranges [m], (beams,), and intensities, None where there is not one for each."""

    fan: Fan
    ranges: Any
    intensities: Any


def converter(part: str, kind: str) -> Converter:
    """Return the function from a message to its row for a part of a run. Raise Error for a type that does not fit."""
    if part not in PARTS:
        return lambda message: _numbers(message, MAIN_FIELD.get(kind, "data"))
    if kind not in _CONVERTERS[part]:
        accepted = ", ".join(map(shown, _CONVERTERS[part]))
        raise Error(_REFUSED.get(kind, f"is of type {shown(kind)}, not of {accepted}"))
    return _CONVERTERS[part][kind]


def serves_as(kind: str) -> list[str]:
    """Return the parts that a message type may serve as."""
    return [part for part in PARTS if kind in _CONVERTERS[part]]


def shown(kind: str) -> str:
    """Return a type as ROS 1 writes it."""
    return kind.replace("/msg/", "/")


def _twist(message: Any) -> tuple[float, ...]:
    return message.linear.x, message.angular.z


def _pose(pose: Any) -> tuple[float, ...]:
    return pose.position.x, pose.position.y, _yaw(pose.orientation)


def _transform(transform: Any) -> tuple[float, ...]:
    return transform.translation.x, transform.translation.y, _yaw(transform.rotation)


def _fix(message: Any) -> tuple[float, ...]:
    """Return latitude and longitude [rad], nan without a fix."""
    if message.status.status < 0:
        return math.nan, math.nan
    return math.radians(message.latitude), math.radians(message.longitude)


def _yaw(q: Any) -> float:
    return yaw_or_nan(q.x, q.y, q.z, q.w)


def _imu(message: Any) -> tuple[float, ...]:
    """Return rates and accelerations about the axes of the sensor; a covariance of -1 says that one is not measured."""
    w, a = message.angular_velocity, message.linear_acceleration
    rates = (w.x, w.y, w.z) if message.angular_velocity_covariance[0] >= 0 else (math.nan,) * 3
    felt = (a.x, a.y, a.z) if message.linear_acceleration_covariance[0] >= 0 else (0.0,) * 3
    return (*rates, *(part if math.isfinite(part) else 0.0 for part in felt))


def _scan(message: Any) -> ScanRow:
    ranges = np.round(np.asarray(message.ranges, dtype=np.float64), RANGE_DECIMALS)
    # REP 117 for drivers that predate it: below the limit there is no reading, above it no return.
    ranges[(ranges < round(message.range_min, RANGE_DECIMALS)) | (ranges <= 0)] = np.nan
    if message.range_max > message.range_min:
        ranges[ranges > round(message.range_max, RANGE_DECIMALS)] = np.inf
    numbers = (message.angle_min, message.angle_increment, message.time_increment, message.scan_time)
    angle_min, increment, time_increment, scan_time = (float(number) for number in numbers)
    intensities = message.intensities if len(message.intensities) == len(ranges) else None
    return ScanRow(Fan(angle_min, increment, len(ranges), time_increment, scan_time), ranges, intensities)


def _numbers(message: Any, main: str) -> dict[str, float]:
    """Return the numeric fields of a message by name; the main one is called ''."""
    found = dict(_leaves(message, ""))
    return {("" if name == main else name): value for name, value in found.items()}


def _leaves(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    for item in fields(message):
        value = getattr(message, item.name)
        # rosbags gives a message's constants as fields; ROS writes their names in capitals.
        if item.name == "header" or item.name.isupper() or type(value).__name__.startswith("builtin_interfaces"):
            continue
        if isinstance(value, (bool, int, float, np.number)):
            yield f"{prefix}{item.name}", float(value)
        elif is_dataclass(value):
            yield from _leaves(value, f"{prefix}{item.name}.")


_CONVERTERS: dict[str, dict[str, Converter]] = {
    "command": {
        "geometry_msgs/msg/Twist": _twist,
        "geometry_msgs/msg/TwistStamped": lambda m: _twist(m.twist),
    },
    "voltage": {"kurumaisu/msg/Voltages": lambda m: (m.translation, m.steering, m.v, m.w)},
    "pose": {
        "nav_msgs/msg/Odometry": lambda m: _pose(m.pose.pose),
        "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
        "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
        "geometry_msgs/msg/TransformStamped": lambda m: _transform(m.transform),
        "geometry_msgs/msg/Pose": _pose,
        "geometry_msgs/msg/Pose2D": lambda m: (m.x, m.y, m.theta),
        "geometry_msgs/msg/PointStamped": lambda m: (m.point.x, m.point.y),
        "geometry_msgs/msg/Point": lambda m: (m.x, m.y),
        "sensor_msgs/msg/NavSatFix": _fix,
    },
    "odom": {
        "nav_msgs/msg/Odometry": lambda m: (*_pose(m.pose.pose), *_twist(m.twist.twist)),
        "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
        "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
    },
    "imu": {"sensor_msgs/msg/Imu": _imu},
    "scan": {"sensor_msgs/msg/LaserScan": _scan},
}
_STEERED = (
    "steers by an angle and does not turn by a rate, which the critic's models do: give a twist of what was asked"
)
_REFUSED = {
    f"ackermann_msgs/msg/{name}": f"a command of type ackermann_msgs/{name} {_STEERED}"
    for name in ("AckermannDrive", "AckermannDriveStamped")
}

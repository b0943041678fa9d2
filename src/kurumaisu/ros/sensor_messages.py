# SPDX-License-Identifier: BSD-3-Clause
"""Readings of further sensors as standard messages; each for the robot in a row of the reading."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from rospy import Time
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, Range
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.sim.sensors.battery import BatteryReading, BatterySettings
from kurumaisu.sim.sensors.bumper import BumperSettings
from kurumaisu.sim.sensors.camera import camera_info
from kurumaisu.sim.sensors.fiducial import Sightings
from kurumaisu.sim.sensors.imu import ImuReading
from kurumaisu.sim.sensors.sonar import SonarSettings
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world.model import Camera

if TYPE_CHECKING:
    from numpy.typing import NDArray

_UNKNOWN = -1.0  # REP-145: the first covariance of what is not measured


def imu(reading: ImuReading, row: int, stamp: Time, frame: str) -> Imu:
    """Return rates and specific force; no orientation unless the unit integrates one."""
    message = Imu(header=Header(stamp=stamp, frame_id=frame))
    message.angular_velocity = Vector3(*reading.angular_velocity[row].tolist())
    message.linear_acceleration = Vector3(*reading.acceleration[row].tolist())
    if reading.heading is None:
        message.orientation_covariance[0] = _UNKNOWN
    else:
        message.orientation = quaternion_of(float(reading.heading[row]))
    return message


def battery(reading: BatteryReading, row: int, stamp: Time, frame: str, settings: BatterySettings) -> BatteryState:
    """Return the battery's state."""
    message = BatteryState(header=Header(stamp=stamp, frame_id=frame), present=True)
    message.voltage, message.current = float(reading.voltage[row]), float(reading.current[row])
    message.charge, message.percentage = float(reading.charge[row]), float(reading.percentage[row])
    message.capacity = message.design_capacity = settings.capacity
    message.temperature = math.nan
    charging = message.current > 0
    message.power_supply_status = (
        BatteryState.POWER_SUPPLY_STATUS_CHARGING if charging else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    )
    message.power_supply_health = (
        BatteryState.POWER_SUPPLY_HEALTH_DEAD if reading.exhausted[row] else BatteryState.POWER_SUPPLY_HEALTH_GOOD
    )
    return message


def sonars(reading: FloatArray, row: int, stamp: Time, frame: str, settings: SonarSettings) -> list[Range]:
    """Return a message for each sonar, whose frame ends in its number; infinities as in REP-117."""
    return [
        Range(
            header=Header(stamp=stamp, frame_id=f"{frame}_{number}"),
            radiation_type=Range.ULTRASOUND,
            field_of_view=settings.field_of_view,
            min_range=settings.range_min,
            max_range=settings.range_max,
            range=distance,
        )
        for number, distance in enumerate(reading[row].tolist())
    ]


def bumpers(reading: BoolArray, row: int, stamp: Time, frame: str, settings: BumperSettings) -> list[Range]:
    """Return a message for each strip, whose frame ends in its number.

    As sensor_msgs/Range says of sensors that only know one distance: -inf: something is there, +inf: nothing.
    """
    return [
        Range(
            header=Header(stamp=stamp, frame_id=f"{frame}_{number}"),
            radiation_type=Range.INFRARED,  # there is no word for touch
            field_of_view=0.0,
            min_range=settings.travel,
            max_range=settings.travel,
            range=-math.inf if touches else math.inf,
        )
        for number, touches in enumerate(reading[row].tolist())
    ]


def marks(reading: Sightings, row: int, stamp: Time, frame: str) -> TFMessage:
    """Return where marks are as seen from the finder: mark_ID, or mark_0 where it is too far to be told."""
    message = TFMessage()
    for i in np.flatnonzero(reading.finder == row).tolist():
        bearing, distance = float(reading.bearing[i]), float(reading.range[i])
        message.transforms.append(
            TransformStamped(
                header=Header(stamp=stamp, frame_id=frame),
                child_frame_id=f"mark_{int(reading.id[i])}",
                transform=Transform(
                    translation=Vector3(distance * math.cos(bearing), distance * math.sin(bearing), 0.0),
                    rotation=quaternion_of(float(reading.heading[i])),
                ),
            )
        )
    return message


def image(pixels: NDArray[Any], encoding: str, stamp: Time, frame: str) -> Image:
    """Return a picture (height, width, ...) of the machine's byte order."""
    height, width = pixels.shape[:2]
    return Image(
        header=Header(stamp=stamp, frame_id=frame),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=sys.byteorder == "big",
        step=pixels.nbytes // height,
        data=np.ascontiguousarray(pixels).tobytes(),
    )


def intrinsics(camera: Camera, frame: str) -> CameraInfo:
    """Return what a camera is, without a stamp."""
    info = camera_info(camera)
    message = CameraInfo(width=info.width, height=info.height, D=[0.0] * 4)
    message.header.frame_id = frame
    message.K, message.R, message.P = (matrix.ravel().tolist() for matrix in (info.k, info.r, info.p))
    return message

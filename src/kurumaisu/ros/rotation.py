# SPDX-License-Identifier: BSD-3-Clause
"""Poses in the plane as messages have them."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import Pose, Quaternion

from kurumaisu import plausible
from kurumaisu.plausible import require
from kurumaisu.types import FloatArray


def quaternion_of(yaw: float) -> Quaternion:
    """Return the rotation by yaw [rad] about z."""
    return Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def optical(heading: float, pan: float, tilt: float) -> Quaternion:
    """Return the rotation of a frame whose z is where a camera looks, and x to the right of its picture.

    heading [rad] of the camera, which is panned to the right and tilted downwards [rad]: turned about x, then about
    the robot's z.
    """
    roll, yaw = -math.pi / 2 - tilt, heading - math.pi / 2 - pan
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return Quaternion(cy * sr, sy * sr, sy * cr, cy * cr)


def yaw_of(rotation: Quaternion) -> float:
    """Return the yaw [rad], in (-pi, pi]; roll and pitch are dropped. Raise Error for a quaternion that has none."""
    return plausible.yaw_of(rotation.x, rotation.y, rotation.z, rotation.w)


def normed(rotation: Quaternion) -> Quaternion:
    """Return the same rotation as a quaternion of length 1, which tf2 insists on."""
    length = math.hypot(rotation.x, rotation.y, rotation.z, rotation.w)
    return Quaternion(rotation.x / length, rotation.y / length, rotation.z / length, rotation.w / length)


def planar(pose: Pose) -> FloatArray:
    """Return x [m], y [m], yaw [rad]. Raise Error unless they make sense."""
    place = pose.position
    x, y = require("position", "position.x", place.x), require("position", "position.y", place.y)
    return np.array([x, y, yaw_of(pose.orientation)])


def pose_of(pose: Pose) -> FloatArray:
    """Return x, y, z [m], heading [rad]. Raise Error unless they make sense."""
    x, y, yaw = planar(pose).tolist()
    return np.array([x, y, require("position", "position.z", pose.position.z), yaw])

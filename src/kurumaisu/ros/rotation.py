# SPDX-License-Identifier: BSD-3-Clause
"""Poses in the plane as messages have them."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import Pose, Quaternion

from kurumaisu.errors import Error
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
    """Return the yaw [rad], in (-pi, pi], of a rotation about z."""
    return 2 * math.atan2(rotation.z, rotation.w) if rotation.w >= 0 else 2 * math.atan2(-rotation.z, -rotation.w)


def planar(pose: Pose) -> FloatArray:
    """Return x [m], y [m], yaw [rad]."""
    return np.array([pose.position.x, pose.position.y, yaw_of(pose.orientation)])


def pose_of(pose: Pose) -> FloatArray:
    """Return x, y, z [m], heading [rad] of a pose. Raise Error unless it is finite and turns about z."""
    values = np.array([pose.position.x, pose.position.y, pose.position.z, yaw_of(pose.orientation)])
    turn = pose.orientation
    if not np.isfinite(values).all() or turn.z**2 + turn.w**2 == 0:
        raise Error(f"pose: must be finite and have an orientation, about z: {' '.join(str(pose).split())}")
    return values

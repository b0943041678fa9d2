# SPDX-License-Identifier: BSD-3-Clause
"""Rotations about z as messages have them."""

from __future__ import annotations

import math

from geometry_msgs.msg import Quaternion


def quaternion_of(yaw: float) -> Quaternion:
    """Return the rotation by yaw [rad] about z."""
    return Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def yaw_of(rotation: Quaternion) -> float:
    """Return the yaw [rad], in (-pi, pi], of a rotation about z."""
    return 2 * math.atan2(rotation.z, rotation.w) if rotation.w >= 0 else 2 * math.atan2(-rotation.z, -rotation.w)

# SPDX-License-Identifier: BSD-3-Clause
"""What makes sense of what comes from outside: the ranges and rules of src/plausible, for Python.

A finite number may still make no sense: 1e300 m is finite, and its square is not.
"""

from __future__ import annotations

import math

from kurumaisu import _core
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray


def require(quantity: str, what: str, value: float) -> float:
    """Return a number. Raise Error with what is expected and what came unless it is in its quantity's range.

    quantity: a name in src/plausible/quantity.h; what: its name where it came from.
    """
    try:
        _core.require(quantity, what, value)
    except ValueError as error:
        raise Error(str(error)) from error
    return value


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad], in (-pi, pi], of a quaternion of any length; roll and pitch are dropped.

    Raise Error for one that has none.
    """
    try:
        return _core.yaw_of(x, y, z, w)
    except ValueError as error:
        raise Error(str(error)) from error


def yaw_or_nan(x: float, y: float, z: float, w: float) -> float:
    """Return what yaw_of does, or nan for a quaternion that has none."""
    try:
        return yaw_of(x, y, z, w)
    except Error:
        return math.nan


def require_covariance(covariance: FloatArray) -> None:
    """Raise Error unless this (3, 3) can be the covariance of x, y [m], heading [rad]."""
    try:
        _core.require_covariance(covariance)
    except ValueError as error:
        raise Error(str(error)) from error

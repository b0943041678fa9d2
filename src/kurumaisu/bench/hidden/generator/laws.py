# SPDX-License-Identifier: BSD-3-Clause
"""The paper's equations (1), (2) and (4), typed from the paper: nothing here comes from the package's own model."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

# volts = slope * rate + intercept: (slope [V per m/s or rad/s], intercept [V]) for a positive and a negative rate
TRANSLATION = ((1.32402, 0.127906), (2.07369, -0.108783))  # equation (1)
STEERING = ((-0.499211, 0.104181), (-0.469278, -0.169476))  # equation (2), as printed
Axis = tuple[tuple[float, float], tuple[float, float]]

LASER_SCALE, LASER_OFFSET = 1.004587, 0.058826  # equation (4), mean [1], [m]
LASER_SIGMA = (0.002334, -0.000488, 0.000199)  # equation (4), of r^0, r^1, r^2
LASER_NEAR, LASER_FAR, LASER_STEP = 0.06, 4.0, 0.001  # Table 1 [m]


def volts(rates: FloatArray, axis: Axis) -> FloatArray:
    """Return the voltage [V] for each rate; 0 V at rate 0."""
    slope, intercept = branch(np.sign(rates), axis)
    return np.asarray(np.where(rates == 0, 0.0, slope * rates + intercept))


def rates(volt: FloatArray, sign: FloatArray, axis: Axis) -> FloatArray:
    """Return the rate for each voltage on the branch of a sign; 0 where that branch would answer with the other."""
    slope, intercept = branch(sign, axis)
    rate = (volt - intercept) / slope
    return np.asarray(np.where(sign * rate > 0, rate, 0.0))


def branch(sign: FloatArray, axis: Axis) -> tuple[FloatArray, FloatArray]:
    """Return slope and intercept of the branch of each sign."""
    (slope_up, at_up), (slope_down, at_down) = axis
    return np.where(sign < 0, slope_down, slope_up), np.where(sign < 0, at_down, at_up)


def laser_mean(ranges: FloatArray) -> FloatArray:
    """Return the mean reading [m] of a true range."""
    return LASER_SCALE * ranges + LASER_OFFSET


def laser_sd(ranges: FloatArray) -> FloatArray:
    """Return the standard deviation [m] of a reading of a true range."""
    c0, c1, c2 = LASER_SIGMA
    return c0 + ranges * (c1 + ranges * c2)

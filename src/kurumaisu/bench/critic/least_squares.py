# SPDX-License-Identifier: BSD-3-Clause
"""What one writes in an afternoon: gains, lags and a delay by least squares. Nothing of it comes from the critic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from kurumaisu.geometry import between
from kurumaisu.types import FloatArray, IntArray

_SPAN = 2.0  # [s] over which motion is compared
_ARM = 0.5  # [m] by which a turn counts as a way
_BEGIN = (1.0, 1.0, 0.0, 0.1, 0.1, 0.05)
_LOW = (0.2, 0.2, -2.0, 0.0, 0.0, 0.0)
_HIGH = (5.0, 5.0, 2.0, 2.0, 2.0, 1.0)


@dataclass(frozen=True)
class Inputs:
    """Rates asked for, v [m/s] and w [rad/s], (n,) on a grid from `start`, dt [s]; poses (m, 3) measured at times."""

    start: float
    dt: float
    v: FloatArray
    w: FloatArray
    times: FloatArray
    poses: FloatArray


def fitted(inputs: list[Inputs]) -> FloatArray:
    """Return gain of v, gain of w, turn per metre [rad/m], lag of v, lag of w [s] and delay [s] of several drives."""

    def left(values: FloatArray) -> FloatArray:
        return np.concatenate([_off(one, values) for one in inputs])

    found = least_squares(left, _BEGIN, bounds=(_LOW, _HIGH), x_scale=(0.1, 0.1, 0.1, 0.1, 0.1, 0.1), diff_step=1e-3)
    return np.asarray(found.x)


def path(inputs: Inputs, values: FloatArray) -> FloatArray:
    """Return the poses (m, 3) at the drive's times, in a frame of their own."""
    gain_v, gain_w, turn, lag_v, lag_w, delay = values
    v, w = (_lagged(rate, lag, inputs.dt) for rate, lag in ((inputs.v, lag_v), (inputs.w, lag_w)))
    v, w = gain_v * v, gain_w * w + turn * gain_v * v
    theta = np.append(0.0, np.cumsum(w) * inputs.dt)
    middle = theta[:-1] + w * inputs.dt / 2
    x, y = (np.append(0.0, np.cumsum(v * f(middle)) * inputs.dt) for f in (np.cos, np.sin))
    edges = inputs.start + delay + inputs.dt * np.arange(len(theta))
    return np.column_stack([np.interp(inputs.times, edges, column) for column in (x, y, theta)])


def moved(poses: FloatArray, rows: tuple[IntArray, IntArray]) -> FloatArray:
    """Return the motion (k, 3) from some rows of poses to others, in the frame of the first."""
    return between(*(poses[some] for some in rows))


def ahead(times: FloatArray, seconds: float) -> tuple[IntArray, IntArray]:
    """Return the rows from which, and those to which, it is so long."""
    ends = np.searchsorted(times, times + seconds - 1e-6)
    starts = np.flatnonzero(ends < len(times))
    return starts, ends[starts]


def _off(inputs: Inputs, values: FloatArray) -> FloatArray:
    rows = ahead(inputs.times, _SPAN)
    off = moved(path(inputs, values), rows) - moved(inputs.poses, rows)
    return np.asarray((off * [1.0, 1.0, _ARM]).ravel())


def _lagged(rate: FloatArray, lag: float, dt: float) -> FloatArray:
    keep = np.exp(-dt / max(lag, 1e-4))
    return np.asarray(lfilter([1 - keep], [1.0, -keep], rate))

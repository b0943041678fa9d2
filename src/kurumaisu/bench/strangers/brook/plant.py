# SPDX-License-Identifier: BSD-3-Clause
"""The plant's types and parts: a drive, its noise, the law of voltages, lags, ramps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

Arr = npt.NDArray[np.float64]
LAW_V = (1.32402, 0.127906, 2.07369, -0.108783)  # slope, intercept forward; slope, intercept in reverse
LAW_W = (-0.499211, 0.104181, -0.469278, -0.169476)
LAY = 0.30  # the laser's x on the chair


@dataclass
class Noise:
    """Standard deviations and times of the true noise: rates (s*, t*), reference (p, h; drift d*), stamps."""

    sv: float
    tv: float
    sw: float
    tw: float
    p: float
    h: float
    dp: float
    dh: float
    td: float
    jitter: float

    def scaled(self, k: float) -> Noise:
        """The same noise, k times as large."""
        s = self
        return Noise(s.sv * k, s.tv, s.sw * k, s.tw, s.p * k, s.h * k, s.dp * k, s.dh * k, s.td, s.jitter)


@dataclass
class Run:
    """One drive: command rows, start, unit rate noise at 1 ms, a further column, and when it stood at a wall."""

    tc: Arr
    vc: Arr
    wc: Arr
    start: tuple[float, float, float]
    end: float
    unit: Arr  # (2, n) at 1 ms, coloured, unit variance
    column: Arr  # at 1 ms, about 0 +- 1
    events: Arr  # times of events that come and go
    stuck: tuple[float, float] = (-1.0, -1.0)


@dataclass
class State:
    """What the effects work on: arrays over t."""

    run: Run
    t: Arr
    dt: float
    vc: Arr
    wc: Arr
    vf: Arr
    vs: Arr
    v: Arr
    w: Arr
    lat: Arr
    pose: Arr  # (3, n) x, y, theta where known
    ref: Arr  # (3, n) error of the reference: ahead, to the left, heading
    leak: Arr
    column: Arr
    clock: float = 0.0
    known: bool = False


@dataclass
class Motion:
    """A simulated drive: rates without noise (v0, w0), with it (v, w), path, and the reference's own effects."""

    t: Arr
    v0: Arr
    w0: Arr
    lat: Arr
    v: Arr
    w: Arr
    pose: Arr
    ref: Arr
    clock: float
    moving: Arr
    cs: Arr  # (2, n) cosine and sine of the heading


def volts(r: Arr, law: tuple[float, float, float, float]) -> Arr:
    """The model's law, from a rate to a voltage."""
    return np.where(r > 0, law[0] * r + law[1], np.where(r < 0, law[2] * r + law[3], 0.0))


def rates(u: Arr, asked: Arr, law: tuple[float, float, float, float]) -> Arr:
    """The law backwards, on the branch of the sign that was asked for; never through 0."""
    ahead, back = np.maximum((u - law[1]) / law[0], 0.0), np.minimum((u - law[3]) / law[2], 0.0)
    return np.where(asked > 0, ahead, np.where(asked < 0, back, 0.0))


def lag(u: Arr, dt: float, tau: float, second: bool = False) -> Arr:
    """First-order lag, exact for a held input; or a second-order one that overshoots."""
    tau = max(tau, dt / 5)
    if second:
        a, z = dt / tau, 0.45
        return np.asarray(lfilter([0.0, a * a], [1.0, 2 * z * a - 2.0, 1.0 - 2 * z * a + a * a], u))
    k = 1.0 - math.exp(-dt / tau)
    return np.asarray(lfilter([k], [1.0, k - 1.0], u))


def ramp(u: Arr, step: float) -> Arr:
    """Follow u by at most step per sample."""
    out, y = [], float(u[0])
    for a in u.tolist():
        d = a - y
        y += step if d > step else -step if d < -step else d
        out.append(y)
    return np.array(out)


def since(mask: npt.NDArray[np.bool_], t: Arr) -> Arr:
    """Time since mask was last true (or the start)."""
    last = np.maximum.accumulate(np.where(mask, t, t[0]))
    return np.asarray(t - last)


def integral(u: Arr, dt: float) -> Arr:
    """Running integral by trapezoids."""
    return np.concatenate(([0.0], np.cumsum(0.5 * dt * (u[1:] + u[:-1]))))

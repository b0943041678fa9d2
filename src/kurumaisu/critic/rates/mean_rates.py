# SPDX-License-Identifier: BSD-3-Clause
"""Rates on a grid, of what was asked for and of what was measured, and how alike they are at every shift of clocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve

from kurumaisu import geometry
from kurumaisu.critic.values.recording import LONGEST_HOLD, Series
from kurumaisu.types import BoolArray, FloatArray

STEP = 0.1  # [s] of the grid
SPAN = 1.0  # [s] over which rates are averaged: what lags and a noisy reference do to them is then small


@dataclass(frozen=True)
class Rates:
    """v [m/s] and w [rad/s] as means over SPAN about times t (n,) [s]; values (n, 2), nan where unknown."""

    t: FloatArray
    values: FloatArray


def grid(first: float, last: float) -> FloatArray:
    """Return the times (n,) [s] about which rates are averaged."""
    return np.arange(first + SPAN / 2, last - SPAN / 2, STEP)


def of_poses(pose: Series, t: FloatArray) -> Rates:
    """Return the rates of an arc from pose to pose; nan across a gap of the poses longer than half of SPAN."""
    before = geometry.interpolate(pose.t, pose.values[:, :3], t - SPAN / 2)
    after = geometry.interpolate(pose.t, pose.values[:, :3], t + SPAN / 2)
    step = geometry.between(before, after)
    turn = step[:, 2]
    forward = np.cos(turn / 2) * step[:, 0] + np.sin(turn / 2) * step[:, 1]
    rates = np.column_stack([forward / np.maximum(np.sinc(turn / (2 * np.pi)), 0.3), turn]) / SPAN
    rates[_across_gaps(pose.t, t)] = np.nan
    return Rates(t, rates)


def of_integral(times: FloatArray, whole: FloatArray, t: FloatArray) -> FloatArray:
    """Return the mean rates (n, k) of what is `whole` (m, k) at times (m,); nan before, after and across gaps."""
    a, b = t - SPAN / 2, t + SPAN / 2
    rates = np.column_stack([np.interp(b, times, column) - np.interp(a, times, column) for column in whole.T]) / SPAN
    rates[(a < times[0] - STEP) | (b > times[-1] + STEP) | _across_gaps(times, t)] = np.nan
    return rates


def of_samples(times: FloatArray, values: FloatArray, t: FloatArray) -> FloatArray:
    """Return the means (n, k) of what was measured (m, k) at times (m,), straight between them; nan likewise."""
    steps = (values[1:] + values[:-1]) / 2 * np.diff(times)[:, None]
    return of_integral(times, np.vstack([np.zeros(values.shape[1]), np.cumsum(steps, axis=0)]), t)


def _across_gaps(times: FloatArray, t: FloatArray) -> BoolArray:
    """Return which spans about t (n,) reach into a gap of times (m,) that is longer than half of SPAN, (n,)."""
    out = np.zeros(len(t), dtype=np.bool_)
    for gap in np.flatnonzero(np.diff(times) > max(SPAN / 2, 2.5 * float(np.median(np.diff(times))))):
        out |= (t + SPAN / 2 > times[gap]) & (t - SPAN / 2 < times[gap + 1])
    return out


def of_input(times: FloatArray, values: FloatArray, t: FloatArray) -> Rates:
    """Return the means of samples (n, 2) held until the next; nan before the first and long after the last."""
    knots = np.append(times, times[-1] + LONGEST_HOLD)
    steps = np.diff(knots)[:, None] * values
    integral = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    mean = [
        (np.interp(t + SPAN / 2, knots, column) - np.interp(t - SPAN / 2, knots, column)) / SPAN
        for column in integral.T
    ]
    rates = np.column_stack(mean)
    rates[(t - SPAN / 2 < knots[0] - STEP) | (t + SPAN / 2 > knots[-1])] = np.nan
    return Rates(t, rates)


@dataclass(frozen=True)
class ShiftCorrelation:
    """How alike two rates are.

    correlation (k,) at lags (k,) [s] by which the second is early, 0 where too little is known; slope (k,) of the first
    over the second, likewise; number (k,) of independent samples behind each.
    """

    lags: FloatArray
    correlation: FloatArray
    slope: FloatArray
    number: FloatArray

    @property
    def nats(self) -> FloatArray:
        """Return the log likelihood gained by a line through one against the other, over none, (k,)."""
        return np.asarray(-0.5 * self.number * np.log1p(-np.clip(self.correlation**2, 0.0, 0.9999)))


def shift_correlation(a: FloatArray, b: FloatArray, least: tuple[float, float], longest: float) -> ShiftCorrelation:
    """Return how alike a (n,) is to b (n,) delayed, both on the grid, up to a longest shift [s].

    least: the sd below which each says nothing.
    """
    n = len(a)
    reach = min(round(longest / STEP), n - 1)
    lags = STEP * np.arange(-reach, reach + 1)
    known: list[FloatArray] = [np.isfinite(s).astype(np.float64) for s in (a, b)]
    x, y = _centred(a), _centred(b)

    def lagged(p: FloatArray, q: FloatArray) -> FloatArray:
        return np.asarray(fftconvolve(p, q[::-1])[n - 1 - reach : n + reach])

    number = np.maximum(lagged(known[0], known[1]), 1e-9)
    sums = lagged(x, known[1]), lagged(known[0], y)
    xx = lagged(x**2, known[1]) / number - (sums[0] / number) ** 2
    yy = lagged(known[0], y**2) / number - (sums[1] / number) ** 2
    xy = lagged(x, y) / number - sums[0] * sums[1] / number**2
    alive = (xx > least[0] ** 2) & (yy > least[1] ** 2) & (number * STEP > max(10.0, 0.4 * n * STEP))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.where(alive, xy / np.sqrt(np.maximum(xx * yy, 1e-300)), 0.0)
        slope = np.where(alive, xy / yy, 0.0)
    return ShiftCorrelation(lags, np.clip(correlation, -1, 1), slope, number * STEP / SPAN)


def _centred(a: FloatArray) -> FloatArray:
    """Return a less its mean, 0 where it is unknown."""
    known = np.isfinite(a)
    return np.where(known, a - (a[known].mean() if known.any() else 0.0), 0.0)

# SPDX-License-Identifier: BSD-3-Clause
"""The yaw rate of a robot by its inertial sensor: about the axis that is up, without what it reads at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.imu.motion import STEP, grid, means, stands, turnings
from kurumaisu.critic.imu.mounting import Mounting, UnusableError, found, gravity_of, said
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.types import BoolArray, FloatArray

RATE = ("w",)  # column of what is known to be the robot's yaw rate
RATES, ACCELERATIONS = ("wx", "wy", "wz"), ("ax", "ay", "az")
UNUSED = "none"  # the axis of a sensor that is not to be used
_FEWEST = 20  # rows
_TOGETHER = 5.0  # [s] with what says how the robot turned
_NOTHING = 1e-9  # [rad/s] of rounding
_SHORTEST = 1.0  # [s] of rest of which the bias is taken


def with_yaw_rate(run: Run, axis: str | None = None) -> tuple[Run, list[str]]:
    """Return a run whose imu is the robot's yaw rate, and in words how that is known; without imu if it is of no use.

    axis: which is said to be up, or UNUSED; None: that is found out.
    """
    imu = run.imu
    if imu is None:
        return run, []
    if axis == UNUSED:
        return replace(run, imu=None), []
    try:
        series, words = _yaw_rate(run, imu, axis)
    except UnusableError as error:
        return replace(run, imu=None), [f"{run.name}: the imu is not used: {error}"]
    return replace(run, imu=series), [f"{run.name}: {words}"]


def heading(imu: Series) -> FloatArray:
    """Return how far a robot has turned (n,) [rad] at the times of its yaw rate."""
    w = imu.column(RATE[0])
    return np.append(0.0, np.cumsum((w[1:] + w[:-1]) / 2 * np.diff(imu.t)))


def _yaw_rate(run: Run, imu: Series, axis: str | None) -> tuple[Series, str]:
    if len(imu.t) < _FEWEST or len(at := grid(imu.t)) < _FEWEST:
        raise UnusableError(f"it has {len(imu.t)} rows over {imu.t[-1] - imu.t[0]:.3g} s")
    rows = _columns(imu, RATES)
    known = [name for name in (*RATE, *RATES) if name in imu.columns]
    if not np.ptp(np.column_stack([imu.column(name) for name in known]), axis=0).any():
        raise UnusableError("its rates never change")
    others = list(turnings(run, at))
    if not others:
        raise UnusableError("there is neither odometry nor commands nor a reference to tell which of its axes is up")
    together = max(int(np.isfinite(other.w).sum()) for other in others)
    if together * STEP < _TOGETHER:
        raise UnusableError(f"it was recorded with {others[0].name} for {together * STEP:.3g} s only: another clock?")
    rest = stands(run, at)
    ours = imu.columns[0] == RATE[0]
    if ours:
        rows[:, 2] = imu.column(RATE[0])
    rates = means(imu.t, rows, at)
    mounting = found(rates, others, None if ours else _gravity(imu, at, rest), _given(axis, ours=ours))
    w, bias = _without_bias(rates @ mounting.up, rest & np.isfinite(rates).all(axis=1), others[0].w, mounting)
    words = f"{mounting.name} is up ({mounting.why})" if not ours else f"w is the robot's yaw rate, {mounting.why}"
    words = f"the imu's {words}; {bias}"
    return Series(imu.t, (rows @ mounting.up - w)[:, None], RATE), words


def _given(axis: str | None, *, ours: bool) -> Mounting | None:
    """Return what is said of the mounting; ours: that the rate is the robot's."""
    if ours:
        return Mounting(said("z"), "w", "as its name says")
    return None if axis is None else Mounting(said(axis), axis, "as meta.yaml says")


def _columns(imu: Series, names: tuple[str, ...]) -> FloatArray:
    """Return columns (m, 3), 0 where the series has not that one."""
    return np.column_stack([imu.column(n) if n in imu.columns else np.zeros(len(imu.t)) for n in names])


def _gravity(imu: Series, at: FloatArray, rest: BoolArray) -> FloatArray | None:
    if not set(ACCELERATIONS) <= set(imu.columns):
        return None
    felt = means(imu.t, _columns(imu, ACCELERATIONS), at)
    use = np.isfinite(felt).all(axis=1)
    use = use & rest if (use & rest).any() else use
    return gravity_of(felt[use]) if use.any() else None


def _without_bias(w: FloatArray, rest: BoolArray, turning: FloatArray, mounting: Mounting) -> tuple[float, str]:
    """Return what to take off mean rates (n,) [rad/s], and in words what it is: rest (n,): when the robot stands."""
    if rest.sum() * STEP >= _SHORTEST:
        bias = float(np.median(w[rest]))
        return bias, f"bias {_told(bias)}, by {rest.sum() * STEP:.0f} s at rest"
    late = round(mounting.late / STEP)
    shifted = np.roll(turning, late)
    both = np.isfinite(w) & np.isfinite(shifted)
    both[: max(late, 0)] = both[len(both) + min(late, 0) :] = False
    _, bias = np.polyfit(shifted[both], w[both], 1) if both.sum() > 2 and np.ptp(shifted[both]) else (1.0, 0.0)
    return float(bias), f"bias {_told(float(bias))}, by how it turns, as the robot never stands: less sure"


def _told(bias: float) -> str:
    bias = 0.0 if abs(bias) < _NOTHING else bias
    return f"{bias:+.2g} rad/s ({np.degrees(bias):+.2g} deg/s)"

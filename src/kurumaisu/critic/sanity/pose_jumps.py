# SPDX-License-Identifier: BSD-3-Clause
"""Poses that go on from elsewhere: a reference that was relocalised, or a heading that was wrapped wrongly."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.sanity.headings import position_noise
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.types import FloatArray

_FAR = 10.0  # robust sd of the reference that a jump exceeds
_TURN = 0.6  # [rad] between two poses, least jump of a heading
_BUNCH = 4.0
_HALF = 0.4  # [rad] from half a turn
_LONG = 1.15  # of the way that the robot makes between poses at its fastest, from which a step is no drive
_CHANCE = 5.0  # sd of a position by which noise alone may lengthen a step: 3.5 of the difference of two
_LATE = 1.0  # [s] after which a chair has done what it was asked for
PAUSE = 5.0  # [s] without a pose after which nobody knows how far the robot was driven, or carried


def problems(pose: Series, command: Series | None = None) -> list[str]:
    """Return what jumps, in words; command: v, w, for which a chair may be fast for once."""
    new = fresh(pose)
    if len(new.t) < 20:
        return []
    # Where rows were written faster than measured, several measurements may arrive as one step.
    slack = _BUNCH if len(new.t) < 0.8 * len(pose.t) else 1.0
    return [line for line in (_position(new, slack, command), _heading(new)) if line is not None]


def fresh(pose: Series) -> Series:
    """Return the poses without those that only repeat the one before, as of a slow reference written fast."""
    new = np.r_[True, (np.diff(pose.values[:, :3], axis=0) != 0).any(axis=1)]
    return Series(pose.t[new], pose.values[new], pose.columns)


def _position(pose: Series, slack: float, command: Series | None) -> str | None:
    lasting, _ = jumps(pose, slack, command)
    if not lasting:
        return None
    i = lasting[0]
    size = float(np.hypot(*(pose.values[i, :2] - pose.values[i - 1, :2])))
    return f"the reference pose jumps {_times(lasting)} (first: {size:.2g} m at t = {moment(pose.t[i])}): relocalised?"


def _heading(pose: Series) -> str | None:
    theta, dt = pose.values[:, 2], np.diff(pose.t)
    step = np.diff(theta)
    usual = float(np.quantile(np.abs(step) / dt, 0.95)) * np.maximum(dt, float(np.median(dt)))
    noise = float(third_difference_sd(theta))
    large = np.abs(step) > np.maximum(np.maximum(2 * usual, 1.5 * _FAR * noise), _TURN)
    odd = np.flatnonzero(large & (dt < PAUSE))
    odd = np.array([i for i in odd if i >= 4 and _lasts(theta, int(i))], dtype=int)
    if not len(odd) or float(np.median(usual)) > _TURN:
        return None
    first = f"first: {step[odd[0]]:+.3g} rad at t = {moment(pose.t[odd[0] + 1])}"
    if bool((np.abs(np.abs(step[odd]) - np.pi) < _HALF).all()):
        return (
            f"heading of the reference pose jumps {_times(list(odd))} by half a turn ({first}): "
            f"wrapped wrongly, or atan instead of atan2"
        )
    return f"heading of the reference pose jumps {_times(list(odd))} ({first}): relocalised, or wrapped wrongly"


def _lasts(theta: FloatArray, i: int) -> bool:
    before, after = np.median(theta[max(0, i - 3) : i + 1]), np.median(theta[i + 1 : i + 5])
    return bool(abs(after - before) > 0.6 * abs(theta[i + 1] - theta[i]))


def _times(rows: list[int]) -> str:
    return "once" if len(rows) == 1 else f"{len(rows)} times"


def jumps(pose: Series, slack: float = 1.0, command: Series | None = None) -> tuple[list[int], list[int]]:
    """Return rows after which the position goes on from elsewhere, and rows that alone are elsewhere."""
    xy, dt = pose.values[:, :2], np.diff(pose.t)
    if len(xy) < 20:
        return [], []
    step = np.diff(xy, axis=0)
    usual = _running_median(step / dt[:, None]) * dt[:, None]
    strays = step - usual
    odd = np.hypot(*strays.T)
    beside = np.vstack([np.zeros(2), np.cumsum(strays, axis=0)])  # where it is next to where it was going
    fast = np.maximum(float(np.quantile(np.hypot(*step.T) / dt, 0.95)), _asked(command, pose.t))
    noise = max(position_noise(pose), 1e-9)
    most = fast * np.maximum(dt, float(np.median(dt)))
    limit = np.maximum(1.5 * _FAR * noise, 1.5 * slack * most)
    # A robot that turns back between two poses is far from where it was going, but has not come far.
    far = np.hypot(*step.T) > np.maximum(_LONG * most, most + _CHANCE * noise)
    lasting: list[int] = []
    single: list[int] = []
    for i in np.flatnonzero((odd > np.maximum(limit, 1e-6)) & far & (dt < PAUSE)):
        before = np.median(beside[max(0, i - 3) : i + 1], axis=0)
        after = np.median(beside[i + 1 : i + 5], axis=0)
        here = lasting if np.hypot(*(after - before)) > 0.6 * odd[i] and len(xy) - i > 5 and i >= 4 else single
        here.append(int(i) + 1)
    return lasting, single


def _asked(command: Series | None, t: FloatArray) -> FloatArray:
    """Return the greatest speed (n - 1,) that was asked for between times (n,), or up to _LATE before."""
    if command is None or not len(command.t):
        return np.zeros(len(t) - 1)
    first = np.maximum(np.searchsorted(command.t, t[:-1] - _LATE, side="right") - 1, 0)
    end = np.maximum(np.searchsorted(command.t, t[1:], side="right"), first + 1)
    speed = np.abs(command.values[:, 0])
    return np.array([speed[i:j].max() for i, j in zip(first, end, strict=True)])


def _running_median(rows: FloatArray, half: int = 4) -> FloatArray:
    padded = np.pad(rows, ((half, half), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    return np.asarray(np.median(windows, axis=-1))

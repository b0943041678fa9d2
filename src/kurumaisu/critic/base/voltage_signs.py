# SPDX-License-Identifier: BSD-3-Clause
"""Which of two rates a voltage stands for: the law as published gives one voltage to a slow turn either way."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu._core import AxisInverse, AxisLaw
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import Model
from kurumaisu.types import FloatArray, IntArray

_SHIFT = 0.5  # [s] over which a rate is seen, and by which the motion may come later
_HELD = 1.0  # [s] that a row counts for at most
_SIDES = (1.0, -1.0)
_CHANGE = 0.1  # [s] on the wrong branch that a change from one to the other costs


def voltage_signs(voltage: Series, command: Series | None, pose: Series | None, model: Model) -> FloatArray:
    """Return the signs of v and w that voltages stand for, (n, 2), nan where nothing tells.

    They are those of the rates given beside the voltages, else of the command, else of what the chair made of them.
    """
    signs = np.full((len(voltage.t), 2), np.nan)
    for i, (law, volts, rate) in enumerate(((model.translation, "v_f", "v"), (model.steering, "v_s", "w"))):
        if rate in voltage.columns:  # the very rates that the voltages stand for
            signs[:, i] = np.sign(voltage.column(rate))
        elif command is not None:
            held = np.searchsorted(command.t, voltage.t, side="right") - 1
            signs[:, i] = np.where(held >= 0, np.sign(command.column(rate)[np.maximum(held, 0)]), 0.0)
        elif pose is not None and len(pose.t) > 1:
            signs[:, i] = _signs_of_motion(law, voltage.t, voltage.column(volts), pose, i)
    return signs


def _signs_of_motion(law: AxisLaw, times: FloatArray, volts: FloatArray, pose: Series, channel: int) -> FloatArray:
    """Return the signs (n,) of the branches of a law along which the chair moved, nan where there is but one.

    Of all ways along the branches, that which lies nearest to the motion; each change costs something, for motion
    wavers and lags, but for those over 0 V, and only where the voltage changes is there one.
    """
    both = np.column_stack([AxisInverse(law).rates(volts, np.full(len(volts), side)) for side in _SIDES])
    undecided = (both[:, 0] > 0) & (both[:, 1] < 0)
    if not undecided.any():
        return np.full(len(volts), np.nan)
    held = np.minimum(np.diff(np.append(times, times[-1] + _HELD)), _HELD)
    seen = _rates(pose, times)[:, channel]
    errors = np.nan_to_num((both - seen[:, None]) ** 2 * held[:, None])
    gap = float(np.median(both[undecided, 0] - both[undecided, 1]))
    rests = (volts[1:] == 0) | (volts[:-1] == 0)
    prices = np.where(np.diff(volts) == 0, np.inf, np.where(rests, 0.0, _CHANGE * gap**2))
    chosen = _least_cost_branches(errors, prices)
    return np.where(undecided, np.array(_SIDES)[chosen], np.nan)


def _least_cost_branches(errors: FloatArray, prices: FloatArray) -> IntArray:
    """Return which of two states (n,) has the least sum of errors (n, 2) and prices (n - 1,) of changes."""
    total = errors[0]
    came = np.zeros(errors.shape, dtype=np.int64)
    for i in range(1, len(errors)):
        moved = total[::-1] + prices[i - 1]
        came[i] = np.where(moved < total, [1, 0], [0, 1])
        total = np.minimum(total, moved) + errors[i]
    states = np.empty(len(errors), dtype=np.int64)
    states[-1] = int(np.argmin(total))
    for i in range(len(errors) - 1, 0, -1):
        states[i - 1] = came[i, states[i]]
    return states


def _rates(pose: Series, times: FloatArray) -> FloatArray:
    """Return v [m/s] and w [rad/s] of the chair soon after times, (n, 2), nan where no pose tells."""
    before, after = (geometry.interpolate(pose.t, pose.values[:, :3], times + by) for by in (0.0, _SHIFT))
    step = geometry.between(before, after) / _SHIFT
    step[(times < pose.t[0]) | (times + _SHIFT > pose.t[-1])] = np.nan
    return np.asarray(step[:, [0, 2]])

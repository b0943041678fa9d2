# SPDX-License-Identifier: BSD-3-Clause
"""How other parts of a run say that the robot turned and stood: what an inertial sensor is held against."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import LONGEST_HOLD, Run, Series
from kurumaisu.types import BoolArray, FloatArray

STEP = 0.1  # [s] between the middles of spans that are compared
SPAN = 1.0  # [s] over which rates are averaged
_GAP = 0.5  # [s] without rows that a span may hold
_LATE = 1.5  # [s] for which a robot may move on that was asked to rest
_REST = (0.005, 0.005)  # [m/s], [rad/s] mean rates below which odometry stands


@dataclass(frozen=True)
class Turning:
    """What a part says of turning: means over SPAN about the times of the grid, (n,) [rad/s], nan where unknown."""

    name: str
    verb: str
    w: FloatArray


def grid(t: FloatArray) -> FloatArray:
    """Return the middles (n,) [s] of the spans of a series with times (m,)."""
    return np.arange(t[0] + SPAN / 2, t[-1] - SPAN / 2, STEP)


def means(t: FloatArray, rates: FloatArray, at: FloatArray) -> FloatArray:
    """Return the means over SPAN about times (n,) of rates (m, k) that were measured at times (m,) [s], (n, k)."""
    steps = (rates[1:] + rates[:-1]) / 2 * np.diff(t)[:, None]
    return over(t, np.vstack([np.zeros(rates.shape[1]), np.cumsum(steps, axis=0)]), at)


def over(t: FloatArray, whole: FloatArray, at: FloatArray) -> FloatArray:
    """Return what changes by `whole` (m, k) until times (m,) per second of SPAN about times (n,), (n, k)."""
    a, b = at - SPAN / 2, at + SPAN / 2
    changes = np.column_stack([np.interp(b, t, column) - np.interp(a, t, column) for column in whole.T]) / SPAN
    changes[(a < t[0] - STEP) | (b > t[-1] + STEP)] = np.nan
    for hole in np.flatnonzero(np.diff(t) > max(_GAP, 2.5 * float(np.median(np.diff(t))))):
        changes[(b > t[hole]) & (a < t[hole + 1])] = np.nan
    return changes


def turnings(run: Run, at: FloatArray) -> Iterator[Turning]:
    """Yield what says how a run turned, that first which says it best."""
    if run.odom is not None and len(run.odom.t) > 2:
        yield Turning("the odometry", "turns", over(run.odom.t, run.odom.column("theta")[:, None], at)[:, 0])
    if run.pose is not None and "theta" in run.pose.columns and len(run.pose.t) > 2:
        yield Turning("the reference", "turns", over(run.pose.t, run.pose.column("theta")[:, None], at)[:, 0])
    if run.command is not None and len(run.command.t) > 2:
        t, held = _held(run.command)
        yield Turning("the commands", "ask for", over(t, held, at)[:, 1])


def stands(run: Run, at: FloatArray) -> BoolArray:
    """Return which spans about times (n,) find the robot at rest, (n,): all that says how it moves says so."""
    known, rest = np.zeros(len(at), dtype=np.bool_), np.ones(len(at), dtype=np.bool_)
    if run.odom is not None and len(run.odom.t) > 2:
        rates = np.abs(np.column_stack([run.odom.column(name) for name in "vw"]))
        moved = means(run.odom.t, rates, at)
        known |= np.isfinite(moved).all(axis=1)
        rest &= (moved < _REST).all(axis=1) | np.isnan(moved).any(axis=1)
    if run.command is not None and len(run.command.t) > 2:
        t, held = _held(Series(run.command.t, np.abs(run.command.values), run.command.columns))
        asked = np.column_stack([over(t, held, at - late)[:, :2].sum(axis=1) for late in (0.0, _LATE / 2, _LATE)])
        known |= np.isfinite(asked).all(axis=1)
        rest &= ~(asked > 1e-9).any(axis=1)
    return np.asarray(known & rest)


def _held(command: Series) -> tuple[FloatArray, FloatArray]:
    """Return times (m,) and how far commands that are held until the next have asked to go and turn, (m, 2)."""
    t = np.append(command.t, command.t[-1] + LONGEST_HOLD)
    steps = np.diff(t)[:, None] * np.column_stack([command.column(name) for name in "vw"])
    whole = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    # What is held for long has no gap.
    fine = np.arange(t[0], t[-1], _GAP / 2)
    both = np.unique(np.concatenate([t, fine]))
    return both, np.column_stack([np.interp(both, t, column) for column in whole.T])

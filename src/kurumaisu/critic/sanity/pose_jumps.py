# SPDX-License-Identifier: BSD-3-Clause
"""Poses that go on from elsewhere, or at wrong stamps: relocalised, a heading wrapped wrongly, or late in coming."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.base.drive import from_voltages
from kurumaisu.critic.sanity.headings import position_noise
from kurumaisu.critic.sanity.rows import MOVING
from kurumaisu.critic.values.digits import moment, times
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.params import Model
from kurumaisu.types import BoolArray, FloatArray

_FAR = 10.0  # robust sd of the reference that a jump exceeds
_TURN = 0.6  # [rad] between two poses, least jump of a heading
_BUNCH = 4.0
_HALF = 0.4  # [rad] from half a turn
_LONG = 1.15  # of the way that the robot makes between poses at its fastest, from which a step is no drive
_CHANCE = 5.0  # sd of a position by which noise alone may lengthen a step: 3.5 of the difference of two
_LATE = 1.0  # [s] after which a chair has done what it was asked for
PAUSE = 5.0  # [s] without a pose after which nobody knows how far the robot was driven, or carried
_AROUND = 1.5  # [s] to either side that tell the speed, but
_SIDE = 8  # intervals at least
_BESIDE = 3  # intervals to either side that tell its direction
_LEAST = 40  # intervals while driving
_MISSING = 5.0  # times the mean interval, from which poses are missing: how fast the robot went there nobody knows
_CLEAR = 3.0  # sd of the positions' noise that a usual interval's way exceeds
_MOSTLY = 0.8  # share of the rows by which stamps are judged
_JITTER = 0.05  # [s] of their error, from which it is more than rows written on a grid
_TRUE = 0.7  # of the stamps' variation that the way follows, below which
_SURE = 4.0  # standard errors away from it the stamps are wrong


def asked(run: Run, model: Model) -> Series | None:
    """Return the rates v, w that a run was asked for, by its commands or else by its voltages; None without either."""
    if run.command is not None or run.voltage is None or not len(run.voltage.t):
        return run.command
    t, v, w = from_voltages(run, model)
    return Series(t, np.column_stack([v, w]), ("v", "w"))


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
    return pose.rows(new)


def _position(pose: Series, slack: float, command: Series | None) -> str | None:
    lasting, _ = jumps(pose, slack, command)
    if not lasting:
        return None
    i = lasting[0]
    size = float(np.hypot(*(pose.values[i, :2] - pose.values[i - 1, :2])))
    return (
        f"the reference pose jumps {times(len(lasting))} (first: {size:.2g} m at t = {moment(pose.t[i])}): relocalised?"
    )


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
            f"heading of the reference pose jumps {times(len(odd))} by half a turn ({first}): "
            f"wrapped wrongly, or atan instead of atan2"
        )
    return f"heading of the reference pose jumps {times(len(odd))} ({first}): relocalised, or wrapped wrongly"


def _lasts(theta: FloatArray, i: int) -> bool:
    before, after = np.median(theta[max(0, i - 3) : i + 1]), np.median(theta[i + 1 : i + 5])
    return bool(abs(after - before) > 0.6 * abs(theta[i + 1] - theta[i]))


def jumps(pose: Series, slack: float = 1.0, command: Series | None = None) -> tuple[list[int], list[int]]:
    """Return rows after which the position goes on from elsewhere, and rows that alone are elsewhere."""
    xy, dt = pose.values[:, :2], np.diff(pose.t)
    if len(xy) < 20:
        return [], []
    step = np.diff(xy, axis=0)
    padded = np.pad(step / dt[:, None], ((4, 4), (0, 0)), mode="reflect")  # no end counts more than once
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, 9, axis=0), axis=-1) * dt[:, None]
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


def problem(pose: Series) -> str | None:
    """Return what is wrong with the stamps of a reference, in words; None when the way made follows them.

    Over neighbouring intervals of a drive the way made is regressed on their lengths. True stamps give 1 whatever the
    gain of the odometry and the noise of the poses; poses that wait in a queue give 0.
    """
    new = fresh(pose)
    rows = _intervals(new, _rests(pose, new))
    if rows is None:
        return None
    longer, further, uneven = rows
    wander = float(np.quantile(np.abs(uneven), _MOSTLY))  # but for a few
    energy = float(longer @ longer)
    if wander < _JITTER or energy == 0:
        return None
    follows = float(longer @ further) / energy
    left = (further - follows * longer) / (1 - longer**2 / energy)  # of a fit without that interval: none decides alone
    error = float(np.sqrt(np.sum((longer * left) ** 2))) / energy
    jitter = (1 - follows) * wander
    if jitter < _JITTER or follows + _SURE * error > _TRUE:
        return None
    return (
        f"stamps of the reference pose look like times of arrival: for poses {np.diff(new.t).min():.2g} to "
        f"{np.diff(new.t).max():.2g} s apart, the distance follows their times only by {max(follows, 0.0):.2f} (true "
        f"stamps: 1), as if they were off by {jitter:.2g} s; record the time of measurement, or drop delayed poses"
    )


def _rests(pose: Series, new: Series) -> BoolArray:
    """Tell of each interval between fresh poses whether the robot rested in it: it repeated a pose, and hardly moved.

    A pose that waited in a queue repeats none.
    """
    repeated = np.diff(np.searchsorted(pose.t, new.t)) > 1
    way = np.hypot(*np.diff(new.values[:, :2], axis=0).T)
    return np.asarray(repeated & (way < MOVING * np.diff(new.t)))


def _intervals(pose: Series, rests: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return how much longer than its neighbours each interval is, how much further it went, and how uneven its stamp.

    All (n,) [s]; the last is how far the stamp at its end is from the even ones about it. rests (len(pose) - 1,):
    intervals that do not count, nor do those about them.
    """
    if len(pose.t) < _LEAST:
        return None
    dt = np.diff(pose.t)
    half = max(_SIDE, int(_AROUND / dt.mean()))
    if len(dt) < _LEAST + 2 * half:
        return None
    way = _along(pose.values[:, :2])
    around = np.ones(2 * half + 1)
    there = dt < _MISSING * float(dt.mean())
    number, time, gone = (np.convolve(each, around, mode="same") for each in (1.0 * there, dt * there, way * there))
    speed, usual = gone / np.maximum(time, 1e-9), time / np.maximum(number, 1.0)
    driving = there & (speed * usual > _CLEAR * position_noise(pose))
    driving &= np.convolve((dt > PAUSE) | rests, around, mode="same") == 0
    driving[:half] = driving[-half:] = False
    if driving.sum() < _LEAST:
        return None
    longer = np.where(there, dt - usual, 0.0)
    drift = np.cumsum(longer)
    uneven = drift - np.convolve(drift, around / len(around), mode="same")
    return longer[driving], (way / np.maximum(speed, 1e-9) - usual)[driving], uneven[driving]


def _along(places: FloatArray) -> FloatArray:
    """Return how far (n - 1,) [m] a robot went between places (n, 2), along its way: noise adds to a length."""
    last = len(places) - 1
    rows = np.arange(last)
    ahead = places[np.minimum(rows + 1 + _BESIDE, last)] - places[np.maximum(rows - _BESIDE, 0)]
    unit = ahead / np.maximum(np.hypot(*ahead.T), 1e-9)[:, np.newaxis]
    return np.asarray(np.sum(np.diff(places, axis=0) * unit, axis=1))

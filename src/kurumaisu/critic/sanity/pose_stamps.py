# SPDX-License-Identifier: BSD-3-Clause
"""Stamps that say when a pose came, not when it was: the way made between two poses does not go with their times."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.sanity.headings import position_noise
from kurumaisu.critic.sanity.pose_jumps import PAUSE, fresh
from kurumaisu.critic.sanity.rows import MOVING
from kurumaisu.critic.values.recording import Series
from kurumaisu.types import BoolArray, FloatArray

_AROUND = 1.5  # [s] to either side that tell the speed, but
_HALF = 8  # intervals at least
_BESIDE = 3  # intervals to either side that tell its direction
_LEAST = 40  # intervals while driving
_MISSING = 5.0  # times the mean interval, from which poses are missing: how fast the robot went there nobody knows
_CLEAR = 3.0  # sd of the positions' noise that a usual interval's way exceeds
_MOSTLY = 0.8  # share of the rows by which stamps are judged
_JITTER = 0.05  # [s] of their error, from which it is more than rows written on a grid
_TRUE = 0.7  # of the stamps' variation that the way follows, below which
_SURE = 4.0  # standard errors away from it the stamps are wrong


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
    half = max(_HALF, int(_AROUND / dt.mean()))
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

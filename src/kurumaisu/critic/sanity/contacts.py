# SPDX-License-Identifier: BSD-3-Clause
"""Times in which a chair was held: it is asked to move, and stands, as it does nowhere else when asked for as much."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base.drive import GRID, prepare
from kurumaisu.critic.sanity.rows import stretches
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.types import BoolArray, FloatArray

TOPIC = "collision"  # a quantity that says so itself
_ASKED = np.array([0.1, 0.2])  # [m/s], [rad/s] from which a chair is asked to move
_STANDS = 0.15  # share of that below which it stands
_LATEST = 0.6  # [s] by which a chair may answer late
_BEFORE = 0.2  # [s] beyond that for which it must have been asked, in whichever axis
_NOISE = 3.0  # sds of such a rate by errors of the reference, that one which stands may seem to have
_MOST_SEEN = 0.5  # share of what it is asked for that it may seem to have by them
_WINDOW = 0.4  # [s] over which its rates are taken
_LEAST = 0.4  # [s] of standing, beyond the window
_LIKE = (0.7, 1.4)  # times what is asked for, of which it is known what the chair does elsewhere
_MOVES = 0.7  # share of that time in which it moves, at least
_MARGINS = (0.4, 1.0)  # [s] before and after, in which it is stopped, and gets going again


def contacts(run: Run, model: Model) -> tuple[tuple[float, float], ...]:
    """Return the spans of time [s] in which the chair was held, by a quantity that says so, else by its motion."""
    spans = _said(run.covariates[TOPIC]) if TOPIC in run.covariates else _seen(run, model)
    return _merged([(a - _MARGINS[0], b + _MARGINS[1]) for a, b in spans])


def _said(series: Series) -> Iterator[tuple[float, float]]:
    """Yield the spans in which a quantity is not 0; each value holds until the next."""
    ends = np.append(series.t[1:], series.t[-1])
    for a, b in zip(*stretches(series.values[:, 0] != 0), strict=True):
        yield float(series.t[a]), float(ends[b - 1])


def _seen(run: Run, model: Model) -> Iterator[tuple[float, float]]:
    if run.pose is None or run.pose_source != "measured":
        return
    try:
        drive = prepare(run, model)
    except Error:
        return
    t = drive.start + GRID * np.arange(len(drive.v))
    after = np.clip(np.searchsorted(run.pose.t, t), 1, len(run.pose.t) - 1)
    inside = (t > drive.times[0] + _WINDOW) & (t < drive.times[-1] - _WINDOW)
    inside &= run.pose.t[after] - run.pose.t[after - 1] < _WINDOW  # nobody knows what is within a gap
    asked = np.column_stack([drive.v, drive.w])
    ends = (geometry.interpolate(run.pose.t, run.pose.values[:, :3], t + by) for by in (-_WINDOW / 2, _WINDOW / 2))
    driven = np.abs(geometry.between(*ends)[:, [0, 2]] / _WINDOW)
    late = _BEFORE + _answer(np.abs(asked[inside]), driven[inside])
    wanted = _held((np.abs(asked) > _ASKED).any(axis=1), round(late / GRID))
    small = np.maximum(_STANDS * np.abs(asked), _STANDS * _ASKED)
    sds = third_difference_sd(run.pose.values[:, :3]) if len(run.pose.t) > 3 else np.zeros(3)
    sds = np.sqrt(2) / _WINDOW * np.array([max(sds[:2]), sds[2]])  # of rates, by errors that differ from row to row
    small = np.minimum(np.hypot(small, _NOISE * sds), np.maximum(_MOST_SEEN * _ASKED, small))
    stands = inside & wanted & (driven < small).all(axis=1)
    for a, b in zip(*stretches(stands), strict=True):
        if (b - a) * GRID >= _LEAST and _is_odd(asked[a:b], asked, wanted, stands):
            yield float(t[a]), float(t[b - 1])


def _is_odd(here: FloatArray, asked: FloatArray, wanted: BoolArray, stands: BoolArray) -> bool:
    """Tell whether the chair moves elsewhere when about the same is asked for."""
    size = np.maximum(np.median(np.abs(here), axis=0), _ASKED)
    as_much = (np.abs(asked) < _LIKE[1] * size).all(axis=1)
    alike = wanted & as_much & (np.abs(asked) > _LIKE[0] * size).any(axis=1)
    return bool(alike.any() and 1 - stands[alike].mean() >= _MOVES)


def _answer(asked: FloatArray, driven: FloatArray) -> float:
    """Return by how much [s] what is driven (n, 2) is behind what is asked, where they are most alike."""
    one, other = (np.linalg.norm(rates / _ASKED, axis=1) for rates in (asked, driven))
    shifts = [k for k in range(round(_LATEST / GRID) + 1) if k < len(one) - 1]
    alike = [one[: len(one) - k] @ other[k:] / max(float(np.linalg.norm(one[: len(one) - k])), 1e-9) for k in shifts]
    return GRID * shifts[int(np.argmax(alike))] if shifts else _LATEST


def _held(flags: BoolArray, count: int) -> BoolArray:
    """Return where flags (n,) have held for so many samples."""
    sums = np.concatenate([[0], np.cumsum(flags)])
    out = np.zeros_like(flags)
    out[count - 1 :] = sums[count:] - sums[:-count] == count
    return out


def _merged(spans: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    out: list[tuple[float, float]] = []
    for a, b in sorted(spans):
        if out and a <= out[-1][1]:
            out[-1] = out[-1][0], max(out[-1][1], b)
        else:
            out.append((a, b))
    return tuple(out)

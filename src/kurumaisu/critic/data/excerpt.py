# SPDX-License-Identifier: BSD-3-Clause
"""Pieces of a drive: from one time to another, and without some rows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error, told
from kurumaisu.types import BoolArray

_HELD = ("command", "voltage")
_MEASURED = ("pose", "odom", "scan")
_BESIDE = ("imu",)  # measured, too, but no drive begins or ends with it


@dataclass(frozen=True)
class Moment:
    """A time [s]: as it stands in tables and messages, or since the first row of its drive."""

    seconds: float
    since_start: bool = False

    def of(self, run: Run) -> float:
        """Return the time in a run [s]."""
        return self.seconds + (span(run)[0] if self.since_start else 0.0)


@dataclass(frozen=True)
class Gap:
    """Rows to leave out, of one part or, without a name, of all that was measured."""

    part: str
    start: Moment
    stop: Moment


@dataclass(frozen=True)
class Excerpt:
    """What of each drive is used; None: from its beginning, to its end."""

    start: Moment | None = None
    stop: Moment | None = None
    without: tuple[Gap, ...] = ()


WHOLE = Excerpt()


def moment(text: str) -> Moment:
    """Return the time that 12.5 or +12.5 means. Raise Error for what is no number."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise Error(f"must be a time in seconds, as 12.5, or +12.5 since the drive began: {told(text)}")
    return Moment(seconds, text.strip().startswith("+"))


def gap(text: str) -> Gap:
    """Return the rows that [PART:]FROM..TO means. Raise Error for anything else."""
    part, colon, times = text.rpartition(":")
    start, dots, stop = times.partition("..")
    if not dots or (colon and part not in (*_HELD, *_MEASURED, *_BESIDE)):
        parts = ", ".join((*_MEASURED, *_BESIDE, *_HELD))
        raise Error(f"must be FROM..TO or PART:FROM..TO in seconds, with a part of {parts}: {told(text)}")
    return Gap(part, moment(start), moment(stop))


def span(run: Run) -> tuple[float, float]:
    """Return the first and the last time of any part of a run [s]. Raise Error for one that has none."""
    parts = [part for name in (*_HELD, *_MEASURED) if (part := _part(run, name)) is not None]
    if not parts:
        raise Error(f"{run.name}: has no part of a run")
    return min(float(part.t[0]) for part in parts), max(float(part.t[-1]) for part in parts)


def cut(run: Run, excerpt: Excerpt, faults: Faults) -> Run:
    """Return what is asked for of a run; faults gets how much was left out.

    A command or a voltage that was held when the piece begins is its first row.
    Raise Error naming run and times where nothing is left.
    """
    if excerpt == WHOLE:
        return run
    first, last = span(run)
    start = first if excerpt.start is None else excerpt.start.of(run)
    stop = last if excerpt.stop is None else excerpt.stop.of(run)
    if not start < stop or start > last or stop < first:
        raise Error(
            f"{run.name}: lasts from {first:.6f} to {last:.6f} s: nothing is left from {start:.6f} to {stop:.6f} s"
        )
    names = (*_HELD, *_MEASURED, *_BESIDE)
    parts = {name: _left(run, name, start, stop, excerpt.without, faults) for name in names}
    covariates = {name: _between(series, start, stop, held=False) for name, series in run.covariates.items()}
    queries = run.queries
    if queries is not None:
        queries = queries[(queries[:, 0] >= start) & (queries[:, 1] <= stop)]
    return replace(
        run,
        command=parts["command"],
        voltage=parts["voltage"],
        pose=parts["pose"],
        odom=parts["odom"],
        scan=parts["scan"],
        imu=parts["imu"],
        covariates={name: series for name, series in covariates.items() if series is not None},
        queries=queries,
    )


def _left(run: Run, name: str, start: float, stop: float, without: tuple[Gap, ...], faults: Faults) -> Series | None:
    whole = _part(run, name)
    if whole is None:
        return None
    part = _between(whole, start, stop, held=name in _HELD)
    for wanted in without:
        if part is not None and (wanted.part == name or (not wanted.part and name not in _HELD)):
            inside = (part.t >= wanted.start.of(run)) & (part.t <= wanted.stop.of(run))
            part = _rows(part, ~inside)
    left_out = len(whole.t) - (0 if part is None else len(part.t))
    if left_out > 0:
        faults.add(f"{run.name}: {left_out} of {len(whole.t)} rows of {name} are left out, as asked")
    return part


def _part(run: Run, name: str) -> Series | None:
    part: Series | None = getattr(run, name)
    return part


def _between(series: Series, start: float, stop: float, *, held: bool) -> Series | None:
    before = int(np.searchsorted(series.t, start, side="right")) - 1
    if held and before >= 0:
        series = Series(np.maximum(series.t[before:], start), series.values[before:], series.columns)
    return _rows(series, (series.t >= start) & (series.t <= stop))


def _rows(series: Series, keep: BoolArray) -> Series | None:
    return Series(series.t[keep], series.values[keep], series.columns) if keep.any() else None

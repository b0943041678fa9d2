# SPDX-License-Identifier: BSD-3-Clause
"""Pieces of a drive: from one time to another, without some rows, or spread over a very long one; and when it began."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.errors import Error, told
from kurumaisu.types import BoolArray

_HELD = ("command", "voltage")
_MEASURED = ("pose", "odom", "scan")
_DRIVEN = (*_HELD, "pose", "odom")  # that tell when a drive was
_BESIDE = ("imu",)  # measured, too, but no drive begins or ends with it
_NAMES = (*_HELD, *_MEASURED, *_BESIDE)
LONGEST = 5400.0  # [s] of a run that is criticised whole
_PIECES, _PIECE = 6, 600.0  # pieces of a longer one, [s] each: an hour, from its beginning to its end
_FEWEST = 2  # runs to learn from; one by itself has a time already


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
    if not dots or (colon and part not in _NAMES):
        parts = ", ".join((*_MEASURED, *_BESIDE, *_HELD))
        raise Error(f"must be FROM..TO or PART:FROM..TO in seconds, with a part of {parts}: {told(text)}")
    return Gap(part, moment(start), moment(stop))


def span(run: Run, *names: str) -> tuple[float, float]:
    """Return the first and the last time [s] of some parts of a run, by default all. Raise Error for one of none."""
    parts = run.parts(*(names or (*_HELD, *_MEASURED))).values()
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
    piece = between(run, start, stop, held=False)
    for wanted in excerpt.without:
        since, until = wanted.start.of(run), wanted.stop.of(run)
        for name in (wanted.part,) if wanted.part else (*_MEASURED, *_BESIDE):
            if (part := getattr(piece, name)) is not None:
                outside: dict[str, Any] = {name: _kept(part, (part.t < since) | (part.t > until))}
                piece = replace(piece, **outside)
    for name, whole in run.parts(*_NAMES).items():
        part = getattr(piece, name)
        left_out = len(whole.t) - (0 if part is None else len(part.t))
        if left_out > 0:
            faults.add(f"{run.name}: {left_out} of {len(whole.t)} rows of {name} are left out, as asked")
    return piece


def between(run: Run, start: float, stop: float, *, held: bool) -> Run:
    """Return a run from one time [s] to another, with the inputs that hold when it begins; held: covariates, too."""
    parts: dict[str, Any] = {n: _between(part, start, stop, held=n in _HELD) for n, part in run.parts().items()}
    covariates = {name: _between(series, start, stop, held=held) for name, series in run.covariates.items()}
    queries = run.queries
    if queries is not None:
        queries = queries[(queries[:, 0] >= start) & (queries[:, 1] <= stop)]
    known = {name: series for name, series in covariates.items() if series is not None}
    return replace(run, covariates=known, queries=queries, **parts)


def _between(series: Series, start: float, stop: float, *, held: bool) -> Series | None:
    before = int(np.searchsorted(series.t, start, side="right")) - 1
    if held and before >= 0:
        series = Series(np.maximum(series.t[before:], start), series.values[before:], series.columns)
    return _kept(series, (series.t >= start) & (series.t <= stop))


def _kept(series: Series, keep: BoolArray) -> Series | None:
    return series.rows(keep) if keep.any() else None


def bounded(recording: Recording) -> Recording:
    """Return the recording with pieces in place of runs that are too long; problems says so."""
    runs: list[Run] = []
    notes: list[str] = []
    names: dict[str, tuple[str, ...]] = {}
    for run in recording.runs:
        pieces = _pieces(run)
        runs += pieces
        names[run.name] = tuple(piece.name for piece in pieces)
        if len(pieces) > 1:
            notes.append(
                f"{run.name}: lasts {_length(run) / 3600:.1f} h: {_PIECES} pieces of {_PIECE / 60:.0f} min are "
                f"criticised, spread over it; split the run to have all of it criticised"
            )
    if not notes:
        return recording
    return replace(
        recording,
        runs=tuple(runs),
        train=tuple(piece for name in recording.train for piece in names[name]),
        test=tuple(piece for name in recording.test for piece in names[name]),
        problems=(*recording.problems, *notes),
    )


def _length(run: Run) -> float:
    return 0.0 if run.pose is None else float(run.pose.t[-1] - run.pose.t[0])


def _pieces(run: Run) -> list[Run]:
    if run.pose is None or _length(run) <= LONGEST:
        return [run]
    starts = np.linspace(run.pose.t[0], run.pose.t[-1] - _PIECE, _PIECES)
    pieces = [between(run, float(start), float(start) + _PIECE, held=True) for start in starts]
    asked = [None if piece.queries is None or not len(piece.queries) else piece.queries for piece in pieces]
    names = [f"{run.name}[{i + 1}/{_PIECES}]" for i in range(_PIECES)]
    return [replace(p, name=name, queries=q) for p, name, q in zip(pieces, names, asked, strict=True)]


def with_elapsed_time(recording: Recording) -> Recording:
    """Return the recording with the time since its first run began as a covariate of each run.

    Runs follow each other as they are listed: by their stamps if these go on from one to the next, else, where each
    begins its own clock, without a break. A covariate of this name that was measured is left as it is.
    """
    if len(recording.train) < _FEWEST or any(effects.RECORDING_TIME in run.covariates for run in recording.runs):
        return recording
    if not all(run.parts(*_DRIVEN) for run in recording.runs):
        return recording
    starts, ends = np.array([span(run, *_DRIVEN) for run in recording.runs]).T
    if (starts[1:] >= ends[:-1]).all():
        offsets = np.full(len(starts), -starts[0])
    else:
        offsets = np.append(0.0, np.cumsum(ends - starts)[:-1]) - starts
    runs = []
    for run, times, offset in zip(recording.runs, np.stack([starts, ends], axis=1), offsets, strict=True):
        series = Series(times, (times + offset)[:, np.newaxis], (effects.RECORDING_TIME,))
        runs.append(replace(run, covariates={**run.covariates, effects.RECORDING_TIME: series}))
    return replace(recording, runs=tuple(runs))

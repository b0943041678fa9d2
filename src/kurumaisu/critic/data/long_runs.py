# SPDX-License-Identifier: BSD-3-Clause
"""A very long run as pieces spread over it: memory and time stay bounded, and what was left out is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.values.recording import Recording, Run, Series

LONGEST = 5400.0  # [s] of a run that is criticised whole
_PIECES, _PIECE = 6, 600.0  # pieces of a longer one, [s] each: an hour, from its beginning to its end


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
    return [_piece(run, f"{run.name}[{i + 1}/{_PIECES}]", float(start)) for i, start in enumerate(starts)]


def _piece(run: Run, name: str, start: float) -> Run:
    end = start + _PIECE
    covariates = {key: _within(series, start, end, held=True) for key, series in run.covariates.items()}
    kept = {key: series for key, series in covariates.items() if series is not None}
    queries = None
    if run.queries is not None:
        inside = (run.queries[:, 0] >= start) & (run.queries[:, 1] <= end)
        queries = run.queries[inside] if inside.any() else None
    return replace(
        run,
        name=name,
        command=_within(run.command, start, end, held=True),
        voltage=_within(run.voltage, start, end, held=True),
        pose=_within(run.pose, start, end, held=False),
        odom=_within(run.odom, start, end, held=False),
        scan=_within(run.scan, start, end, held=False),
        imu=_within(run.imu, start, end, held=False),
        covariates=kept,
        queries=queries,
    )


def _within(series: Series | None, start: float, end: float, *, held: bool) -> Series | None:
    """Return the samples of a time, None where there are none; held: with the one that holds when it begins."""
    if series is None:
        return None
    first = int(np.searchsorted(series.t, start))
    last = int(np.searchsorted(series.t, end, side="right"))
    t, values = series.t[first:last], series.values[first:last]
    if held and first and (not len(t) or t[0] > start):
        t, values = np.r_[start, t], np.vstack([series.values[first - 1 : first], values])
    return Series(t, values, series.columns) if len(t) else None

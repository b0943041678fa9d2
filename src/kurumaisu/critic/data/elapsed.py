# SPDX-License-Identifier: BSD-3-Clause
"""How long a recording has gone on: what changes from run to run follows it, as a battery or a tyre does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.values.recording import Recording, Run, Series

_FEWEST = 2  # runs to learn from; one by itself has a time already


def with_elapsed_time(recording: Recording) -> Recording:
    """Return the recording with the time since its first run began as a covariate of each run.

    Runs follow each other as they are listed: by their stamps if these go on from one to the next, else, where each
    begins its own clock, without a break. A covariate of this name that was measured is left as it is.
    """
    if len(recording.train) < _FEWEST or any(effects.RECORDING_TIME in run.covariates for run in recording.runs):
        return recording
    spans = [_span(run) for run in recording.runs]
    if any(span is None for span in spans):
        return recording
    starts, ends = np.array(spans, dtype=np.float64).T
    if (starts[1:] >= ends[:-1]).all():
        offsets = np.full(len(starts), -starts[0])
    else:
        offsets = np.append(0.0, np.cumsum(ends - starts)[:-1]) - starts
    return replace(recording, runs=tuple(map(_with, recording.runs, starts, ends, offsets)))


def _span(run: Run) -> tuple[float, float] | None:
    series = [part for part in (run.command, run.voltage, run.pose, run.odom) if part is not None and len(part.t)]
    if not series:
        return None
    return min(float(part.t[0]) for part in series), max(float(part.t[-1]) for part in series)


def _with(run: Run, start: float, end: float, offset: float) -> Run:
    times = np.array([start, end])
    series = Series(times, (times + offset)[:, np.newaxis], (effects.RECORDING_TIME,))
    return replace(run, covariates={**run.covariates, effects.RECORDING_TIME: series})

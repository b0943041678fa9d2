# SPDX-License-Identifier: BSD-3-Clause
"""What a recording knows beside the rates, on a drive's grid: where the chair was, the voltages, further columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu import _core, effects, geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, driven, prepare_all
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_SMOOTH = 1.0  # [s] before and after a row
# A chair that has just stopped nods, and its laser with it; what is tied to it loosely lags behind when it speeds up.
_PAST = ("since_command", "since_rest", "since_reversal", "acceleration", "yaw_acceleration")


def with_covariates(drive: Drive, run: Run) -> Drive:
    """Return the drive with what its run knows on the grid.

    Poses are the reference's, not the simulated ones: those drift away from where the chair was. But what the reference
    errs from row to row must not pass for where the chair was: an error would follow itself. Voltages are held, further
    quantities are taken to change evenly between their samples.
    """
    middle, poses = _middle(drive), _smoothed(drive)
    places = {name: np.interp(middle, drive.times, poses[:, i]) for i, name in enumerate(("x", "y", "heading"))}
    return replace(drive, known={**with_covariates_but_place(drive, run).known, **places})


def with_covariates_but_place(drive: Drive, run: Run) -> Drive:
    """Return the drive with what its run knows on the grid, but for where the chair was."""
    middle = _middle(drive)
    known = {name: np.interp(middle, series.t, series.values[:, 0]) for name, series in run.covariates.items()}
    if run.voltage is not None:
        held = np.maximum(np.searchsorted(run.voltage.t, middle, side="right") - 1, 0)
        known |= {name: run.voltage.column(name)[held] for name in ("v_f", "v_s")}
    return replace(drive, known={**drive.known, **known})


def with_past(recording: Recording, model: Model) -> Recording:
    """Return the recording with what went before, by the model's drives, as covariates of each run that has scans.

    A covariate of such a name that was measured is left as it is. Before the first time, it is as long ago as the run.
    """
    return replace(recording, runs=tuple(_with_past(run, model) for run in recording.runs))


def _with_past(run: Run, model: Model) -> Run:
    if run.scan is None or not len(run.scan.t) or run.pose is None or not driven(run):
        return run
    drive = prepare_all(run, model, float(run.scan.t[-1]))
    motion, middle = replay.motion(drive, model, ()), _middle(drive)
    known = {}
    for name in _PAST:
        if (name, drive.source) != ("since_command", "odom"):  # rows of odometry are no commands
            values = effects.Follower(name, 0.0).values(motion)
            past = np.where(np.isfinite(values), values, middle[-1] - middle[0])
            known[name] = Series(middle, past[:, np.newaxis], (name,))
    return replace(run, covariates={**known, **run.covariates})


def _smoothed(drive: Drive) -> FloatArray:
    """Return the reference's poses (m + 1, 3), what they are off the way that was asked for being its local mean."""
    edges = drive.start + GRID * np.arange(len(drive.v) + 1)
    path = _core.integrate(drive.v, drive.w, np.full(len(drive.v), GRID), [0.0, 0.0, 0.0])
    asked = geometry.interpolate(edges, path, drive.times)
    steps = drive.in_map(geometry.between(asked[:-1], asked[1:]))
    way = np.cumsum(np.vstack([drive.poses[:1], steps]), axis=0)
    rows = np.arange(len(way))
    half = np.minimum(round(_SMOOTH / float(np.median(np.diff(drive.times)))), np.minimum(rows, len(way) - 1 - rows))
    sums = np.vstack([np.zeros(3), np.cumsum(drive.poses - way, axis=0)])
    return np.asarray(way + (sums[rows + half + 1] - sums[rows - half]) / (2 * half + 1)[:, np.newaxis])


def _middle(drive: Drive) -> FloatArray:
    return np.asarray(drive.start + GRID * (np.arange(len(drive.v)) + 0.5))

# SPDX-License-Identifier: BSD-3-Clause
"""What a recording knows beside the rates, on a drive's grid: where the chair was, the voltages, further columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu import _core, geometry
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.values.recording import Run
from kurumaisu.types import FloatArray

_SMOOTH = 1.0  # [s] before and after a row


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

# SPDX-License-Identifier: BSD-3-Clause
"""What a recording knows beside the rates, on a drive's grid: where the chair was, the voltages, further columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.types import FloatArray


def with_covariates(drive: Drive, run: Run) -> Drive:
    """Return the drive with what its run knows on the grid.

    Poses are the reference's, not the simulated ones: those drift away from where the chair was. Voltages are held,
    further quantities are taken to change evenly between their samples.
    """
    middle = _middle(drive)
    places = {name: np.interp(middle, drive.times, drive.poses[:, i]) for i, name in enumerate(("x", "y", "heading"))}
    return replace(drive, known={**with_covariates_but_place(drive, run).known, **places})


def with_covariates_but_place(drive: Drive, run: Run) -> Drive:
    """Return the drive with what its run knows on the grid, but for where the chair was."""
    middle = _middle(drive)
    known = {name: np.interp(middle, series.t, series.values[:, 0]) for name, series in run.covariates.items()}
    if run.voltage is not None:
        known |= {name: _held(run.voltage, name, middle) for name in ("v_f", "v_s")}
    return replace(drive, known={**drive.known, **known})


def _middle(drive: Drive) -> FloatArray:
    return np.asarray(drive.start + GRID * (np.arange(len(drive.v)) + 0.5))


def _held(series: Series, column: str, at: FloatArray) -> FloatArray:
    index = np.searchsorted(series.t, at, side="right") - 1
    return np.asarray(series.column(column)[np.maximum(index, 0)])

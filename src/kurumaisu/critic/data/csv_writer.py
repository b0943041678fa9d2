# SPDX-License-Identifier: BSD-3-Clause
"""Write a run as the CSV tables that csv_reader reads."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.types import FloatArray


def write_csv_run(folder: Path, run: Run) -> None:
    """Write a run into folder, which is made; reading it back gives the same arrays to the last bit.

    The fan of a bag has no place in CSV: put it into meta.yaml.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for part in ("command", "voltage", "pose", "odom", "scan"):
        series: Series | None = getattr(run, part)
        if series is not None:
            _write(folder / f"{part}.csv", ("t", *series.columns), np.column_stack([series.t, series.values]))
    if run.covariates:
        _write(folder / "covariate.csv", ("t", *run.covariates), _side_by_side(list(run.covariates.values())))
    if run.queries is not None:
        _write(folder / "query.csv", ("t0", "t1"), run.queries)


def _side_by_side(covariates: Sequence[Series]) -> FloatArray:
    """Return rows (n, 1 + covariates), one per time of any sample, nan where a covariate has none."""
    t = np.unique(np.concatenate([series.t for series in covariates]))
    rows = np.full((len(t), 1 + len(covariates)), np.nan)
    rows[:, 0] = t
    for i, series in enumerate(covariates):
        rows[np.searchsorted(t, series.t), i + 1] = series.values[:, 0]
    return rows


def _write(path: Path, columns: Sequence[str], rows: FloatArray) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        # Python floats print with as many digits as it takes to read them back exactly.
        writer.writerows(rows.tolist())

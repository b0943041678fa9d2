# SPDX-License-Identifier: BSD-3-Clause
"""Write a run as the CSV tables that csv_reader reads."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu.critic.values.recording import PARTS, Run, Series
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole


def write_csv_run(folder: Path, run: Run) -> None:
    """Write a run into folder, which is made; reading it back gives the same arrays to the last bit.

    The fan of a bag has no place in CSV: put it into meta.yaml. Raise Error naming what cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    tables = {}
    for part in PARTS:
        series: Series | None = getattr(run, part)
        if series is not None:
            tables[part] = _text(("t", *series.columns), np.column_stack([series.t, series.values]))
    if run.covariates:
        tables["covariate"] = _text(("t", *run.covariates), _side_by_side(list(run.covariates.values())))
    if run.queries is not None:
        tables["query"] = _text(("t0", "t1"), run.queries)
    write_whole({folder / f"{name}.csv": text for name, text in tables.items()})


def _side_by_side(covariates: Sequence[Series]) -> FloatArray:
    """Return rows (n, 1 + covariates), one per time of any sample, nan where a covariate has none."""
    t = np.unique(np.concatenate([series.t for series in covariates]))
    rows = np.full((len(t), 1 + len(covariates)), np.nan)
    rows[:, 0] = t
    for i, series in enumerate(covariates):
        rows[np.searchsorted(t, series.t), i + 1] = series.values[:, 0]
    return rows


def _text(columns: Sequence[str], rows: FloatArray) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    # Python floats print with as many digits as it takes to read them back exactly.
    writer.writerows(rows.tolist())
    return text.getvalue()

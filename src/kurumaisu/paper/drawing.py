# SPDX-License-Identifier: BSD-3-Clause
"""The figures as SVG, the same to the last byte for the same data, and their data as CSV beside them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

MEASURED, LINE, PAPER, FAINT = "#1f5f8b", "#c0392b", "#444444", "#b9c4cc"
_STYLE = {
    "svg.fonttype": "none",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e3e6e8",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.markersize": 3.5,
}


@contextmanager
def figure(path: Path, rows: int, columns: int, size: tuple[float, float]) -> Iterator[Any]:
    """Give axes (rows, columns) to draw on, and write them to a file. Raise Error naming it."""
    import matplotlib as mpl  # takes long to load, and few ask for pictures
    from matplotlib.figure import Figure

    with mpl.rc_context({**_STYLE, "svg.hashsalt": path.stem}):
        drawn = Figure(figsize=size, layout="constrained", facecolor="white")
        yield drawn.subplots(rows, columns, squeeze=False)
        text = io.StringIO()
        drawn.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    # spaces at the ends of lines are matplotlib's, and no editor's
    lines = [line.rstrip() for line in text.getvalue().splitlines()]
    write(path, "\n".join(lines) + "\n")


def table(path: Path, columns: Mapping[str, FloatArray | Sequence[object]], digits: int = 6) -> None:
    """Write named columns of one length; numbers with so many digits behind the point. Raise Error naming the file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow([f"{cell:.{digits}f}" if isinstance(cell, (float, np.floating)) else cell for cell in row])
    write(path, text.getvalue())


def write(path: Path, text: str) -> None:
    """Write a file and its folder. Raise Error naming it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from error
    write_whole({path: text})

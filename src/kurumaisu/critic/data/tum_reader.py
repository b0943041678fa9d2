# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories as the TUM benchmark and evo write them: t, x, y, z and a quaternion x, y, z, w, with blanks between."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.bounded_files import MOST_TABLE, read_text
from kurumaisu.errors import Error, told
from kurumaisu.plausible import yaw_or_nan
from kurumaisu.types import FloatArray

SUFFIX = ".tum"
_NUMBERS = 8


def read_tum(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and poses (n, 3) of x, y [m], theta [rad], nan for a quaternion without a yaw.

    Raise Error naming file and line for what is no such row.
    """
    rows = []
    for number, line in enumerate(read_text(path, MOST_TABLE, "utf-8-sig").splitlines(), 1):
        cells = line.split("#")[0].split()
        if cells:
            rows.append(_row(f"{path}:{number}", cells))
    table = np.array(rows, dtype=np.float64).reshape(-1, _NUMBERS)
    theta = [yaw_or_nan(*row[4:]) for row in table.tolist()]
    return table[:, 0], np.column_stack([table[:, 1:3], theta])


def _row(where: str, cells: list[str]) -> list[float]:
    if len(cells) != _NUMBERS:
        raise Error(f"{where}: has {len(cells)} numbers, and not the 8 of t x y z qx qy qz qw")
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        raise Error(f"{where}: is not a row of numbers: {told(' '.join(cells))}") from None

# SPDX-License-Identifier: BSD-3-Clause
"""Scans put aside in a file: those of an hour are a hundred megabytes, of which a viewer needs one at a time."""

from __future__ import annotations

import os
import tempfile

import numpy as np
from numpy.typing import NDArray

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

Floats = NDArray[np.float32]
_TYPE = np.dtype(np.float32)  # as in a bag; at 4 m good to a micrometre


class Spool:
    """Scans in a temporary file that is gone with the program; all like the first, with intensities or without."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="kurumaisu_scans_")  # noqa: SIM115
        self._beams = -1
        self._rows = 1  # of a scan: ranges, and intensities, too
        self._count = 0

    def put(self, ranges: FloatArray, intensities: FloatArray | None = None) -> int:
        """Put a scan's ranges and intensities (b,) aside; return its number, -1 where it is not as long as the first.

        Raise Error when there is no room.
        """
        if self._beams < 0:
            self._beams = len(ranges)
            self._rows = 1 if intensities is None else 2
        if len(ranges) != self._beams:
            return -1
        rows = np.full((self._rows, self._beams), np.nan, dtype=_TYPE)
        rows[0] = ranges
        if intensities is not None:
            rows[1:] = intensities
        try:
            self._file.write(rows.tobytes())
        except OSError as error:
            raise Error(
                f"{tempfile.gettempdir()}: {error.strerror}: no room for scans; TMPDIR names another"
            ) from error
        self._count += 1
        return self._count - 1

    def get(self, number: int) -> tuple[Floats, Floats | None]:
        """Return the ranges of a scan, and its intensities if there are any."""
        assert 0 <= number < self._count
        size = self._rows * self._beams * _TYPE.itemsize
        self._file.flush()
        rows = np.frombuffer(os.pread(self._file.fileno(), size, number * size), dtype=_TYPE).reshape(self._rows, -1)
        return rows[0], rows[1] if len(rows) > 1 else None

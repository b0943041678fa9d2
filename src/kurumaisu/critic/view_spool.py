# SPDX-License-Identifier: BSD-3-Clause
"""Scans put aside in a file: those of an hour are a hundred megabytes, of which a viewer needs one at a time."""

from __future__ import annotations

import os
import tempfile

import numpy as np
from numpy.typing import NDArray

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

_TYPE = np.dtype(np.float32)  # as in a bag; at 4 m good to a micrometre


class Spool:
    """Rows of ranges in a temporary file that is gone with the program. All of a spool are equally long."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="kurumaisu_scans_")  # noqa: SIM115
        self._beams = -1
        self._count = 0

    def put(self, ranges: FloatArray) -> int:
        """Put a scan's ranges (b,) aside and return its number, -1 where it is of another length than the first.

        Raise Error when there is no room.
        """
        if self._beams < 0:
            self._beams = len(ranges)
        if len(ranges) != self._beams:
            return -1
        try:
            self._file.write(np.asarray(ranges, dtype=_TYPE).tobytes())
        except OSError as error:
            raise Error(
                f"{tempfile.gettempdir()}: {error.strerror}: no room for scans; TMPDIR names another"
            ) from error
        self._count += 1
        return self._count - 1

    def get(self, number: int) -> NDArray[np.float32]:
        """Return the ranges of a scan."""
        assert 0 <= number < self._count
        size = self._beams * _TYPE.itemsize
        self._file.flush()
        return np.frombuffer(os.pread(self._file.fileno(), size, number * size), dtype=_TYPE)

# SPDX-License-Identifier: BSD-3-Clause
"""What rangers measured; arrays that nobody changes afterwards."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Scan:
    """Readings (samples,) [m], +inf for no return, and the ranger returns (samples,) of what was hit, 0 for nothing.

    time [s] of the measurement; count: how many the ranger has made, 0 before its first update, when this is what it
    would have seen at the start.
    """

    ranges: FloatArray
    returns: FloatArray
    time: float
    count: int


@dataclass(frozen=True)
class Sweep:
    """The newest scans of fans that are always due together, one after another in two arrays."""

    ranges: FloatArray
    returns: FloatArray
    time: float
    count: int


class Scans(Sequence[Scan]):
    """The newest scan of each fan, in the order of Simulator.rangers; views, made when asked for."""

    __slots__ = ("_places", "sweeps")

    def __init__(self, sweeps: tuple[Sweep, ...], places: Sequence[tuple[int, int, int]]) -> None:
        """Find fan i in sweep places[i][0] from places[i][1] up to places[i][2]."""
        self.sweeps = sweeps
        self._places = places

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> Scan: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Scan, ...]: ...
    def __getitem__(self, index: int | slice) -> Scan | tuple[Scan, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        which, start, stop = self._places[index]
        sweep = self.sweeps[which]
        return Scan(sweep.ranges[start:stop], sweep.returns[start:stop], sweep.time, sweep.count)

    def sweep(self, index: int) -> Sweep:
        """Return the sweep that a fan's scan is part of; another object when there is a newer one."""
        return self.sweeps[self._places[index][0]]

    def __iter__(self) -> Iterator[Scan]:
        return (self[i] for i in range(len(self)))

    @property
    def ranges(self) -> FloatArray:
        """All fans' readings, one after another [m]; without a copy if all rangers are updated together."""
        if len(self.sweeps) == 1:
            return self.sweeps[0].ranges
        return np.concatenate([np.empty(0), *(scan.ranges for scan in self)])

    @property
    def returns(self) -> FloatArray:
        """What all fans' beams hit, as ranges."""
        if len(self.sweeps) == 1:
            return self.sweeps[0].returns
        return np.concatenate([np.empty(0), *(scan.returns for scan in self)])

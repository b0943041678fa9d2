# SPDX-License-Identifier: BSD-3-Clause
"""What is predicted of a run, with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass

from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Prediction:
    """Of one run: times t0, t1 [s]; means and sds (n,), nan where nothing is predicted; of channels, or of beams."""

    run: str
    t0: float
    t1: float
    means: FloatArray
    sds: FloatArray

    @property
    def is_scan(self) -> bool:
        """Tell whether these are ranges."""
        return self.t0 == self.t1

# SPDX-License-Identifier: BSD-3-Clause
"""What a laser does anyway, with and without a hidden fault: ids of the contract that the null has, too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.hidden.laser.forms import ar1, chained
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Backdrop:
    """What readings have beside equation (4), all 0: nothing.

    beam_rho: correlation of neighbours [1]; common_sd, common_rho: common mode of a scan [m] and its correlation with
    the next one's; beam_sd: of offsets of single beams [m]; lost: share of error codes.
    """

    beam_rho: float = 0.0
    common_sd: float = 0.0
    common_rho: float = 0.0
    beam_sd: float = 0.0
    lost: float = 0.0

    @property
    def ids(self) -> tuple[str, ...]:
        """Return the ids that are right to name."""
        there = {
            "laser.beam_correlation": self.beam_rho,
            "laser.common_mode": self.common_sd,
            "laser.beam_bias": self.beam_sd,
            "laser.dropout": self.lost,
        }
        return tuple(name for name, size in there.items() if size)

    def noise(self, sd: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return unit noise (s, b) for readings of deviations sd (s, b) [m]."""
        scans, beams = sd.shape
        unit = chained(rng.standard_normal((scans, beams)), self.beam_rho)
        common = self.common_sd * ar1(scans, self.common_rho, rng)
        own = self.beam_sd * rng.standard_normal(beams)
        return np.asarray(unit + (common[:, None] + own) / sd)

    def lose(self, readings: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return readings with error codes, nan, in place of some."""
        return np.asarray(np.where(rng.random(readings.shape) < self.lost, np.nan, readings))


CLEAN = Backdrop()
BACKDROPS = {
    "clean": CLEAN,
    "real": Backdrop(beam_rho=0.5, common_sd=0.0004, common_rho=0.8, beam_sd=0.0007, lost=0.02),
}


def draw_backdrop(rng: np.random.Generator) -> Backdrop:
    """Return a clean backdrop half the time, else one with each part in one of two cases."""
    parts = (rng.random(4) < 0.5) & (rng.random() < 0.5)
    return Backdrop(
        beam_rho=float(parts[0] * rng.uniform(0.3, 0.6)),
        common_sd=float(parts[1] * rng.uniform(0.0002, 0.001)),
        common_rho=float(rng.uniform(0.0, 0.95)),
        beam_sd=float(parts[2] * rng.uniform(0.0005, 0.0015)),
        lost=float(parts[3] * rng.uniform(0.005, 0.1)),
    )

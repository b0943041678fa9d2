# SPDX-License-Identifier: BSD-3-Clause
"""laser.mixed_pixels: at edges a beam meets two surfaces and reads something in between."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter
from kurumaisu.types import BoolArray

_GRAZING = 1e-6  # cosine of an angle at which a wall is met nowhere


class MixedPixels(ReadingEffect):
    """Beams beside a jump of the range read, with a probability, a point anywhere between both sides."""

    id = "laser.mixed_pixels"
    stage = LaserStage.OUTLIER
    parameters = (
        Parameter("probability", "1", null=0.0, scale=0.5, lower=0.0, upper=1.0),
        Parameter("jump", "m", null=0.1, scale=0.1, lower=0.01, upper=10.0),
    )
    oblique = True
    sentence = "at edges the laser reads points between foreground and background"
    formula = "beside |r_i − r_(i+1)| > jump, of no one wall, with probability: reading between both, uniformly"
    source = "Ye and Borenstein 2002, Okubo 2009; probability 0.3-1"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Replace readings beside jumps."""
        chance, mix = self.draws(2, echoes)
        jumps = self._jumps(echoes)
        none = np.zeros((*jumps.shape[:-1], 1), dtype=bool)
        before, behind = np.concatenate([none, jumps], axis=-1), np.concatenate([jumps, none], axis=-1)
        readings = echoes.readings
        across = np.where(before, np.roll(readings, 1, axis=-1), np.roll(readings, -1, axis=-1))
        mixed = (before | behind) & (chance < self.values["probability"])
        with np.errstate(invalid="ignore"):
            return replace(echoes, readings=np.where(mixed, readings + mix * (across - readings), readings))

    def _jumps(self, echoes: Echoes) -> BoolArray:
        """Return between which neighbours (..., n - 1) the range jumps: neither wall goes on to where the other is.

        Where beams are far apart, neighbours on one oblique wall are, too.
        """
        ranges, least, turn = echoes.ranges, self.values["jump"], np.diff(echoes.bearings)
        one, other = (..., slice(None, -1)), (..., slice(1, None))
        with np.errstate(invalid="ignore"):  # no return beside no return: inf - inf
            step = np.abs(np.diff(ranges, axis=-1))
            goes_on = np.zeros(step.shape, dtype=bool)
            for near, far in ((one, other), (other, one)):
                for angle in (echoes.incidence[near] + turn, echoes.incidence[near] - turn):
                    wall = ranges[near] * np.cos(echoes.incidence[near]) / np.maximum(np.cos(angle), _GRAZING)
                    goes_on |= np.abs(wall - ranges[far]) <= least
        return np.asarray((step > least) & np.isfinite(step) & ~goes_on)

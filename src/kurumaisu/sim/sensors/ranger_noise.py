# SPDX-License-Identifier: BSD-3-Clause
"""The noise of Stage's rangers: property `noise [constant proportional angle]` of a sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.model import Fan

_LEVELS = 1000  # Stage's uniform noise takes so many values


class RangerNoise:
    """Disturbs all beams of several fans at once, as Stage does.

    reading = range + range * proportional * U + sqrt(constant) * N, not clamped, misses untouched, where U is one of
    -1, -0.998 .. 0.998 and N standard normal; a beam's direction is off by 0.5 * increment * angle * U.
    """

    def __init__(self, fans: Sequence[Fan]) -> None:
        """Lay out the beams of the fans one after the other, as the ray caster returns them."""
        samples = [fan.samples for fan in fans]
        noise = np.array([fan.noise for fan in fans], dtype=np.float64).reshape(-1, 3)
        increments = np.array([fan.fov / max(fan.samples - 1, 1) for fan in fans], dtype=np.float64)
        self._variance = np.repeat(noise[:, 0], samples)
        self._share = np.repeat(noise[:, 1], samples)
        self._swing = np.repeat(0.5 * increments * noise[:, 2], samples)
        self._range_max = np.repeat(np.array([fan.range_max for fan in fans], dtype=np.float64), samples)
        self.on_ranges = bool((noise[:, :2] != 0).any())
        self.on_bearings = bool((noise[:, 2] != 0).any())

    def bearings(self, rng: np.random.Generator) -> FloatArray:
        """Return how far (beams,) [rad] each beam of this scan points beside its nominal bearing."""
        return self._swing * _uniform(len(self._swing), rng)

    def readings(self, ranges: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return readings (beams,) [m] of ranges (beams,) [m]; +inf and the maximum range mean a miss.

        Every beam draws, hit or not, so that what one beam meets does not change the noise of another.
        """
        if not self.on_ranges:
            return ranges.copy()
        hit = ranges < self._range_max
        true = np.where(hit, ranges, 0.0)
        noise = true * self._share * _uniform(len(ranges), rng)
        noise += np.sqrt(self._variance) * rng.standard_normal(len(ranges))
        return np.where(hit, true + noise, ranges)


def deviation(fan: Fan, ranges: FloatArray) -> FloatArray:
    """Return standard deviations (n,) [m] of the readings of ranges (n,) [m]; 0 for a miss."""
    constant, share, _ = fan.noise
    spread = math.sqrt((1 - _LEVELS**-2) / 3)  # of U
    true = np.where(np.isfinite(ranges), ranges, 0.0)
    return np.asarray(np.hypot(math.sqrt(constant), share * spread * true))


def _uniform(n: int, rng: np.random.Generator) -> FloatArray:
    return np.asarray(rng.integers(0, _LEVELS, n) * (2.0 / _LEVELS) - 1.0, dtype=np.float64)

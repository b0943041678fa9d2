# SPDX-License-Identifier: BSD-3-Clause
"""How a laser repeats itself when neither it nor anything around it moves: no map, no pose, no model is needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

_FEWEST = 10  # scans
_OUTLIER = 5.0  # deviations
_MAD = 1.4826  # sd of a normal distribution over its median absolute deviation
_LAGS = (1, 2, 3, 5)  # beams
_STABLE = 0.02  # [m] robust sd of a beam beyond which it sits on an edge or sees somebody pass


@dataclass(frozen=True)
class Repeatability:
    """Noise of a still laser: ranges (n,) [m] of the beams and their sds (n,) [m]; correlation by lag in beams.

    common_sd [m]: of whole scans; missing: share of readings that are none.
    """

    ranges: FloatArray
    sds: FloatArray
    correlation: dict[int, float]
    common_sd: float
    missing: float

    def sd_between(self, low: float, high: float) -> float:
        """Return the median sd [m] of beams whose range is from low to high [m]: a few always sit on some edge."""
        inside = (self.ranges >= low) & (self.ranges < high)
        return float(np.median(self.sds[inside]))


def repeatability(readings: FloatArray) -> Repeatability:
    """Return the noise of scans (k, b) [m] of one scene, nan where there is no valid reading.

    A beam counts that is always valid and sees one surface. Raise Error for fewer than 10 scans or no such beam.
    """
    if len(readings) < _FEWEST:
        raise Error(f"repeatability: needs at least {_FEWEST} scans of a still scene, got {len(readings)}")
    middle = np.full(readings.shape[1], np.nan)
    whole = np.isfinite(readings).all(axis=0)
    middle[whole] = np.median(readings[:, whole], axis=0)
    spread = np.full(readings.shape[1], np.inf)
    spread[whole] = _MAD * np.median(np.abs(readings[:, whole] - middle[whole]), axis=0)
    use = spread < _STABLE
    if not use.any():
        raise Error("repeatability: no beam is valid in all scans and sees one still surface")
    left = readings[:, use] - middle[use]
    left[np.abs(left) > _OUTLIER * np.maximum(spread[use], 1e-3)] = np.nan
    left = left - np.nanmean(left, axis=0)
    sds = np.nanstd(left, axis=0) * np.sqrt(len(readings) / (len(readings) - 1))
    common = np.nanmean(left, axis=1)
    unit = np.full(readings.shape, np.nan)
    unit[:, use] = (left - common[:, np.newaxis]) / np.nanstd(left - common[:, np.newaxis], axis=0)
    correlation = {lag: float(np.nanmean(unit[:, lag:] * unit[:, :-lag])) for lag in _LAGS}
    return Repeatability(middle[use], sds, correlation, float(np.std(common)), float(np.mean(~np.isfinite(readings))))

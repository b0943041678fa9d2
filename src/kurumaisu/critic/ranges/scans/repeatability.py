# SPDX-License-Identifier: BSD-3-Clause
"""How a laser repeats itself when neither it nor anything around it moves: no map, no pose, no model is needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray

_FEWEST = 10  # scans
_ROOMS = ((0.06, 0.75), (0.75, 1.5), (1.5, 3.0), (3.0, 10.0))  # [m] distances that are told apart
_FEW_BEAMS = 10
_OUTLIER = 5.0  # deviations
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
    spread[whole] = SIGMA_PER_MAD * np.median(np.abs(readings[:, whole] - middle[whole]), axis=0)
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


def sentences(recording: Recording, model: Model) -> tuple[str, ...]:
    """Return how the laser repeats itself in runs of scans alone, beside what the model has; a sentence each."""
    told: list[str] = []
    for run in recording.runs:
        if run.scan is None or run.pose is not None or run.odom is not None:
            continue
        try:
            found = repeatability(run.scan.values)
        except Error as error:
            told.append(f"{run.name}: {error}")
            continue
        for low, high in _ROOMS:
            here = found.ranges[(found.ranges >= low) & (found.ranges < high)]
            if len(here) >= _FEW_BEAMS:
                at, law = float(np.median(here)), model.laser.error  # equation (4)
                measured = 1e3 * found.sd_between(low, high)
                said = 1e3 * float(law.deviation(law.range(np.array([at])))[0])
                told.append(
                    f"{run.name}: readings around {at:.2g} m scatter by {measured:.1f} mm, the model's by {said:.1f} mm"
                )
        lags = ", ".join(f"{value:.2f}" for value in found.correlation.values())
        told.append(
            f"{run.name}: neighbours correlate by {lags} at lags {', '.join(map(str, found.correlation))} (in the "
            f"model by 0, unless an effect couples them); whole scans scatter by {1e3 * found.common_sd:.2g} mm; "
            f"{found.missing:.1%} of the readings are missing"
        )
    return tuple(told)

# SPDX-License-Identifier: BSD-3-Clause
"""How single readings scatter: deviations by range and incidence, neighbours' correlation, outliers, beams' offsets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.ranges.noise.shared_errors import Layout
from kurumaisu.critic.ranges.scans.beams import BeamHits
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

OUTLIER = 4.5  # deviations from which a reading does not count
# Deviations that hardly any noise reaches, however heavy its tails: it is a reading of something else.
ELSEWHERE = 25.0
_BINS = 6  # of the range, and of the incidence, in which the deviation is estimated
_FEWEST = 300  # readings of a bin in the tails, whose deviation is then known to a twentieth
_JOLT = 4.0  # sds among scans from which one of them does not count
_TOLERATED = 0.1  # share by which a scan may always be noisier than the middle one
_MANY = 10  # readings of a beam, and beams, from which their offsets are estimated


@dataclass(frozen=True)
class BeamNoise:
    """Deviations (k, b) [m] of readings, how neighbours correlate, which readings count, and beams' own offsets [m]."""

    sd: FloatArray
    rho: float
    valid: BoolArray
    own_sd: float = 0.0


def expected_readings(
    z: FloatArray, known: BoolArray, reach: FloatArray, moved: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return what a fit of z may begin with, and which readings are of what was to be met about that, (k, b) each.

    z: in deviations from what was to be met, nothing fitted yet; reach: by how many of them errors that a scan shares
    move each reading, 1 sd; moved: what errors of the poses do that are known already. A scan whose first fit gives way
    to readings that are off by metres comes near none of the others, ever; of one whose reference is far off nearly
    all are, but not from where the scan has put it.
    """

    def about(start: FloatArray) -> BoolArray:
        left = z - start
        width = SIGMA_PER_MAD * float(np.median(np.abs(left[known]))) if known.any() else 0.0
        with np.errstate(invalid="ignore"):
            return np.asarray(known & (np.abs(left) < np.maximum(max(ELSEWHERE, OUTLIER * width), OUTLIER * reach)))

    here, there = about(np.zeros_like(z)), about(moved)
    better = (there.sum(axis=1) > here.sum(axis=1))[:, np.newaxis]
    return np.where(better, moved, 0.0), np.where(better, there, here)


def estimate_reading_noise(
    first: BeamNoise,
    beam: BeamNoise,
    leftover: Callable[[BeamNoise], FloatArray],
    seen: BeamHits,
    layout: Layout,
    grid: float,
) -> BeamNoise:
    """Return the noise of the readings once more; first: before any was known; beam: the last; grid: their step [m].

    leftover: returns what is left of the residual (k, b) [m], NaN where that says nothing, with a noise that says which
    readings count.
    """
    every = leftover(beam)
    left = np.where(beam.valid, every, np.nan)
    sd = first.sd.copy()
    for covariate in (seen.ranges, seen.incidence):  # oblique walls may be read more noisily
        sd *= _factors(left, sd, np.where(np.isfinite(left), covariate, np.nan), covariate)
    z = left / sd
    # Of every reading that may ever count, outliers of the last round too.
    again = (left if np.array_equal(beam.valid, first.valid) else every) / sd
    valid = first.valid & (np.abs(np.nan_to_num(again)) < OUTLIER) & ~_jolted(again, first, layout)[:, np.newaxis]
    inside = beam.valid & (np.abs(z) < OUTLIER)
    rho = neighbours_correlation(z, inside)
    kept = np.where(inside, left, np.nan)
    sd = sd * _repeated(grid, first.sd, sd, layout)
    return replace(beam, sd=sd, rho=rho, valid=valid, own_sd=_own_sd(kept, sd))


def neighbours_correlation(z: FloatArray, use: BoolArray) -> float:
    """Return how readings z (k, b) [sd] correlate with the next beam's, of those that are used (k, b); 0 at least."""
    both = use[:, 1:] & use[:, :-1]
    a, b = z[:, 1:][both], z[:, :-1][both]
    return float(np.clip(a @ b / max(float(np.sqrt((a @ a) * (b @ b))), 1e-9), 0.0, 0.95))


def _repeated(grid: float, noise: FloatArray, sd: FloatArray, layout: Layout) -> FloatArray:
    """Return by what factor (k, b) readings say less than as many independent ones: a stand rounds them all alike.

    Noise of deviation `noise` (k, b) [m] blurs a grid of step `grid` [m] to a sine of amplitude grid / pi
    exp(-2 (pi noise / grid)^2), the first of its harmonics; sd (k, b) [m]: of readings, rounded.
    """
    kept = 0.5 * (grid / np.pi * np.exp(-2 * (np.pi * noise / grid) ** 2)) ** 2
    _, stand, count = np.unique(layout.stand, return_inverse=True, return_counts=True)
    more = np.where(layout.stand >= 0, count[stand] - 1, 0)[:, np.newaxis]
    return np.asarray(np.sqrt(1 + more * kept / sd**2))


def _jolted(z: FloatArray, first: BeamNoise, layout: Layout) -> BoolArray:
    """Return (k,) which scans nothing fits as well as the others: the speed jumped between two poses."""
    with np.errstate(invalid="ignore"):
        seen = np.where(first.valid, np.minimum(np.abs(z), OUTLIER), np.nan)
    some = np.isfinite(seen).any(axis=1)
    size = np.ones(len(z))
    size[some] = np.sqrt(np.nanmean(seen[some] ** 2, axis=1))
    middle = float(np.median(size[some]))
    width = SIGMA_PER_MAD * float(np.median(np.abs(size[some] - middle)))
    return np.asarray((size > middle + max(_JOLT * width, _TOLERATED * middle)) & (layout.stand < 0))


def _factors(left: FloatArray, sd: FloatArray, known: FloatArray, covariate: FloatArray) -> FloatArray:
    """Return by how much the deviations (k, b) of what is left differ from sd, in bins of a covariate.

    The outer bins are halved, towards the ends, while enough readings are in them: few walls are seen at a steep angle,
    over which noise may double, and readings that scatter more than is known seem to say what they do not.
    """
    levels = np.arange(1, _BINS) / _BINS
    halved = np.log2(max(np.isfinite(known).sum() / (_BINS * _FEWEST), 1.0))
    tails = 0.5 ** np.arange(1, int(halved) + 1) / _BINS
    levels = np.sort(np.r_[tails, levels, 1 - tails])
    bins = np.digitize(covariate, np.nanquantile(known, levels))
    out = np.ones_like(sd)
    for i in range(len(levels) + 1):
        inside = (bins == i) & np.isfinite(known)
        if inside.any():
            out[bins == i] = max(SIGMA_PER_MAD * float(np.median(np.abs(left[inside] / sd[inside]))), 0.05)
    return out


def _own_sd(left: FloatArray, sd: FloatArray) -> float:
    """Return the sd [m] of what beams keep over all scans, beyond what chance leaves of so many readings."""
    seen = np.isfinite(left)
    count = seen.sum(axis=0)
    many = count >= _MANY
    if many.sum() < _MANY:
        return 0.0
    middle = np.nanmean(left[:, many], axis=0)
    chance = np.nansum(np.where(seen, sd, 0.0)[:, many] ** 2, axis=0) / count[many] ** 2
    spread = (SIGMA_PER_MAD * float(np.median(np.abs(middle - np.median(middle))))) ** 2
    return float(np.sqrt(max(spread - float(np.median(chance)), 0.0)))

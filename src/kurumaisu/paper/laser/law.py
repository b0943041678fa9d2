# SPDX-License-Identifier: BSD-3-Clause
"""Equation (4) from scans of a wall, with intervals: mu a line, sigma a parabola of the range; agreement with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from kurumaisu._core import LaserError
from kurumaisu.errors import Error
from kurumaisu.paper.chair.law import Coefficient
from kurumaisu.paper.laser.wall import Ahead
from kurumaisu.paper.options import Bootstrap, Wall
from kurumaisu.types import FloatArray

NAMES = ("scale", "datum_offset", "sigma_0", "sigma_1", "sigma_2")


@dataclass(frozen=True)
class LaserLaw:
    """Equation (4): mu = scale r + datum_offset, sigma = sigma_0 + sigma_1 r + sigma_2 r^2.

    bend: how far the means lie off the line [m], root of the mean square; bend_by_noise: by noise alone.
    """

    scale: Coefficient
    datum_offset: Coefficient
    sigma: tuple[Coefficient, Coefficient, Coefficient]
    bend: float
    bend_by_noise: float

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """Return all five, in the order of NAMES."""
        return (self.scale, self.datum_offset, *self.sigma)

    def mean(self, r: FloatArray) -> FloatArray:
        """Return mu [m] at true ranges [m]."""
        return np.asarray(self.scale.value * r + self.datum_offset.value)

    def deviation(self, r: FloatArray) -> FloatArray:
        """Return sigma [m] at true ranges [m]."""
        constant, linear, square = (c.value for c in self.sigma)
        return np.asarray(constant + r * (linear + r * square))


def fit(places: Sequence[Ahead], resolution: float, tape_sd: float, options: Bootstrap) -> LaserLaw:
    """Return (4) by least squares over the distances, as in the paper; scans are drawn again for the intervals.

    resolution [m]: readings are multiples of it, which adds resolution^2 / 12 to their variance, and is taken off;
    tape_sd [m]: of the distances. Raise Error for less than four distances: three have a parabola through them.
    """
    distances = sorted({place.distance for place in places})
    if len(distances) < 4:
        raise Error(f"{len(distances)} distances, 4 are needed for a parabola and what it leaves")
    rng = np.random.default_rng(options.seed)
    found = _coefficients(places, resolution, np.zeros(len(places)), None)
    drawn = np.array(
        [
            _coefficients(places, resolution, tape_sd * rng.standard_normal(len(places)), rng)
            for _ in range(options.resamples)
        ]
    )
    half = norm.ppf(0.5 + options.level / 2) * drawn.std(axis=0, ddof=1)
    own = [Coefficient(float(v), float(v - h), float(v + h)) for v, h in zip(found, half, strict=True)]
    r, mean = _centres(places)
    noise = np.array([place.sd / np.sqrt(place.readings.size) for place in places])
    off = mean - (found[0] * r + found[1])
    return LaserLaw(
        own[0],
        own[1],
        (own[2], own[3], own[4]),
        float(np.sqrt(np.mean(off**2))),
        float(np.sqrt(np.mean(noise**2 + (found[0] * tape_sd) ** 2))),
    )


def _centres(places: Sequence[Ahead]) -> tuple[FloatArray, FloatArray]:
    return np.array([place.true.mean() for place in places]), np.array([place.mean for place in places])


def _coefficients(
    places: Sequence[Ahead], resolution: float, taped: FloatArray, rng: np.random.Generator | None
) -> FloatArray:
    """Return the five coefficients (5,) of all scans, or of as many drawn with replacement."""
    r, mean, sd = [], [], []
    for place, error in zip(places, taped, strict=True):
        readings = place.readings
        if rng is not None:
            readings = readings[rng.integers(len(readings), size=len(readings))]
        variance = readings.var(axis=0, ddof=1).mean()
        if rng is not None:  # a resample of n scatters by (n - 1) / n of what it was drawn from
            variance *= len(readings) / (len(readings) - 1)
        r.append(place.true.mean() + error)
        mean.append(readings.mean())
        sd.append(np.sqrt(max(variance - resolution**2 / 12, 0.0)))
    slope, constant = np.polyfit(r, mean, 1)
    return np.array([slope, constant, *np.polyfit(r, sd, 2)[::-1]])


@dataclass(frozen=True)
class Agreement:
    """A distance held against (4): off, its mean in standard errors; p: of a variance as far off, either way."""

    distance: float
    mean: float
    expected_mean: float
    off: float
    sd: float
    expected_sd: float
    p: float
    agrees: bool


def agreement(place: Ahead, error: LaserError, resolution: float, options: Wall) -> Agreement:
    """Return whether readings are those of (4): the mean within so many standard errors, the variance by chi-square.

    By (4) readings are independent, also those of one scan: so many are there.
    """
    expected = error.mean(place.true)
    sd = np.sqrt(error.deviation(place.true) ** 2 + resolution**2 / 12)
    scans, beams = place.readings.shape
    off = float((place.readings - expected).mean() / (np.sqrt(np.mean(sd**2)) / np.sqrt(scans * beams)))
    squares = float((place.readings.var(axis=0, ddof=1) * (scans - 1) / sd**2).sum())
    below = float(chi2.cdf(squares, (scans - 1) * beams))
    p = 2 * min(below, 1 - below)
    return Agreement(
        place.distance,
        place.mean,
        float(expected.mean()),
        off,
        place.sd,
        float(np.sqrt(np.mean(sd**2))),
        p,
        abs(off) <= options.agree and p >= options.chance,
    )

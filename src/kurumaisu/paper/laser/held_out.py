# SPDX-License-Identifier: BSD-3-Clause
"""Two laws of a laser on scans of a wall that the new one was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from kurumaisu._core import LaserError
from kurumaisu.paper.laser.wall import Ahead
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Judged:
    """What is wrong with the old law and with the new one, (2,) each, every distance counting alike.

    mean, sd [m]: rms of how far those of the readings are off the law's; density: mean log density of a reading [nats];
    gain, half: of that, and half its interval.
    """

    mean: FloatArray
    sd: FloatArray
    density: FloatArray
    gain: float
    half: float

    @property
    def better(self) -> bool:
        """Return whether the new law gains more than other scans could have taken away."""
        return self.gain > self.half


def judge(laws: tuple[LaserError, LaserError], held: Sequence[Ahead], resolution: float, level: float) -> Judged:
    """Return what two laws are worth on scans.

    resolution [m]: of the readings; level: of the gain's interval, scans taken as independent.
    """
    mean = [[float(np.mean(place.readings - law.mean(place.true))) for place in held] for law in laws]
    sd = [[place.sd - float(np.sqrt(np.mean(_sd(law, place, resolution) ** 2))) for place in held] for law in laws]
    density = [[_densities(law, place, resolution) for place in held] for law in laws]
    gains = [new - old for old, new in zip(*density, strict=True)]
    error = np.sqrt(sum(gain.var(ddof=1) / len(gain) for gain in gains)) / len(gains)
    return Judged(
        mean=_rms(mean),
        sd=_rms(sd),
        density=np.array([np.mean([one.mean() for one in row]) for row in density]),
        gain=float(np.mean([gain.mean() for gain in gains])),
        half=float(norm.ppf(0.5 + 0.5 * level) * error),
    )


def _rms(rows: list[list[float]]) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=1)))


def _sd(law: LaserError, place: Ahead, resolution: float) -> FloatArray:
    """Return the law's deviation of each beam (beams,) [m], with the steps of the readings."""
    return np.asarray(np.sqrt(law.deviation(place.true) ** 2 + resolution**2 / 12))


def _densities(law: LaserError, place: Ahead, resolution: float) -> FloatArray:
    """Return the mean log density of a reading in each scan (scans,) [nats, of metres]."""
    sd = _sd(law, place, resolution)
    z = (place.readings - law.mean(place.true)) / sd
    return np.asarray(np.mean(-0.5 * z**2 - np.log(sd) - 0.5 * np.log(2 * np.pi), axis=1))


def lines(judged: Judged, level: float) -> list[str]:
    """Return both as text; level: of the interval."""
    rows = [f"{'on the held-out scans':38s}{'before':>10s}{'after':>10s}"]
    for name, values, digits in (
        ("mean off the law, rms [mm]", 1e3 * judged.mean, 3),
        ("standard deviation off it, rms [mm]", 1e3 * judged.sd, 3),
        ("log density of a reading [nats]", judged.density, 4),
    ):
        rows.append(f"{name:38s}" + "".join(f"{value:10.{digits}f}" for value in values))
    low, high = judged.gain - judged.half, judged.gain + judged.half
    return [*rows, f"gain {judged.gain:+.4f} nats a reading ({100 * level:.0f} %: {low:+.4f} to {high:+.4f})"]

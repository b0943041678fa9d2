# SPDX-License-Identifier: BSD-3-Clause
"""How a drive and its reference fluctuate: regimes of noise, drawn and described."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.hidden.generator.motion import STEP
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Colour:
    """One Ornstein-Uhlenbeck part of the rates' noise: stationary sd of v, u [m/s], w [rad/s]; tau [s]."""

    sd: tuple[float, float, float]
    tau: float


@dataclass(frozen=True)
class Regime:
    """All noise of a drive: parts of the rates', and errors of the reference's position [m], heading [rad].

    lasting: share of the variance of these errors that lasts for lasting_tau [s], the rest is white.
    """

    colours: tuple[Colour, ...]
    position_sd: float
    heading_sd: float
    lasting: float = 0.0
    lasting_tau: float = 1.0

    @property
    def reference_variance(self) -> FloatArray:
        """Variances (3,) of the errors of the reference's x, y, heading."""
        return np.square([self.position_sd, self.position_sd, self.heading_sd])


USUAL = Regime((Colour((0.010, 0.003, 0.020), 0.3),), 0.005, 0.005)
REGIMES: dict[str, Regime] = {
    "usual": USUAL,
    "slow": Regime((Colour((0.020, 0.004, 0.030), 2.0),), 0.005, 0.005),
    "rough": Regime((Colour((0.050, 0.010, 0.100), 0.05),), 0.020, 0.020),
    "poor reference": Regime((Colour((0.010, 0.003, 0.020), 0.3),), 0.020, 0.020),
    "quiet": Regime((Colour((0.004, 0.001, 0.008), 0.15),), 0.001, 0.002),
    "two colours": Regime((Colour((0.010, 0.003, 0.025), 0.1), Colour((0.008, 0.002, 0.010), 3.0)), 0.005, 0.005),
    "lasting": Regime((Colour((0.010, 0.003, 0.020), 0.3),), 0.010, 0.008, 0.7, 3.0),
}


def draw_regime(rng: np.random.Generator) -> Regime:
    """Return a regime anywhere in what wheelchairs and references do; one in four has two colours."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def colour() -> Colour:
        return Colour((between(0.004, 0.03), between(0.001, 0.006), between(0.008, 0.06)), between(0.08, 2.0))

    colours = (colour(), colour()) if rng.random() < 0.25 else (colour(),)
    return Regime(colours, between(0.001, 0.02), between(0.001, 0.02))


def draw_lasting(regime: Regime, rng: np.random.Generator) -> Regime:
    """Return one regime in four with a reference that errs for longer than one pose, as one matched to a map does."""
    if rng.random() < 0.75:
        return regime
    return replace(regime, lasting=rng.uniform(0.2, 0.9), lasting_tau=float(np.exp(rng.uniform(*np.log([0.5, 20.0])))))


def draw_rates(regime: Regime, cells: int, rng: np.random.Generator) -> FloatArray:
    """Return noise (cells, 3) of v, u, w; exact on the grid, stationary from its first cell on."""
    total = np.zeros((cells, 3))
    for colour in regime.colours:
        keep = np.exp(-STEP / colour.tau)
        kicks = rng.standard_normal((cells, 3))
        kicks[1:] *= np.sqrt(1 - keep**2)
        total += lfilter([1.0], [1.0, -keep], kicks, axis=0) * np.array(colour.sd)
    return total


def draw_reference(regime: Regime, stamps: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return errors (n, 3) of the reference's poses at stamps (n,) [s]."""
    unit = rng.standard_normal((len(stamps), 3))
    if regime.lasting:
        kept = np.zeros(3)
        kicks = rng.standard_normal(unit.shape)
        for k, gap in enumerate(np.diff(stamps, prepend=-np.inf)):
            keep = np.exp(-gap / regime.lasting_tau)
            kept = keep * kept + np.sqrt(1 - keep**2) * kicks[k]
            unit[k] = np.sqrt(1 - regime.lasting) * unit[k] + np.sqrt(regime.lasting) * kept
    return np.asarray(unit * np.sqrt(regime.reference_variance))

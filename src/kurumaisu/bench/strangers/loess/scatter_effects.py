# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden in the scatter of ranges: effects on the sds in place, and effects that spoil readings."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array, Effect, Hidden, Sight, Spread


def range_noise(x: Spread, s: Sight, h: Hidden) -> None:
    """All noise is larger; otherwise the more the farther."""
    x.sd = x.sd * (1 + h.size * (np.sqrt(s.range / 2.5) if h.other else 1.0))


def incidence_noise(x: Spread, s: Sight, h: Hidden) -> None:
    """Oblique walls scatter more, by the tangent; otherwise by a power of the sine."""
    sine = np.sqrt(1 - s.incidence**2)
    x.sd = x.sd * (1 + h.size * (2.5 * sine**3 if h.other else np.minimum(sine / s.incidence, 5)))


def common_mode(x: Spread, s: Sight, h: Hidden) -> None:
    """A scan shares an error; otherwise scans shortly after each other share less of it."""
    x.common, x.rho = h.size, 0.4 if h.other else 0.8


def beam_correlation(x: Spread, s: Sight, h: Hidden) -> None:
    """Neighbouring beams err alike; otherwise only a beam and the next."""
    x.beams, x.pairs = h.size, h.other


def shaken(x: Spread, s: Sight, h: Hidden) -> None:
    """The noise grows with the speed."""
    x.sd = x.sd * (1 + h.size * np.minimum(np.abs(s.speed) / 0.4, 2))[:, None]


def damp(x: Spread, s: Sight, h: Hidden) -> None:
    """The noise follows the humidity."""
    x.sd = x.sd * np.exp(h.size * np.tanh((s.columns["humidity"] - 50) / 12))[:, None]


def glare(x: Spread, s: Sight, h: Hidden) -> None:
    """The noise is larger towards a window."""
    x.sd = x.sd * (1 + 2 * h.size * np.exp(3 * (np.cos(s.direction - 6 * h.extra) - 1)))


def smeared(x: Spread, s: Sight, h: Hidden) -> None:
    """A smear on the housing: noisier within some bearings."""
    x.sd = x.sd * (1 + 2 * h.size * np.exp(-((s.bearing - 2 * h.extra + 1) ** 2) / 0.18))


def restless(x: Spread, s: Sight, h: Hidden) -> None:
    """The noise swells and ebbs with time."""
    x.sd = x.sd * (1 + 1.5 * h.size * (np.sin(2 * np.pi * s.t / (25 + 20 * h.extra)) > 0.2))[:, None]


SPREAD: dict[str, Effect] = {
    "laser.range_noise": Effect(range_noise, "spread", 0.25, 0.8, False, "share"),
    "laser.incidence_noise": Effect(incidence_noise, "spread", 0.4, 1.0, False, "gain"),
    "laser.common_mode": Effect(common_mode, "spread", 0.004, 0.012, False, "sd"),
    "laser.beam_correlation": Effect(beam_correlation, "spread", 0.3, 0.6, False, "rho"),
    "unknown.shaken": Effect(shaken, "spread", 0.3, 0.8, False, covariates=("abs_v",), channel="laser.spread"),
    "unknown.damp": Effect(damp, "spread", 0.3, 0.6, True, covariates=("humidity",), channel="laser.spread"),
    "unknown.glare": Effect(glare, "spread", 0.4, 0.9, False, covariates=("direction",), channel="laser.spread"),
    "unknown.smeared": Effect(smeared, "spread", 0.4, 0.9, False, covariates=("bearing",), channel="laser.spread"),
    "unknown.restless": Effect(restless, "spread", 0.3, 0.8, False, covariates=("time",), channel="laser.spread"),
}


def heavy_tails(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """Rare readings that are far off; otherwise more often too short than too long."""
    reach = rng.standard_t(4, r.shape) * 0.12
    if h.other:
        reach = np.where(rng.random(r.shape) < 0.7, -np.abs(reach), np.abs(reach))
    r += np.where(rng.random(r.shape) < h.size, reach, 0.0)


def mixed_pixels(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """At edges a reading lies between the two walls; otherwise nearer to the front one."""
    far = np.isfinite(s.edge) & (s.edge > 0.1)
    share = rng.random(r.shape) ** (2.0 if h.other else 1.0)
    jump = np.where(far & (rng.random(r.shape) < h.size), s.edge, 0.0)
    r += share * jump


def dropout(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """Beams without a reading; otherwise more of them far away."""
    chance = h.size * (np.clip(s.range / 3, 0, 2) if h.other else 1.0)
    r[rng.random(r.shape) < chance] = np.nan


def saturation(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """Ranges stop at a greatest value, 1/size; otherwise they bend towards it."""
    most = 1 / h.size
    r[:] = np.where(r > most, most + (0.06 * np.log1p(np.maximum(r - most, 0)) if h.other else 0.0), r)


def crosstalk(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """In some scans random ranges in a sector that drifts; otherwise in one that swings to and fro."""
    centre = 6 * h.extra + (1.5 * np.sin(0.3 * s.t) if h.other else 0.5 * s.t)
    away = np.abs((s.bearing[None, :] - centre[:, None] + np.pi) % (2 * np.pi) - np.pi)
    hit = (away < 0.15) & (rng.random(s.t.size) < h.size)[:, None]
    r[:] = np.where(hit, np.minimum(rng.uniform(0.2, 4.5, r.shape), 1.0 * np.where(np.isfinite(r), r + 1, 4.5)), r)


def quantisation(r: Array, s: Sight, h: Hidden, rng: np.random.Generator) -> None:
    """Coarse steps; otherwise the steps are cut off."""
    r[:] = h.size * (np.floor(r / h.size) if h.other else np.round(r / h.size))


SPOIL: dict[str, Effect] = {
    "laser.heavy_tails": Effect(heavy_tails, "spoil", 0.02, 0.06, False),
    "laser.mixed_pixels": Effect(mixed_pixels, "spoil", 0.3, 0.8, False, "probability"),
    "laser.saturation": Effect(saturation, "spoil", 0.2, 0.45, False),
    "laser.crosstalk": Effect(crosstalk, "spoil", 0.2, 0.5, False),
    "laser.dropout": Effect(dropout, "spoil", 0.04, 0.12, False, "probability"),
    "laser.quantisation": Effect(quantisation, "spoil", 0.03, 0.08, False, "step"),
}

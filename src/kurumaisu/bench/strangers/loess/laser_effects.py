# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden in the mean of ranges: each effect adds its error to the mean readings in place."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array, Effect, Hidden, Sight


def offset(mean: Array, s: Sight, h: Hidden) -> None:
    """The same everywhere; otherwise a little less very near."""
    mean += h.size * (1 - 0.5 * np.exp(-s.range / 0.5) if h.other else 1.0)


def scale(mean: Array, s: Sight, h: Hidden) -> None:
    """In proportion; otherwise nearly so."""
    mean += h.size * (s.range**1.15 if h.other else s.range)


def quadratic(mean: Array, s: Sight, h: Hidden) -> None:
    """With the square; otherwise with a power near it."""
    mean += h.size * (s.range**1.8 if h.other else s.range**2)


def warmup(mean: Array, s: Sight, h: Hidden) -> None:
    """It dies out as the laser warms up; otherwise in two stages."""
    tau = 200 + 300 * h.extra
    left = np.exp(-s.clock / tau)
    if h.other:
        left = 0.5 * np.exp(-s.clock / (0.4 * tau)) + 0.5 * np.exp(-s.clock / (1.6 * tau))
    mean += h.size * left[:, None]


def temperature(mean: Array, s: Sight, h: Hidden) -> None:
    """With the temperature; otherwise less when it is warm than when it is cold."""
    rise = s.columns["temperature"] - 20
    mean += h.size * (rise * np.where(rise > 0, 0.75, 1.25) if h.other else rise)[:, None]


def cyclic(mean: Array, s: Sight, h: Hidden) -> None:
    """A sine of the range; otherwise with a harmonic."""
    phase = 2 * np.pi * (s.range / (1.5 + 2 * h.extra) + h.extra)
    mean += h.size * (np.sin(phase) + (0.4 * np.sin(2 * phase) if h.other else 0.0))


def incidence_bias(mean: Array, s: Sight, h: Hidden) -> None:
    """Oblique walls read too long, by the tangent; otherwise by the sine's square."""
    tangent = np.minimum(np.sqrt(1 - s.incidence**2) / s.incidence, 4)
    mean += h.size * (3 * (1 - s.incidence**2) if h.other else tangent)


def reflectance(mean: Array, s: Sight, h: Hidden) -> None:
    """Dark walls read longer or shorter; otherwise by the root of what they swallow."""
    dark = 1 - s.bright
    mean += h.size * (0.8 * np.sqrt(dark) if h.other else dark)


def beam_bias(mean: Array, s: Sight, h: Hidden) -> None:
    """An error that swings over the fan and differs from beam to beam; otherwise by the swing alone."""
    rng = np.random.default_rng(int(h.extra * 1e6))
    own = rng.normal(0, 0.0 if h.other else 0.6 * h.size, s.bearing.size)
    mean += h.size * np.sin(s.bearing * (1.6 if h.other else 1.0) + 6 * h.extra) + own


def sunlit(mean: Array, s: Sight, h: Hidden) -> None:
    """Walls towards the window, in a direction of the room, read off."""
    mean += 1.3 * h.size * np.exp(2 * (np.cos(s.direction - 6 * h.extra) - 1))


def humid_air(mean: Array, s: Sight, h: Hidden) -> None:
    """All ranges follow the humidity."""
    mean += h.size * np.tanh((s.columns["humidity"] - 50) / 14)[:, None]


def papered(mean: Array, s: Sight, h: Hidden) -> None:
    """Stripes of another paper along the walls' x."""
    mean += h.size * np.sin(2 * np.pi * s.hit_x / (1.6 + 1.5 * h.extra)) * 1.2


def rattle(mean: Array, s: Sight, h: Hidden) -> None:
    """Ranges shrink as the speed shakes the laser."""
    mean += 1.3 * h.size * np.minimum(np.abs(s.speed) / 0.5, 1.5)[:, None] ** 1.5


def moody(mean: Array, s: Sight, h: Hidden) -> None:
    """An error of all ranges that swings with time."""
    mean += h.size * np.sin(2 * np.pi * s.t / (22 + 20 * h.extra))[:, None]


LASER: dict[str, Effect] = {
    "laser.offset": Effect(offset, "mean", 0.01, 0.03, True, "offset"),
    "laser.scale": Effect(scale, "mean", 0.004, 0.012, True, "scale"),
    "laser.quadratic": Effect(quadratic, "mean", 0.0012, 0.004, True, "quadratic"),
    "laser.warmup": Effect(warmup, "mean", 0.015, 0.04),
    "laser.temperature": Effect(temperature, "mean", 0.002, 0.005, True, "coefficient"),
    "laser.cyclic": Effect(cyclic, "mean", 0.004, 0.012, False, "amplitude"),
    "laser.incidence_bias": Effect(incidence_bias, "mean", 0.004, 0.012, True, "k"),
    "laser.reflectance": Effect(reflectance, "mean", 0.015, 0.05, True, "bias"),
    "laser.beam_bias": Effect(beam_bias, "mean", 0.004, 0.012, False),
    "unknown.sunlit": Effect(sunlit, "mean", 0.006, 0.03, covariates=("direction",), channel="laser.range"),
    "unknown.humid_air": Effect(humid_air, "mean", 0.006, 0.025, covariates=("humidity",), channel="laser.range"),
    "unknown.papered": Effect(papered, "mean", 0.006, 0.025, covariates=("hit_x",), channel="laser.range"),
    "unknown.rattle": Effect(rattle, "mean", 0.006, 0.03, covariates=("abs_v",), channel="laser.range"),
    "unknown.moody": Effect(moody, "mean", 0.006, 0.03, covariates=("time",), channel="laser.range"),
}

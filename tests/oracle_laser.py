# SPDX-License-Identifier: BSD-3-Clause
"""Readings of a laser once more, from the formulas of docs/effects.md: one beam at a time, no code of the package.

Where nothing is drawn, a function takes parameters and a beam and says what it reads.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Beam:
    """What a beam meets: range [m], incidence [rad], reflectance; its bearing [rad], its scan's time [s].

    mean, sd [m]: what the laser's law says of that range; noise: how many sd this reading is off.
    """

    range: float
    incidence: float
    reflectance: float
    bearing: float
    time: float
    mean: float
    sd: float
    noise: float


READINGS: dict[str, Callable[[dict[str, float], Beam], float]] = {}


def _bias(name, rule):
    READINGS[name] = lambda p, b: b.mean + rule(p, b) + b.sd * b.noise


def _spread(name, rule):
    READINGS[name] = lambda p, b: b.mean + rule(p, b) * b.noise


def _footprint(p: dict[str, float], incidence: float) -> float:
    """How much longer than wide the spot on the wall is, less 1, or its depth; as at 80 degrees beyond them."""
    across = math.sin(math.pi / 2 - min(incidence, math.radians(80)))
    return (1 / across - 1) * (1 - p["tangent"]) + math.sqrt(1 - across**2) / across * p["tangent"]


_bias("laser.offset", lambda p, b: p["offset"])
_bias("laser.scale", lambda p, b: p["scale"] * b.range)
_bias("laser.quadratic", lambda p, b: p["quadratic"] * b.range * b.range)
_bias("laser.warmup", lambda p, b: p["amplitude"] * (0.5 ** (b.time / (p["tau"] * math.log(2))) - p["cold"]))
_bias("laser.temperature", lambda p, b: p["coefficient"] * p["swing"] * math.sin(math.tau * b.time / p["period"]))
_bias(
    "laser.cyclic",
    lambda p, b: p["amplitude"] * math.cos(math.tau * b.range / p["wavelength"] + p["phase"] - math.pi / 2),
)
_bias("laser.incidence_bias", lambda p, b: p["k"] * _footprint(p, b.incidence))
_spread("laser.incidence_noise", lambda p, b: b.sd + b.sd * p["gain"] * _footprint(p, b.incidence))
_spread("laser.range_noise", lambda p, b: max(0.0, b.sd + p["share"] * b.sd + p["slope"] * (b.range - 2)))
_bias("laser.beam_bias", lambda p, b: p["amplitude"] * math.cos(p["phase"] - b.bearing))  # with sd 0: the mirror alone


def _reflectance(p, b):
    dark = 1 - b.reflectance
    return b.mean + p["bias"] * dark + b.sd * max(0.0, 1 + p["noise"] * dark) * b.noise


def _saturation(p, b):
    reading = b.mean + b.sd * b.noise
    far = reading * p["inverse_far"] > 1
    if p["lost"] >= 0.5:
        return math.inf if far or reading < p["near"] else reading
    return 1 / p["inverse_far"] if far else max(reading, p["near"])


def _quantisation(p, b):
    reading = b.mean + b.sd * b.noise - p["cut"] * p["step"] / 2
    below = math.floor(reading / p["step"]) * p["step"]
    return below if reading - below < p["step"] / 2 else below + p["step"]


READINGS["laser.reflectance"] = _reflectance
READINGS["laser.saturation"] = _saturation
READINGS["laser.quantisation"] = _quantisation


def correlated(rho: float, noise: list[float]) -> list[float]:
    """Return noise whose neighbours hang together, from independent noise of the same size."""
    out = noise[:1]
    for n in noise[1:]:
        out.append(rho * out[-1] + math.sqrt(1 - rho * rho) * n)
    return out


def dropout(p: dict[str, float], b: Beam) -> float:
    """Return the probability of no valid reading."""
    chance = p["probability"] + p["per_metre"] * b.range + p["oblique"] * (1 - math.cos(b.incidence))
    return min(1.0, chance + p["dark"] * (1 - b.reflectance))


def lit(p: dict[str, float], bearing: float, time: float) -> bool:
    """Return whether a beam is in the sector that another laser's light comes from."""
    away = (bearing - p["drift"] * time) % math.tau
    return min(away, math.tau - away) < p["width"] / 2

# SPDX-License-Identifier: BSD-3-Clause
"""The effects of the laser, each by its first law, by another one, and what no sentence describes."""

import numpy as np

from kurumaisu.bench.strangers.moor.laser import SIGMA, Cast, Lens
from kurumaisu.bench.strangers.moor.motion import coloured
from kurumaisu.bench.strangers.moor.world import Array


def luck(c: Cast, salt: int) -> np.random.Generator:
    """Numbers that are the same whenever a drive is looked at again."""
    return np.random.default_rng([c.motion.drive.luck, salt])


def slant(c: Cast) -> Array:
    """How much longer the way through a wall is than straight: 0 where a beam meets it at a right angle."""
    return np.asarray(1 / np.maximum(np.cos(c.incidence), 0.2) - 1)


def each_beam(c: Cast) -> Array:
    """A number for each beam, of standard deviation 1."""
    return np.asarray(np.random.default_rng(4711).normal(0, 1, c.r.shape[1])[None, :] + 0 * c.r)


def shared(c: Cast, sd: float, rho: float) -> Array:
    """An error that a whole scan shares, that remembers the one before."""
    n = c.r.shape[0]
    return coloured(luck(c, 3), n, sd, -1 / np.log(max(rho, 1e-3)), 1.0)[:, None] + 0 * c.bearing


def bursts(c: Cast, share: float) -> Array:
    """Beams that another laser's light dazzles: a sector that wanders, in some scans."""
    rng = luck(c, 4)
    on = rng.random(c.r.shape[0]) < share
    place = rng.uniform(-2, 2) + 0.5 * c.t[:, 0]
    off = (c.bearing - place[:, None] + np.pi) % (2 * np.pi) - np.pi
    return np.asarray((on[:, None] & (abs(off) < 0.15)) * 1.0)


def noise_at(r: Array) -> Array:
    """The noise of equation (4)."""
    return np.asarray(SIGMA[0] + SIGMA[1] * r + SIGMA[2] * r**2)


def near(c: Cast) -> Array:
    """Ranges, those that are not met taken as 5 m."""
    return np.minimum(c.r, 5.0)


def shade(c: Cast, s: float) -> dict[str, Array | float]:
    """Dark or oblique surfaces that send little back."""
    return {"lost": s * (1 + slant(c)) * (0.2 + near(c) / 4)}


# fmt: off
LASER = [
    Lens("laser.mount_x", "optics", 1e-4, 0.2, lambda c, s: {"x": s}, {"x": 1}, signed=True),
    Lens("laser.mount_y", "optics", 1e-4, 0.2, lambda c, s: {"y": s}, {"y": 1}, signed=True),
    Lens("laser.mount_yaw", "optics", 1e-4, 0.2, lambda c, s: {"yaw": s}, {"yaw": 1}, signed=True),
    Lens("laser.tilt", "optics", 5e-3, 0.15, lambda c, s: {"pitch": s, "roll": -0.4 * s}, form="other", signed=True),
    Lens("laser.sweep", "optics", 5e-3, 0.9, lambda c, s: {"stretch": s}, {"stretch": 1}, signed=True),
    Lens("laser.latency", "optics", 1e-4, 0.6, lambda c, s: {"delay": s}, {"delay": 1}),
    Lens("laser.clock_skew", "optics", 1e-6, 8e-3, lambda c, s: {"skew": s}, {"skew": 1}, signed=True),
    Lens("laser.offset", "mean", 1e-5, 0.2, lambda c, s: s + 0 * c.r, {"offset": 1}, signed=True),
    Lens("laser.scale", "mean", 1e-5, 0.1, lambda c, s: s * near(c), {"scale": 1}, signed=True),
    Lens("laser.quadratic", "mean", 1e-5, 0.1, lambda c, s: s * near(c) ** 2, {"quadratic": 1}, signed=True),
    Lens("laser.warmup", "mean", 1e-4, 0.2, lambda c, s: s * np.exp(-c.t / 300), {"amplitude": 1}, signed=True,
         fixed={"tau": 300}),
    Lens("laser.temperature", "mean", 1e-5, 0.02, lambda c, s: s * (c.col("temperature") - 20), {"coefficient": 1},
         signed=True, column="temperature", fixed={"reference": 20}),
    Lens("laser.cyclic", "mean", 1e-4, 0.1, lambda c, s: s * np.sin(2 * np.pi * near(c) / 1.3 + 0.7), {"amplitude": 1},
         fixed={"wavelength": 1.3, "phase": 0.7}),
    Lens("laser.incidence_bias", "mean", 1e-4, 0.1, lambda c, s: s * slant(c), form="other", signed=True),
    Lens("laser.reflectance", "mean", 1e-4, 0.2, lambda c, s: s * c.dark, form="other", signed=True),
    Lens("laser.beam_bias", "mean", 1e-5, 0.05, lambda c, s: s * each_beam(c), {"sd": 1}),
    Lens("laser.range_noise", "sd", 5e-3, 3, lambda c, s: 1 + s + 0 * c.r, {"share": 1}),
    Lens("laser.incidence_noise", "sd", 5e-3, 5, lambda c, s: 1 + s * slant(c), form="other"),
    Lens("laser.common_mode", "special", 1e-4, 0.05, lambda c, s: {"common": shared(c, s, 0.7), "sd": s}, {"sd": 1},
         fixed={"rho": 0.7}),
    Lens("laser.beam_correlation", "special", 0.02, 0.9, lambda c, s: {"rho": s}, {"rho": 1}),
    Lens("laser.heavy_tails", "special", 1e-3, 0.08, lambda c, s: {"outliers": s, "reach": 0.08}, {"outliers": 1},
         fixed={"reach": 0.08}),
    Lens("laser.mixed_pixels", "special", 5e-3, 0.9, lambda c, s: {"mixed": s}, form="other"),
    Lens("laser.dropout", "special", 1e-3, 0.3, lambda c, s: {"lost": s}, {"probability": 1}),
    Lens("laser.saturation", "special", 1 / 3.99, 0.5, lambda c, s: {"far": 1 / s}, {"inverse_far": 1},
         fixed={"lost": 1}),
    Lens("laser.crosstalk", "special", 2e-3, 0.5, lambda c, s: {"noisy": bursts(c, s)}, {"probability": 1},
         fixed={"width": 0.3, "drift": 0.5, "reach": 4}),
    Lens("laser.quantisation", "special", 1.2e-3, 0.03, lambda c, s: {"step": round(s, 3)}, {"step": 1}),
    Lens("world.map_error", "optics", 1e-4, 0.1, lambda c, s: {"shift": s}, {"sd": 1}),
]
# fmt: on


def other(name: str, **more: object) -> Lens:
    """The law of that name, with another act."""
    first = next(lens for lens in LASER if lens.name == name)
    return Lens(**{**first.__dict__, "form": "other", "parameters": {}, "fixed": {}, **more})


# fmt: off
LASER_FORMS = [
    other("laser.tilt", act=lambda c, s: {"pitch": 0.2 * s, "roll": s}),
    other("laser.clock_skew", act=lambda c, s: {"drift": s / 60}),
    other("laser.scale", act=lambda c, s: s * 1.5 * near(c) ** 0.8),
    other("laser.quadratic", act=lambda c, s: s * np.maximum(near(c) - 1, 0) ** 2),
    other("laser.warmup", act=lambda c, s: s / (1 + c.t / 60)),
    other("laser.temperature", act=lambda c, s: s * 5 * np.tanh((c.col("temperature") - 21) / 2)),
    other("laser.cyclic", act=lambda c, s: s * (2 * abs((near(c) / 0.9) % 1 - 0.5) - 0.5)),
    other("laser.incidence_bias", act=lambda c, s: s * np.maximum(c.incidence - 0.5, 0)),
    other("laser.reflectance", act=lambda c, s: s * c.dark * (0.3 + near(c) / 3)),
    other("laser.beam_bias", act=lambda c, s: s * np.sign(np.sin(c.bearing * 3 + 0.4))),
    other("laser.range_noise", kind="sd", act=lambda c, s: 1 + s * (near(c) / 2) ** 1.5),
    other("laser.incidence_noise", act=lambda c, s: 1 + s * np.maximum(c.incidence - 0.6, 0) * 2),
    other("laser.heavy_tails", low=3.2, high=40, act=lambda c, s: {"nu": s}),
    other("laser.dropout", act=shade),
    other("laser.quantisation", act=lambda c, s: {"step": round(s, 3), "floor": 1.0}),
    other("world.map_error", act=lambda c, s: {"turn": s}),
]
# fmt: on

# fmt: off
LASER_UNKNOWN = [
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * abs(c.col("ask_w")), covariates=("abs_w",),
         channel="mean of readings",
         signed=True),
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * c.col("ask_v"), covariates=("v",), channel="mean of readings",
         signed=True),
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * c.col("lamp"), covariates=("lamp",), channel="mean of readings",
         signed=True, column="lamp"),
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * np.cos(c.angle - 0.8), covariates=("direction",),
         channel="mean of readings", signed=True),
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * np.sin(1.5 * np.clip(c.x, -5, 5)), covariates=("hit_x",),
         channel="mean of readings"),
    Lens("mean", "mean", 1e-4, 0.1, lambda c, s: s * np.exp(-c.during(c.motion.since(c.motion.changed())) / 0.8),
         covariates=("time_since_change",), channel="mean of readings", signed=True),
    Lens("scatter", "sd", 5e-3, 4, lambda c, s: 1 + s * abs(c.col("ask_w")), covariates=("abs_w",),
         channel="scatter of readings"),
    Lens("scatter", "sd", 5e-3, 4, lambda c, s: 1 + s * abs(c.col("ask_v")), covariates=("abs_v", "v"),
         channel="scatter of readings"),
    Lens("scatter", "sd", 5e-3, 4, lambda c, s: 1 + s * c.col("lamp"), covariates=("lamp",),
         channel="scatter of readings",
         column="lamp"),
    Lens("scatter", "sd", 5e-3, 4, lambda c, s: 1 + s / (1 + np.exp(-4 * np.clip(c.y, -5, 5))), covariates=("hit_y",),
         channel="scatter of readings"),
    Lens("scatter", "sd", 5e-3, 4, lambda c, s: 1 + s * np.exp(-(((c.bearing - 0.6) / 0.4) ** 2)),
         covariates=("bearing", "beam"), channel="scatter of readings"),
]
# fmt: on

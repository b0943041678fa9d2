# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the laser or the map: a law for each effect and, for most, another plausible one."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.reed.core import Array, Effect, Use
from kurumaisu.bench.strangers.reed.laser import DATUM, FAR, SIGMA, View
from kurumaisu.bench.strangers.reed.room import Room

Rng = np.random.Generator


def _moved(room: Room, u: Use, move: float, stretch: float) -> Room:
    """The room as it really is."""
    boxes = room.boxes.copy()
    boxes[:, :4] *= 1 + stretch
    boxes[:, :2] += move * np.random.default_rng(u.aux["seed"]).normal(size=(len(boxes), 2))
    return Room(boxes, room.colours)


def _tan(look: View) -> Array:
    """The tangent of the incidence, not beyond 75 degrees."""
    return np.asarray(np.minimum(np.sqrt(1 - look.cosine**2) / np.maximum(look.cosine, 0.17), 3.7))


def _wave(look: View, u: Use) -> Array:
    """The phase of the modulation at each range."""
    return np.asarray(2 * np.pi * look.r / u.aux["wavelength"] + u.aux["phase"])


def _each(look: View, u: Use) -> Array:
    """A number for each beam."""
    return np.random.default_rng(u.aux["seed"]).normal(size=look.r.shape[1])[None, :] * np.ones_like(look.r)


def _common(rng: Rng, unit: Array, look: View, u: Use) -> Array:
    """One error for all beams of a scan, which changes slowly."""
    rho = u.aux["rho"]
    walk = np.asarray(lfilter([1.0], [1.0, -rho], rng.normal(size=len(unit)) * np.sqrt(1 - rho**2)))
    return unit + u.size * walk[:, None] / (SIGMA[0] + SIGMA[1] * look.r + SIGMA[2] * look.r**2)


def _mixed(rng: Rng, z: Array, look: View, u: Use) -> Array:
    """At an edge, a point between near and far."""
    left, right = np.roll(look.mean, 1, axis=1), np.roll(look.mean, -1, axis=1)
    far = np.where(np.abs(left - look.mean) > np.abs(right - look.mean), left, right)
    hit = look.edge & (rng.random(z.shape) < u.size) & (far < FAR)
    return np.where(hit, look.mean + rng.random(z.shape) * (far - look.mean), z)


def _crosstalk(rng: Rng, z: Array, look: View, u: Use) -> Array:
    """Another laser shines in: a sector that drifts, of random ranges, in bursts of five scans."""
    middle = u.aux["phase"] + 0.5 * look.time[:, :1]
    on = np.repeat(rng.random((len(z) // 5 + 1, 1)) < u.size, 5, axis=0)[: len(z)]
    hit = on & (np.abs(np.angle(np.exp(1j * (look.bearing - middle)))) < 0.15)
    return np.where(hit, rng.uniform(DATUM, FAR, size=z.shape), z)


def _geo(name: str, size: float, key: str, axis: str) -> Effect:
    """Something of the geometry that is larger than the model has it."""
    return Effect(name, 10, size, 40 * size, key, axis, lambda r, s, u, _: r + u.size)


_ALL = [
    _geo("laser.mount_x", 0.01, "x", "x"),
    _geo("laser.mount_y", 0.01, "y", "y"),
    _geo("laser.mount_yaw", 0.01, "yaw", "yaw"),
    _geo("laser.latency", 0.02, "delay", "delay"),
    _geo("laser.clock_skew", 1e-4, "", "skew"),
    Effect("laser.tilt", 10, 0.06, 0.4, "", "pitch", lambda r, s, u, _: u.size),
    Effect("laser.sweep", 10, 0.1, 1.0, "stretch", "time_increment", lambda r, s, u, _: r * (1 + u.size)),
    Effect("laser.offset", 11, 0.01, 0.3, "offset", "", lambda k, u: u.size * np.ones_like(k.r)),
    Effect(
        "laser.scale",
        11,
        0.005,
        0.3,
        "scale",
        "",
        lambda k, u: u.size * k.r,
        lambda k, u: u.size * 1.5 * np.maximum(k.r - 1, 0),
    ),
    Effect(
        "laser.quadratic",
        11,
        0.002,
        0.1,
        "quadratic",
        "",
        lambda k, u: u.size * k.r**2,
        lambda k, u: u.size * 0.6 * k.r**2.5,
    ),
    Effect(
        "laser.warmup",
        11,
        0.01,
        0.2,
        "",
        "",
        lambda k, u: u.size * (1 - np.exp(-k.time / u.aux["tau"])),
        lambda k, u: u.size * (1 - (1 + 2 * k.time / u.aux["tau"]) * np.exp(-2 * k.time / u.aux["tau"])),
    ),
    Effect(
        "laser.temperature",
        11,
        5e-4,
        0.01,
        "coefficient",
        "",
        lambda k, u: u.size * (k.columns["temperature"] - 20),
        lambda k, u: u.size * 2.7 * np.log1p(np.exp((k.columns["temperature"] - 20) / 1.5)),
    ),
    Effect(
        "laser.cyclic",
        11,
        0.003,
        0.1,
        "amplitude",
        "",
        lambda k, u: u.size * np.sin(_wave(k, u)),
        lambda k, u: u.size * (np.sin(_wave(k, u)) + 0.4 * np.sin(2 * _wave(k, u))),
    ),
    Effect(
        "laser.incidence_bias",
        11,
        0.003,
        0.1,
        "",
        "",
        lambda k, u: u.size * _tan(k),
        lambda k, u: u.size * _tan(k) ** 2 / 2,
    ),
    Effect(
        "laser.reflectance",
        11,
        0.02,
        0.2,
        "",
        "",
        lambda k, u: u.size * (1 - k.bright),
        lambda k, u: u.size * (1 - k.bright) * 1.5 * np.exp(-k.r / 2.5),
    ),
    Effect(
        "laser.beam_bias",
        11,
        0.002,
        0.1,
        "sd",
        "",
        lambda k, u: u.size * _each(k, u),
        lambda k, u: u.size * 1.4 * np.sin(k.bearing + u.aux["phase"]),
    ),
    Effect(
        "laser.range_noise",
        12,
        0.3,
        5.0,
        "share",
        "",
        lambda k, u: 1 + u.size * np.ones_like(k.r),
        lambda k, u: 1 + u.size * k.r / 2,
    ),
    Effect(
        "laser.incidence_noise",
        12,
        0.3,
        5.0,
        "",
        "",
        lambda k, u: 1 + u.size * _tan(k),
        lambda k, u: 1 + u.size * 1.5 * (1 - k.cosine**2),
    ),
    Effect("laser.common_mode", 13, 0.002, 0.1, "sd", "", _common),
    Effect(
        "laser.beam_correlation",
        13,
        0.3,
        0.9,
        "rho",
        "",
        lambda g, e, k, u: lfilter([np.sqrt(1 - u.size**2)], [1.0, -u.size], e, axis=1),
        lambda g, e, k, u: (e + u.size * (np.roll(e, 1, 1) + np.roll(e, -1, 1)) / 2) / np.sqrt(1 + u.size**2 / 2),
    ),
    Effect(
        "laser.heavy_tails",
        13,
        0.2,
        0.4,
        "inverse_nu",
        "",
        lambda g, e, k, u: e / np.sqrt(g.chisquare(1 / u.size, e.shape) * u.size) * np.sqrt(1 - 2 * u.size),
        lambda g, e, k, u: e * np.where(g.random(e.shape) < 0.05, 1 + 8 * u.size, 1.0),
    ),
    Effect("laser.mixed_pixels", 14, 0.3, 1.0, "probability", "", _mixed),
    Effect(
        "laser.dropout",
        14,
        0.05,
        0.6,
        "probability",
        "",
        lambda g, z, k, u: np.where(g.random(z.shape) < u.size, np.nan, z),
        lambda g, z, k, u: np.where(g.random(z.shape) < u.size * 2.5 * (1 - k.cosine), np.nan, z),
    ),
    Effect(
        "laser.saturation",
        14,
        0.1,
        1.0,
        "",
        "",
        lambda g, z, k, u: np.where(z > FAR / (1 + u.size), np.inf, z),
        lambda g, z, k, u: np.where(z > FAR / (1 + u.size), FAR / (1 + u.size), z),
    ),
    Effect("laser.crosstalk", 14, 0.1, 0.9, "", "", _crosstalk),
    Effect("laser.quantisation", 14, 0.01, 0.2, "step", "", lambda g, z, k, u: np.round(z / u.size) * u.size),
    Effect(
        "world.map_error",
        10,
        0.005,
        0.1,
        "sd",
        "room",
        lambda r, s, u, _: _moved(r, u, u.size, 0.0),
        lambda r, s, u, _: _moved(r, u, 0.0, u.size),
    ),
]
LASER = {effect.id: effect for effect in _ALL}

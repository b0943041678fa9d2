# SPDX-License-Identifier: BSD-3-Clause
"""What light, mirrors, surfaces and electronics do to a reading: the effects of the laser."""

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.core import WARM, Array, Cause, Drive, Setup
from kurumaisu.bench.strangers.delta.room import Hits

Bias = Callable[[Setup, Drive, Hits, Cause], Array]


def tangent(h: Hits) -> Array:
    """Tangent of the angle of incidence, to 75 degrees."""
    cos = np.maximum(h.cos, 0.26)
    return np.asarray(np.sqrt(1 - cos**2) / cos)


def warming(setup: Setup, drive: Drive, h: Hits, c: Cause) -> Array:
    """Drift since the laser was switched on, at the session's start; other: a body of two heat capacities."""
    t = drive.session + h.t
    tau = c.extra.get("tau", WARM)
    one = np.exp(-t / tau)
    return np.asarray(
        c.size * (1 - (0.5 * np.exp(-t / (0.25 * tau)) + 0.5 * np.exp(-t / (3 * tau)) if c.other else one))
    )


def thermal(setup: Setup, drive: Drive, h: Hits, c: Cause) -> Array:
    """Length by temperature; other: with its square, too."""
    dt = setup.columns["temperature"](drive.session + h.t) - 20
    return np.asarray(c.size * (np.sign(dt) * dt**2 / 5 if c.other else dt))


def phase_error(setup: Setup, drive: Drive, h: Hits, c: Cause) -> Array:
    """Crosstalk of the modulation; other: the crosstalk counts more where less light comes back."""
    turn = 2 * np.pi * h.r / c.extra["wavelength"] + c.extra["phase"]
    return np.asarray(c.size * (np.sin(turn) * (0.3 + 0.4 * np.minimum(h.r, 4)) if c.other else np.sin(turn)))


def per_beam(setup: Setup, drive: Drive, h: Hits, c: Cause) -> Array:
    """Offsets of the beams: a mirror of uneven flatness; other: also a bump where the housing scatters light."""
    offsets = np.random.default_rng(11).normal(0, 1, setup.fan.beams)
    if c.other:
        offsets = 2.0 * np.exp(-(((setup.fan.angles - 0.9) / 0.15) ** 2)) + 0.5 * offsets
    return np.asarray(np.broadcast_to(c.size * offsets, h.r.shape))


BIAS: dict[str, Bias] = {
    "laser.offset": lambda s, d, h, c: np.full(h.r.shape, c.size),
    "laser.scale": lambda s, d, h, c: c.size * h.r,
    "laser.quadratic": lambda s, d, h, c: c.size * h.r**2,
    "laser.warmup": warming,
    "laser.temperature": thermal,
    "laser.cyclic": phase_error,
    "laser.incidence_bias": lambda s, d, h, c: c.size * (tangent(h) ** 2 if not c.other else 3 * (tangent(h) > 1.2)),
    "laser.reflectance": lambda s, d, h, c: c.size * (h.bright < 0.7) * (np.minimum(h.r, 4) / 2 if c.other else 1),
    "laser.beam_bias": per_beam,
}
SPREAD: dict[str, Callable[[Hits, Cause], Array]] = {
    "laser.range_noise": lambda h, c: np.asarray(1 + c.size * (np.minimum(h.r, 4) ** 2 / 4 if c.other else 1)),
    "laser.incidence_noise": lambda h, c: np.asarray(1 + c.size * (tangent(h) ** 2 / 2 if c.other else 1 / h.cos - 1)),
}


def edges(r: Array) -> tuple[Array, Array]:
    """Where a beam passes an edge: whether, and the range behind it."""
    finite = np.minimum(r, 6.0)
    ahead, back = np.roll(finite, -1, -1), np.roll(finite, 1, -1)
    behind = np.maximum(ahead, back)
    jump = behind - finite
    jump[..., 0] = jump[..., -1] = 0
    return np.asarray(jump > 0.15, dtype=float), behind


def tails(z: Array, c: Cause, rng: np.random.Generator) -> Array:
    """Noise of more large errors: Student's t; other: now and then a stray reflection, longer only."""
    if c.other:
        stray = rng.random(z.shape) < c.size * 0.05
        return np.asarray(np.where(stray, z + rng.exponential(12, z.shape), z))
    nu = 1 / c.size
    return np.asarray(rng.standard_t(nu, z.shape))


def correlated(z: Array, c: Cause) -> Array:
    """Neighbouring beams share light; other: only with the next, not as a chain."""
    out = np.empty_like(z)
    rho, out[..., 0] = c.size, z[..., 0]
    if c.other:
        b = (1 - np.sqrt(1 - 4 * min(rho, 0.49) ** 2)) / (2 * min(rho, 0.49))
        out[..., 1:] = (z[..., 1:] + b * z[..., :-1]) / np.sqrt(1 + b * b)
        return out
    for i in range(1, z.shape[-1]):
        out[..., i] = rho * out[..., i - 1] + np.sqrt(1 - rho**2) * z[..., i]
    return out


def spoil(setup: Setup, h: Hits, mean: Array, sd: Array, causes: Sequence[Cause], rng: np.random.Generator) -> Array:
    """Readings with noise, and with what makes single readings wrong."""
    by = {c.id: c for c in causes}
    z = rng.normal(0, 1, mean.shape)
    if "laser.heavy_tails" in by:
        z = tails(z, by["laser.heavy_tails"], rng)
    if "laser.beam_correlation" in by:
        z = correlated(z, by["laser.beam_correlation"])
    out = mean + sd * z
    if "laser.common_mode" in by:
        out = out + common(mean.shape[:-1], by["laser.common_mode"], rng)[..., None]
    if "laser.mixed_pixels" in by:
        c = by["laser.mixed_pixels"]
        at, behind = edges(h.r)
        mixed = rng.random(at.shape) < c.size * at
        share = rng.random(at.shape) ** (2 if c.other else 1)
        out = np.where(mixed, out + share * (np.minimum(behind, 4.5) - np.minimum(h.r, 4.5)), out)
    if "laser.crosstalk" in by:
        out = np.where(lit(h, by["laser.crosstalk"], rng), rng.uniform(0.1, 4.2, out.shape), out)
    return np.asarray(out)


def common(shape: tuple[int, ...], c: Cause, rng: np.random.Generator) -> Array:
    """What a whole scan has in common, from scan to scan with a memory; other: it jumps between two values."""
    e = rng.normal(0, 1, shape)
    if c.other:
        return np.asarray(np.sign(e) * c.size)
    rho = c.extra["rho"]
    for i in range(1, shape[-1]):
        e[..., i] = rho * e[..., i - 1] + np.sqrt(1 - rho**2) * e[..., i]
    return np.asarray(e * c.size)


def lit(h: Hits, c: Cause, rng: np.random.Generator) -> Array:
    """Beams that another laser's light meets: a sector that wanders, in bursts."""
    t = h.t[..., :1]
    middle = np.mod(c.extra["drift"] * t + 1.0 + np.pi, 2 * np.pi) - np.pi
    burst = rng.random(t.shape) < c.size * (1 + np.sin(t / 3) if c.other else 1)
    return np.asarray((np.abs(h.bearing - middle) < c.extra["width"] / 2) & burst)

# SPDX-License-Identifier: BSD-3-Clause
"""The scatter of readings: its size, what neighbours share, and the odd readings; then steps and gate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.scree.basics import Array, Cause, Rng
from kurumaisu.bench.strangers.scree.plant import Causes
from kurumaisu.bench.strangers.scree.ranges import Hits, Site, mean_reading

LOST = 0.0005
Log = Callable[[Cause, Hits], Array]


def _bump(u: Array, at: float, wide: float) -> Array:
    return np.asarray(np.exp(-(((u - at) / wide) ** 2) / 2))


SPREADS: dict[str, Log] = {
    "laser.range_noise": lambda c, h: (
        np.log(1 + c.size) * (0.8 + 0.4 * np.tanh(h.r / 6) if c.other else np.ones_like(h.r))
    ),
    "laser.incidence_noise": lambda c, h: np.log(1 + abs(c.size) * (h.tangent**1.4 / 1.3 if c.other else h.tangent)),
    "unknown.dust": lambda c, h: abs(c.size) * 1.5 * _bump(h.bearing, c.draw(0, -0.9, 0.9), 0.25) + 0 * h.r,
    "unknown.damp_air": lambda c, h: c.size * np.tanh(1.5 * h.column(c)) + 0 * h.r,
    "unknown.rattle": lambda c, h: abs(c.size) * np.tanh(np.abs(h.w) / (0.4 * h.drive.robot.w_top)) + 0 * h.r,
    "unknown.lamp": lambda c, h: abs(c.size) * 1.5 * _bump(h.y, c.draw(0, 0.5, 5.0), 0.8),
}


def log_spread(causes: Causes, h: Hits) -> Array:
    """The logarithm of the factor on the sd of each reading."""
    out = np.zeros_like(h.r)
    for c in causes:
        if c.id in SPREADS:
            out = out + SPREADS[c.id](c, h)
    return out


def _white(shape: tuple[int, ...], causes: Causes, rng: Rng) -> Array:
    e = rng.standard_normal(shape)
    for c in causes:
        if c.id == "laser.beam_correlation":
            e = lfilter([np.sqrt(1 - c.size**2)], [1, -c.size], e, axis=1)
            if c.other:
                e = 0.85 * e + np.sqrt(1 - 0.85**2) * rng.standard_normal(shape)
        elif c.id == "laser.heavy_tails" and not c.other:
            nu = 1 / min(c.size, 0.42)
            e = rng.standard_t(nu, shape)
        elif c.id == "laser.heavy_tails":
            odd = rng.random(shape) < 0.1 * c.size
            e = np.where(odd, e * rng.uniform(3, 12, shape), e)
    return np.asarray(e)


def _common(c: Cause, h: Hits, rng: Rng) -> Array:
    rho = c.draw(0, 0.6, 0.9)
    e = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(len(h.r)))[:, None] * c.size
    return np.asarray(e * (1 + 0.15 * h.r if c.other else 1.0) + 0 * h.r)


def edges(h: Hits, jump: float = 0.3) -> Array:
    """How far the neighbour's hit lies behind or before, 0 where it does not jump."""
    step = np.zeros_like(h.r)
    step[:, :-1] = np.diff(h.r, axis=1)
    return np.where(np.abs(step) > jump, step, 0.0)


def chance(c: Cause, h: Hits, site: Site) -> Array:
    """How likely each reading is an odd one, by the causes of odd readings."""
    p = np.zeros_like(h.r)
    if c.id == "laser.mixed_pixels":
        jump = np.abs(edges(h))
        p = np.where(jump > 0, min(abs(c.size), 0.95) * (np.exp(-jump / 4) if c.other else 1.0), 0.0)
    elif c.id == "laser.dropout":
        far = np.tanh(h.r / 4) * 1.5 if c.other else 1.0
        p = np.minimum(abs(c.size) * far * np.ones_like(h.r), 0.9)
    elif c.id == "laser.saturation":
        far = max(1 / abs(c.size), 1.2)
        p = 1 / (1 + np.exp(-np.clip((h.r - far) / (0.12 if c.other else 0.01), -40, 40)))
    elif c.id == "laser.crosstalk":
        off = h.bearing - 2.0 * np.sin(h.t * c.draw(0, 0.15, 0.35))
        width = c.draw(2, 0.2, 0.4)
        window = np.exp(-(off**2) / (2 * width**2)) if c.other else (np.abs(off) < width).astype(float)
        burst = np.sin(h.t * c.draw(1, 0.4, 0.8) + 6 * c.draws[2]) > 0.3
        p = min(abs(c.size), 0.9) * window * burst
    return np.asarray(p)


ODD = ("laser.mixed_pixels", "laser.dropout", "laser.saturation", "laser.crosstalk")


def _odd(c: Cause, h: Hits, site: Site, reading: Array, rng: Rng) -> Array:
    hit = rng.random(h.r.shape) < chance(c, h, site)
    if c.id == "laser.mixed_pixels":
        other = reading + edges(h) * rng.uniform(0.1, 0.9, h.r.shape)
    elif c.id == "laser.dropout":
        other = np.full_like(reading, np.nan)
    elif c.id == "laser.saturation":
        other = np.full_like(reading, np.inf)
    else:
        other = rng.uniform(site.laser.near, min(site.laser.far, 5.0), h.r.shape)
    return np.where(hit, other, reading)


def read(site: Site, causes: Causes, h: Hits, rng: Rng) -> Array:
    """The readings of scans."""
    laser = site.laser
    sd = laser.sd(h.r) * np.exp(log_spread(causes, h))
    out = mean_reading(site, causes, h) + sd * _white(h.r.shape, causes, rng)
    for c in causes:
        if c.id == "laser.common_mode":
            out = out + _common(c, h, rng)
    for c in causes:
        if c.id in ODD:
            out = _odd(c, h, site, out, rng)
    step = laser.resolution
    for c in causes:
        if c.id == "laser.quantisation":
            step = c.size
            out = out - (0.5 * step if c.other else 0.0)
    out = np.round(np.round(out / step) * step, 6)
    out = np.where(rng.random(out.shape) < LOST, np.nan, out)
    with np.errstate(invalid="ignore"):
        return np.where(out > laser.far, np.inf, np.where(out < laser.near, np.nan, out))

# SPDX-License-Identifier: BSD-3-Clause
"""Hidden faults of the laser and of the map: where beams leave from, what they mean, how they fluctuate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.hidden.generator.motion import Sizes
from kurumaisu.bench.hidden.generator.scanning import Aim, Scans
from kurumaisu.types import FloatArray

_GRAZING = 1 / np.cos(np.radians(80.0))  # no effect of incidence grows beyond


def mount(a: Aim, s: Sizes) -> Aim:
    """The laser off by `size` along x (axis 0), y (1) [m] or in yaw (2) [rad]."""
    moved = [value + s["size"] * (i == int(s["axis"])) for i, value in enumerate(a.mount)]
    return replace(a, mount=(moved[0], moved[1], moved[2]))


def tilt(a: Aim, s: Sizes) -> Aim:
    """The plane of the beams inclined by `size` [rad], towards `bearing`."""
    return replace(a, pitch=a.pitch + s["size"] * np.cos(s["bearing"]), roll=a.roll + s["size"] * np.sin(s["bearing"]))


def latency(a: Aim, s: Sizes) -> Aim:
    """Stamps late by `size` [s]."""
    return replace(a, late=a.late + s["size"])


def clock_skew(a: Aim, s: Sizes) -> Aim:
    """The laser's clock fast by a share `size`."""
    return replace(a, skew=a.skew + s["size"])


def sweep(a: Aim, s: Sizes) -> Aim:
    """The sweep longer by a share `size`."""
    return replace(a, stretch=a.stretch + s["size"])


def map_jitter(a: Aim, s: Sizes) -> Aim:
    """Walls scaled about the origin by `scale` times size, and each corner off by about `size` [m]."""
    rng = np.random.default_rng(int(s["seed"]))
    off = rng.standard_normal(a.corners.shape) * s["size"]
    return replace(a, corners=a.corners + off)


def map_shift(a: Aim, s: Sizes) -> Aim:
    """Each wall off by about `size` [m] as a whole and askew by a third of that per metre."""
    rng = np.random.default_rng(int(s["seed"]))
    middle = a.corners.mean(axis=1, keepdims=True)
    shift = rng.standard_normal((len(a.corners), 1, 2)) * s["size"]
    turn = rng.standard_normal((len(a.corners), 1)) * s["size"] / 3
    arm = a.corners - middle
    turned = np.stack([-arm[..., 1] * turn, arm[..., 0] * turn], axis=-1)
    return replace(a, corners=a.corners + shift + turned)


def box_turned(a: Aim, s: Sizes) -> Aim:
    """A single box turned by `size` [rad] about its middle."""
    corners, box = a.corners.copy(), int(s["box"])
    arm = corners[box] - corners[box].mean(axis=0)
    corners[box] += s["size"] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    return replace(a, corners=corners)


def _add(c: Scans, bias: FloatArray | float) -> Scans:
    return replace(c, mean=c.mean + bias)


def offset(c: Scans, s: Sizes) -> Scans:
    """All `size` [m] longer."""
    return _add(c, s["size"])


def scale(c: Scans, s: Sizes) -> Scans:
    """Longer by a share `size`."""
    return _add(c, s["size"] * _finite(c))


def quadratic(c: Scans, s: Sizes) -> Scans:
    """Longer by `size` [1/m] of the range squared."""
    return _add(c, s["size"] * _finite(c) ** 2)


def power(c: Scans, s: Sizes) -> Scans:
    """Longer by `size` of the range to the power 2.3, equal to the square at 2 m."""
    return _add(c, s["size"] * _finite(c) ** 2.3 * 2**-0.3)


def warmup(c: Scans, s: Sizes) -> Scans:
    """`size` [m] that dies with a time constant `tau` [s]."""
    return _add(c, s["size"] * np.exp(-c.stamps / s["tau"])[:, None])


def warmup2(c: Scans, s: Sizes) -> Scans:
    """The same of two time constants, the housing's and the diode's."""
    slow, fast = np.exp(-c.stamps / (1.2 * s["tau"])), np.exp(-c.stamps / (0.4 * s["tau"]))
    return _add(c, s["size"] * (0.75 * slow + 0.25 * fast)[:, None])


def by_temperature(c: Scans, s: Sizes) -> Scans:
    """`size` [m/K] from 21 degrees on."""
    return _add(c, s["size"] * (c.temperature - 21.0)[:, None])


def cyclic(c: Scans, s: Sizes) -> Scans:
    """A sine of the range."""
    return _add(c, s["size"] * np.sin(2 * np.pi * _finite(c) / s["wavelength"] + s["phase"]))


def triangle(c: Scans, s: Sizes) -> Scans:
    """A triangle wave of the range, with the first harmonic of the sine's size."""
    turns = _finite(c) / s["wavelength"] + s["phase"] / (2 * np.pi)
    wave = 4 * np.abs((turns - 0.25) % 1.0 - 0.5) - 1
    return _add(c, s["size"] * np.pi**2 / 8 * wave)


def incidence_bias(c: Scans, s: Sizes) -> Scans:
    """`size` [m] times 1 / cos a - 1."""
    return _add(c, s["size"] * (_oblique(c) - 1))


def footprint_bias(c: Scans, s: Sizes) -> Scans:
    """`size` [m] times half the square of tan a, which is the same for small angles."""
    return _add(c, s["size"] * 0.75 * np.minimum((_oblique(c) ** 2 - 1) / 2, 3.0))


def reflectance(c: Scans, s: Sizes) -> Scans:
    """`size` [m] for black, in proportion to what is not reflected; noisier in the same proportion by `noise`."""
    dark = 1 - c.reflectance
    return replace(c, mean=c.mean + s["size"] * dark, sd=c.sd * (1 + s["noise"] * dark))


def mirror(c: Scans, s: Sizes) -> Scans:
    """An eccentric mirror: `size` [m] times a cosine of the bearing."""
    return _add(c, s["size"] * np.cos(c.bearings - s["phase"]))


def beam_offsets(c: Scans, s: Sizes) -> Scans:
    """An offset of each beam's own, sd `size` [m]."""
    return _add(c, s["size"] * np.random.default_rng(int(s["seed"])).standard_normal(len(c.bearings)))


def range_noise(c: Scans, s: Sizes) -> Scans:
    """Noisier by a share `size`."""
    return replace(c, sd=c.sd * (1 + s["size"]))


def noise_per_metre(c: Scans, s: Sizes) -> Scans:
    """Noisier in proportion to the range, by a share `size` at 2 m."""
    return replace(c, sd=np.hypot(c.sd, c.sd * np.sqrt(s["size"] * (2 + s["size"])) * _finite(c) / 2))


def incidence_noise(c: Scans, s: Sizes) -> Scans:
    """Noisier by `size` times 1 / cos a - 1."""
    return replace(c, sd=c.sd * (1 + s["size"] * (_oblique(c) - 1)))


def footprint_noise(c: Scans, s: Sizes) -> Scans:
    """Noise of where in a footprint 3.5e-3 rad wide light returns from: uniform, so r tan a 3.5e-3 / sqrt(12)."""
    depth = _finite(c) * np.sqrt(np.maximum(_oblique(c) ** 2 - 1, 0.0))
    return replace(c, sd=np.hypot(c.sd, s["size"] * 3.5e-3 / np.sqrt(12) * depth))


def _finite(c: Scans) -> FloatArray:
    return np.where(np.isfinite(c.ranges), c.ranges, 0.0)


def _oblique(c: Scans) -> FloatArray:
    return np.minimum(1 / np.maximum(c.cosine, 1e-3), _GRAZING)


def common_mode(c: Scans, s: Sizes) -> Scans:
    """All of a scan off together, sd `size` [m], AR(1) of `rho` over the scans."""
    rng = np.random.default_rng(int(s["seed"]))
    return replace(c, unit=c.unit + s["size"] * ar1(len(c.stamps), s["rho"], rng)[:, None] / c.sd)


def beam_correlation(c: Scans, s: Sizes) -> Scans:
    """Neighbours correlated by `size`."""
    return replace(c, unit=chained(c.unit, s["size"]))


def smeared(c: Scans, s: Sizes) -> Scans:
    """Neighbours correlated by `size`, as of a moving average over three beams."""
    side = _side_weight(s["size"])
    padded = np.pad(c.unit, ((0, 0), (1, 1)), mode="reflect")
    mixed = side * (padded[:, :-2] + padded[:, 2:]) + padded[:, 1:-1]
    return replace(c, unit=mixed / np.sqrt(1 + 2 * side**2))


def _side_weight(rho: float) -> float:
    """Return the weight a of a moving average (a, 1, a) with 2 a / (1 + 2 a^2) = rho."""
    rho = min(rho, 0.66)
    return float((1 - np.sqrt(1 - 2 * rho**2)) / (2 * rho)) if rho > 0 else 0.0


def student(c: Scans, s: Sizes) -> Scans:
    """Student's t of 1 / `size` degrees of freedom, its variance 1."""
    nu = 1 / s["size"]
    chi = np.random.default_rng(int(s["seed"])).chisquare(nu, c.unit.shape)
    return replace(c, unit=c.unit * np.sqrt((nu - 2) / chi))


def contaminated(c: Scans, s: Sizes) -> Scans:
    """One in 50 readings five times as noisy, or more often for a larger `size`."""
    wild = np.random.default_rng(int(s["seed"])).random(c.unit.shape) < 0.1 * s["size"]
    return replace(c, unit=np.where(wild, 5 * c.unit, c.unit))


def ar1(n: int, rho: float, rng: np.random.Generator) -> FloatArray:
    """Return a stationary AR(1) of variance 1."""
    kicks = rng.standard_normal(n)
    kicks[1:] *= np.sqrt(1 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], kicks))


def chained(unit: FloatArray, rho: float) -> FloatArray:
    """Return unit noise (s, b) with neighbours correlated as AR(1)."""
    kicks = unit.copy()
    kicks[:, 1:] *= np.sqrt(1 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], kicks, axis=1))

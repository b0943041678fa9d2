# SPDX-License-Identifier: BSD-3-Clause
"""Causes that change what a laser reads in the mean."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.knoll.things import Cause, Draw, Hits, Maker
from kurumaisu.types import FloatArray


def _mount(c: Cause, d: Draw) -> None:
    name = c.id.removeprefix("laser.mount_")
    k = ("x", "y", "yaw").index(name)
    c.mount = np.zeros(3)
    c.mount[k] = c.tell(name, 0.02 * d.signed)
    if d.other:
        c.mean = lambda mu, g: mu + 0.004 * d.signed * np.cos(g.bearing) * (k < 2)


def _tilt(c: Cause, d: Draw) -> None:
    pitch = 0.05 * np.sqrt(d.size) * d.rng.choice([-1, 1])
    roll = 0.03 * d.rng.normal() * (0.5 if d.other else 1)
    fan = d.scene.laser

    def tilt(mu: FloatArray, g: Hits) -> FloatArray:
        a = pitch * np.cos(g.bearing) + roll * np.sin(g.bearing)
        if d.other:
            a = a + 0.006 * np.sin(2 * np.pi * g.t / 7.0)
        with np.errstate(divide="ignore"):
            floor = np.where(a < -1e-3, fan.height / np.maximum(np.sin(-a), 1e-9), np.inf)
        return mu + fan.scale * (np.minimum(g.r / np.cos(a), floor) - g.r)

    c.mean, c.order = tilt, 1


def _sweep(c: Cause, d: Draw) -> None:
    c.stretch = c.tell("stretch", max(0.25 * d.signed, -0.9))


def _latency(c: Cause, d: Draw) -> None:
    k = c.tell("delay", 0.03 * d.size)
    c.scan_time = lambda t: t - k * (1 + 0.4 * np.sin(t / 11.0) if d.other else 1)


def _clock_skew(c: Cause, d: Draw) -> None:
    k = 0.0004 * d.signed
    c.scan_time = lambda t: t - k * (t**1.3 / 120**0.3 if d.other else t)


def _offset(c: Cause, d: Draw) -> None:
    o = c.tell("offset", 0.009 * d.signed)
    c.mean = lambda mu, g: mu + o * (1 - 0.6 * np.exp(-g.r / 0.8) if d.other else 1)


def _scale(c: Cause, d: Draw) -> None:
    o = c.tell("scale", 0.005 * d.signed)
    c.mean = lambda mu, g: mu + o * (g.r**1.2 * 0.8 if d.other else g.r)


def _quadratic(c: Cause, d: Draw) -> None:
    far = d.far
    o = c.tell("quadratic", 0.008 * d.signed / far)
    c.mean = lambda mu, g: mu + o * (g.r**2.4 / far**0.4 if d.other else g.r**2)


def _warmup(c: Cause, d: Draw) -> None:
    a, tau = c.tell("amplitude", 0.012 * d.signed), c.tell("tau", float(d.rng.uniform(120, 500)))

    def cold(t: FloatArray) -> FloatArray:
        return np.asarray(0.5 * np.exp(-t / 60) + 0.5 * np.exp(-t / (2 * tau)) if d.other else np.exp(-t / tau))

    c.mean = lambda mu, g: mu - a * cold(g.day + g.t)


def _temperature(c: Cause, d: Draw) -> None:
    o = c.tell("coefficient", 0.0012 * d.signed)

    def warm(mu: FloatArray, g: Hits) -> FloatArray:
        above = g.cov["temperature"] - 20
        return np.asarray(mu + o * above * (1 + 0.03 * above if d.other else 1))

    c.mean = warm


def _cyclic(c: Cause, d: Draw) -> None:
    a, length = c.tell("amplitude", 0.005 * d.size), c.tell("wavelength", float(d.rng.uniform(0.8, 2.5)))
    phase = float(d.rng.uniform(-3, 3))

    def wave(mu: FloatArray, g: Hits) -> FloatArray:
        f = 2 * np.pi * g.r / length + phase
        return np.asarray(mu + a * (np.sin(f) + 0.35 * np.sin(2 * f + 1) if d.other else np.sin(f)))

    c.mean = wave


def _incidence_bias(c: Cause, d: Draw) -> None:
    k = 0.006 * d.signed
    c.mean = lambda mu, g: mu + k * ((1 - g.cosi) * 2.5 if d.other else g.tan(4))


def _reflectance(c: Cause, d: Draw) -> None:
    b = 0.022 * d.signed
    c.mean = lambda mu, g: mu + b * g.dark * (0.5 + 0.5 * g.cosi if d.other else 1)


def _beam_bias(c: Cause, d: Draw) -> None:
    sd, n = c.tell("sd", 0.004 * d.size), d.scene.laser.beams
    o = d.rng.normal(0, sd, n)
    if d.other:
        o = o * 0.8 + sd * np.sign(np.sin(np.arange(n) / n * 15))
    c.mean = lambda mu, g: mu + o[g.beam]


def _map_error(c: Cause, d: Draw) -> None:
    c.id, n = "world.map_error", 60
    sd = c.tell("sd", 0.008 * d.size)
    move = d.rng.laplace(0, sd / 2**0.5, (n, 2)) if d.other else d.rng.normal(0, sd, (n, 2))
    c.walls = lambda segs, ids: segs + np.tile(move[ids], (1, 2))


MAKERS: dict[str, Maker] = {
    **{"mount_x": _mount, "mount_y": _mount, "mount_yaw": _mount, "tilt": _tilt, "sweep": _sweep, "latency": _latency},
    **{"clock_skew": _clock_skew, "offset": _offset, "scale": _scale, "quadratic": _quadratic, "warmup": _warmup},
    **{"temperature": _temperature, "cyclic": _cyclic, "incidence_bias": _incidence_bias, "reflectance": _reflectance},
    "beam_bias": _beam_bias,
}
WORLD: dict[str, Maker] = {"map_error": _map_error}

# SPDX-License-Identifier: BSD-3-Clause
"""Causes in the scatter of a laser's readings."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.knoll.signals import normal
from kurumaisu.bench.strangers.knoll.things import Cause, Draw, Hits, Maker, Rng
from kurumaisu.types import BoolArray, FloatArray


def _range_noise(c: Cause, d: Draw) -> None:
    k, far = c.tell("share", 0.3 * d.size), d.far
    c.sd = lambda x, g: x * (1 + k * (2 * g.r / far if d.other else 1))


def _incidence_noise(c: Cause, d: Draw) -> None:
    k = 0.6 * d.size
    c.sd = lambda x, g: x * (1 + k * (np.minimum(1 / g.cosi, 8) ** 1.5 - 1 if d.other else g.tan(5)))


def _common_mode(c: Cause, d: Draw) -> None:
    sd = c.tell("sd", 0.0012 * d.size * max(1, d.scene.laser.sigma[0] / 0.004))
    c.common = sd, c.tell("rho", 0.98 if d.other else float(d.rng.uniform(0.6, 0.9)))


def _beam_correlation(c: Cause, d: Draw) -> None:
    rho, n = c.tell("rho", min(0.3 * d.size, 0.85)), d.scene.laser.beams

    def correlated(e: FloatArray) -> FloatArray:
        e = e.reshape(-1, n)
        if d.other:
            k = np.array([rho / 2, 1, rho / 2]) / np.sqrt(1 + rho**2 / 2)
            return np.asarray(np.apply_along_axis(lambda a: np.convolve(a, k, "same"), 1, e).ravel())
        x = lfilter([np.sqrt(1 - rho**2)], [1, -rho], e[:, 1:], axis=1, zi=rho * e[:, :1])[0]
        return np.asarray(np.concatenate([e[:, :1], x], 1).ravel())

    c.noise = correlated


def _heavy_tails(c: Cause, d: Draw) -> None:
    p, reach = c.tell("outliers", min(0.02 * d.size, 0.3)), c.tell("reach", float(d.rng.uniform(0.05, 0.2)))
    var = 2 * reach**2 if d.other else reach**2

    def dens(r: FloatArray, m: FloatArray, sd: FloatArray, g: Hits) -> FloatArray:
        far = p * 0.5 / reach * np.exp(-np.abs(r - m) / reach) if d.other else p * normal(r, m, np.hypot(sd, reach))
        return np.asarray((1 - p) * normal(r, m, sd) + far)

    def outliers(rng: Rng, r: FloatArray, g: Hits) -> FloatArray:
        hit = rng.random(r.size) < p
        return np.where(hit, r + (rng.laplace if d.other else rng.normal)(0, reach, r.size), r)

    c.dens, c.corrupt = dens, outliers
    c.moments = lambda m, v, g: (m, v + p * var)


def _mixed_pixels(c: Cause, d: Draw) -> None:
    p, jump = c.tell("probability", min(0.4 * d.size, 0.9)), c.tell("jump", float(d.rng.uniform(0.1, 0.2)))

    def at(g: Hits) -> BoolArray:
        return np.asarray((g.back - g.r > jump) & np.isfinite(g.back))

    def between(rng: Rng, r: FloatArray, g: Hits) -> FloatArray:
        f = rng.beta(1, 2, r.size) if d.other else rng.random(r.size)
        return np.where(at(g) & (rng.random(r.size) < p), r + f * (g.back - g.r), r)

    def dens(r: FloatArray, m: FloatArray, sd: FloatArray, g: Hits) -> FloatArray:
        gap = np.where(at(g), g.back - g.r, 1.0)
        f = np.clip((r - m) / gap, 0, 1)
        mixed = ((r > m) & (r < m + gap)) / gap * (2 * (1 - f) if d.other else 1)
        return np.where(at(g), (1 - p) * normal(r, m, sd) + p * mixed, normal(r, m, sd))

    def moments(m: FloatArray, v: FloatArray, g: Hits) -> tuple[FloatArray, FloatArray]:
        e1, e2 = (1 / 3, 1 / 6) if d.other else (0.5, 1 / 3)
        gap = np.where(at(g), g.back - g.r, 0.0)
        return m + p * e1 * gap, v + (p * e2 - (p * e1) ** 2) * gap**2

    c.corrupt, c.dens, c.moments = between, dens, moments


def _dropout(c: Cause, d: Draw) -> None:
    k, far = 0.04 * d.size, d.far
    p = c.tell("probability", min(k, 0.6))
    if d.other:
        c.lost = lambda m, g: np.clip(k * (0.3 + g.r / far + (g.cosi < 0.4)), 0, 0.7)
    else:
        c.lost = lambda m, g: np.full(m.size, p)


def _cutoff(c: Cause, d: Draw) -> None:
    c.id, room, far = "laser.saturation", d.scene.room, d.far
    top = min(far, np.hypot(room.width, room.depth)) * d.rng.uniform(0.45, 0.75) / d.size**0.5
    top = float(np.clip(top, 1.0, 0.95 * far))
    c.tell("inverse_far", 1 / top)
    if d.other:
        c.lost = lambda m, g: np.asarray(0.98 / (1 + np.exp(-np.clip((m - top) / (0.02 * top), -50, 50))))
    else:
        c.lost = lambda m, g: np.where(m > top, 1.0, 0.0)


def _crosstalk(c: Cause, d: Draw) -> None:
    fan, rng = d.scene.laser, d.rng
    p = c.tell("probability", min(0.25 * d.size, 0.8))
    width, drift = c.tell("width", float(rng.uniform(0.2, 0.5))), float(rng.uniform(-1, 1))
    reach = c.tell("reach", float(rng.uniform(2, min(5, d.far))))
    wide, start = fan.increment * fan.beams, rng.uniform(0, 2 * np.pi)
    share = p * min(1.0, width / max(wide, 1.0)) * (0.6 if d.other else 1)

    def burst(rng: Rng, r: FloatArray, g: Hits) -> FloatArray:
        t = np.repeat(np.round(g.t[:: fan.beams], 6), fan.beams)
        on = np.sin(2 * np.pi * t / 9.0) > -0.2 if d.other else np.ones(t.size, bool)
        apart = g.bearing - fan.angle_min - (start + drift * t) % wide
        x = on & (np.abs((apart + np.pi) % (2 * np.pi) - np.pi) < width / 2) & (rng.random(r.size) < p)
        return np.where(x, rng.uniform(fan.near, reach, r.size), r)

    c.corrupt = burst
    c.dens = lambda r, m, sd, g: (1 - share) * normal(r, m, sd) + share * ((r > 0) & (r < reach)) / reach
    c.moments = lambda m, v, g: (
        (1 - share) * m + share * reach / 2,
        (1 - share) * v + share * reach**2 / 12 + share * (1 - share) * (m - reach / 2) ** 2,
    )


def _quantisation(c: Cause, d: Draw) -> None:
    c.step = o = c.tell("step", float(max(0.008 * d.size, 3 * d.scene.laser.resolution)))
    cut = np.floor if d.other else np.round
    c.corrupt = lambda rng, r, g: np.asarray(cut(r / o) * o)
    c.moments = lambda m, v, g: (m - (o / 2 if d.other else 0), v + o**2 / 12)


MAKERS: dict[str, Maker] = {
    **{"range_noise": _range_noise, "incidence_noise": _incidence_noise, "common_mode": _common_mode},
    **{"beam_correlation": _beam_correlation, "heavy_tails": _heavy_tails, "mixed_pixels": _mixed_pixels},
    **{"dropout": _dropout, "cutoff": _cutoff, "crosstalk": _crosstalk, "quantisation": _quantisation},
}

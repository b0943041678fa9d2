# SPDX-License-Identifier: BSD-3-Clause
"""Scans as they are written, and how sure what acts on their scatter is."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from kurumaisu.bench.strangers.quay.base import Effects
from kurumaisu.bench.strangers.quay.scans import DARKNESS, View, edges, means, noise
from kurumaisu.bench.strangers.quay.things import Array, Bools, Rng

OUT, DROP = 0.002, 0.003  # what a clean laser does: share of outliers, of readings that are lost
Sure = dict[str, tuple[float, float]]  # squares of z and beside


def _errors(rng: Rng, eff: Effects, shape: tuple[int, ...], good: Bools, sure: Sure) -> Array:
    """Return errors in units of their sd."""
    e = rng.standard_normal(shape)
    if p := eff.get("laser.beam_correlation"):
        rho = p["rho"]
        for k in range(1, shape[1]):
            e[:, k] = rho * e[:, k - 1] + np.sqrt(1 - rho**2) * e[:, k]
        gain = float(-good.sum() * np.log(1 - rho**2))
        sure["laser.beam_correlation"] = gain, gain
    if p := eff.get("laser.heavy_tails"):
        nu = 1 / p["inverse_nu"]
        e = rng.standard_t(nu, shape) if not p["form"] else e * np.where(rng.random(shape) < 0.1, 4.0, 0.8)
    return e


def _see_sizes(eff: Effects, ratio: Array, whole: Array, good: Bools, sure: Sure) -> None:
    """Enter how sure sizes of errors are that are not the laser's; ratio: of their sd, whole: of errors."""
    for key in (k for k in ("laser.range_noise", "laser.incidence_noise", "unknown.spread") if k in eff):
        q = (ratio**2)[good]
        d = q / q.mean()
        z2 = float((q - 1 - np.log(q)).sum())
        sure[key] = z2, z2 if key == "laser.range_noise" else float((d - 1 - np.log(d)).sum())
    if "laser.heavy_tails" in eff:
        w = whole[good]
        var = np.var(w)
        lo = np.log(0.97 * np.exp(-(w**2) / 2 / var) / np.sqrt(2 * np.pi * var) + 0.03 * 0.001)
        h, b = np.histogram(w, 120, (-12, 12), density=True)
        hi = np.log(h[np.clip(np.digitize(w, b) - 1, 0, 119)] + 1e-4)
        both = 2 * max(float((hi - lo).sum()) - 100, 0.0)
        sure["laser.heavy_tails"] = both, both


def _lost(eff: Effects, g: View, m: Array, sure: Sure) -> Array:
    """Return the probability that a reading is lost."""
    drop = np.full(g.r.shape, DROP)
    if p := eff.get("laser.dropout"):
        dark = np.array([DARKNESS[w[6]] > 0.5 for w in g.scene.room.walls])[g.hit]
        x = {"probability": 1.0, "per_metre": g.r, "oblique": 1 - g.cosi, "dark": dark}[p["of"]]
        drop = np.clip(drop + p[p["of"]] * x, 0, 0.9)
        kl = drop * np.log(drop / DROP) + (1 - drop) * np.log((1 - drop) / (1 - DROP))
        gain = 2 * float(kl[np.isfinite(m) & (m < g.laser.rmax)].sum())
        sure["laser.dropout"] = gain, gain
    return drop


def _mixed(rng: Rng, probability: float, jump: float, g: View, y: Array, m: Array, sure: Sure) -> Array:
    r, edge = g.r, edges(g)
    far = np.maximum(np.roll(r, 1, 1), np.roll(r, -1, 1)) - r
    near = np.minimum(np.roll(r, 1, 1), np.roll(r, -1, 1)) - r
    gap = np.clip(np.where(far > -near, far, near), -3, 3)
    mix = edge & (abs(gap) > jump) & (rng.random(r.shape) < probability)
    y = np.where(mix, m + gap * rng.uniform(0.1, 0.9, r.shape), y)
    n = float((mix & np.isfinite(gap) & (y < g.laser.rmax)).sum())
    sure["laser.mixed_pixels"] = 5 * n, 2 * n * max(float(np.log(edge.size / max(edge.sum(), 1))) - 0.5, 0.1)
    return y


def _strays(rng: Rng, eff: Effects, g: View, y: Array, m: Array, good: Bools, sure: Sure) -> Array:
    """Return readings of which some are of something else than of what the beam meets."""
    shape, beta = g.r.shape, g.laser.bearings
    u = rng.uniform(0.1, 1, shape) * np.minimum(m, g.laser.rmax)
    if p := eff.get("laser.mixed_pixels"):
        y = _mixed(rng, p["probability"], p["jump"], g, y, m, sure)
    if p := eff.get("laser.crosstalk"):
        burst = rng.random(len(g.t)) < p["probability"]
        at = rng.uniform(beta[0], beta[-1]) + p["drift"] * (g.t - g.t[0])
        off = np.mod(beta - at[:, None] + np.pi, 2 * np.pi) - np.pi
        hit = burst[:, None] & (abs(off) < p["width"] / 2)
        hit &= rng.random(shape) < (0.6 if p["form"] else 1.0)
        y = np.where(hit, rng.uniform(g.laser.rmin, p["reach"], shape), y)
        n = float((hit & good).sum())
        beside = 2 * n * np.log(0.6 * good.sum() / (n + 1)) - 12.0 * burst.sum()
        sure["laser.crosstalk"] = 4 * n, max(float(beside), 0.0)
    return np.where(rng.random(shape) < OUT, u, y)


def _stepped(eff: Effects, y: Array, m: Array, sd: Array, res: float, good: Bools, sure: Sure) -> Array:
    """Return readings in coarser steps than the laser's own."""
    if p := eff.get("laser.quantisation"):
        step = p["step"]
        y = np.floor(y / step) * step if p["form"] else np.round(y / step) * step
        z, sd = (y - m)[good] / sd[good], sd[good]
        pr = ndtr(z + step / 2 / sd) - ndtr(z - step / 2 / sd)
        p0 = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) * res / sd + 1e-4
        gain = 2 * max(float(np.log((pr + 1e-4) / p0).sum()), 0.0)
        sure["laser.quantisation"] = gain, gain
    return y


def read(rng: Rng, eff: Effects, g: View, clean: Array) -> tuple[Array, Sure]:
    """Return scans as they are written, and how sure each cause of scatter is; clean: means without causes."""
    laser, m, sure = g.laser, means(eff, g), Sure()
    sd0, sd = laser.sd(g.r), noise(eff, g)
    good = np.isfinite(m) & (m < laser.rmax) & (m > laser.rmin) & ~edges(g)
    e = _errors(rng, eff, g.r.shape, good, sure)
    _see_sizes(eff, sd / sd0, e * sd / sd0, good, sure)
    y = m + sd * e
    if p := eff.get("laser.common_mode"):
        c = rng.standard_normal(len(g.t))
        for k in range(1, len(g.t)):
            c[k] = p["rho"] * c[k - 1] + np.sqrt(1 - p["rho"] ** 2) * c[k]
        y = y + p["sd"] * c[:, None] * (g.r / np.maximum(g.r, 0.1).mean() if p["form"] else 1)
    drop = _lost(eff, g, m, sure)
    y = _strays(rng, eff, g, y, m, good, sure)
    y = _stepped(eff, y, m, sd0, laser.res, good, sure)
    if p := eff.get("laser.saturation"):
        cut = good & (clean > 1 / p["inverse_far"] + 0.02) & (clean < laser.rmax)
        sure["laser.saturation"] = 6.0 * float(cut.sum()), 6.0 * float(cut.sum())
        if p["lost"]:
            y = np.where(m >= 1 / p["inverse_far"] - 1e-6, np.inf, y)
    y = np.round(np.round(y / laser.res) * laser.res, 4)
    y = np.where(np.isfinite(m), y, np.inf)
    y = np.where(y > laser.rmax, np.inf, np.where(y < laser.rmin, np.nan, y))
    y[rng.random(g.r.shape) < drop] = np.nan
    return y, sure

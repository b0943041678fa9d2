# SPDX-License-Identifier: BSD-3-Clause
"""Scans as they are read, with scatter and with what is no reading of the room: draws, and their moments."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Cause, Causes
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.laser import View, mean, sd
from kurumaisu.bench.strangers.marl.motions import at
from kurumaisu.bench.strangers.marl.rooms import Room
from kurumaisu.bench.strangers.marl.things import RESOLUTION, Laser, Rng
from kurumaisu.types import BoolArray, FloatArray

By = dict[str, Cause]
Moments = tuple[FloatArray, FloatArray]


def _correlated(e: FloatArray, c: Cause) -> FloatArray:
    """Return noise (s, beams) in which neighbouring beams are alike."""
    a, p = e.copy(), c.size
    if c.other:  # a moving average
        a[:, 1:] = (a[:, 1:] + p * a[:, :-1]) / np.hypot(1, p)
    else:
        for j in range(1, a.shape[1]):
            a[:, j] = p * a[:, j - 1] + np.sqrt(1 - p**2) * a[:, j]
    return a


def _noise(rng: Rng, by: By, scans: int, beams: int) -> FloatArray:
    n = scans * beams
    e = rng.standard_normal(n)
    if c := by.get("laser.beam_correlation"):
        e = _correlated(e.reshape(scans, beams), c).ravel()
    if c := by.get("laser.heavy_tails"):
        if c.other:
            e = e * np.where(rng.random(n) < 0.25 * c.size, 4.0, 1.0)
        else:
            e = e / np.sqrt(rng.chisquare(1 / c.size, n) / (1 / c.size))
    return e


def _common(rng: Rng, m: FloatArray, c: Cause, scans: int) -> FloatArray:
    """Return what all beams of a scan have in common."""
    z = rng.standard_normal(scans)
    for j in range(1, scans):
        z[j] = 0.5 * z[j - 1] + np.sqrt(0.75) * z[j]
    return np.repeat(z, len(m) // scans) * c.size * (m / np.sqrt((m * m).mean()) if c.other else 1)


def _mix(rng: Rng, x: FloatArray, q: View, c: Cause) -> None:
    """Put readings at edges between the two surfaces."""
    g = np.flatnonzero(q.edge())
    lo, hi = q.around()
    g = g[rng.random(len(g)) < c.size]
    f = rng.beta(2, 2, len(g)) if c.other else rng.random(len(g))
    x[g] = lo[g] + f * (hi[g] - lo[g])


def crosstalk(rng: Rng, las: Laser, d: Drive, c: Cause) -> BoolArray:
    """Return the beams of bursts: a window of bearings that wanders, in a share of the scans."""
    on = np.sin(d.ts / (2.5 if c.other else 6.0) + 3 * d.index) > np.cos(np.pi * min(c.size, 1))
    span = las.bearing[-1] - las.bearing[0]
    mid = las.bearing[0] + (d.ts * 0.37 + d.index) % span
    g = (np.abs(las.bearing - mid[:, None]) < 0.12) & on[:, None]
    return np.asarray((g & (rng.random(g.shape) < 0.7)).ravel())


def _quantised(x: FloatArray, c: Cause) -> FloatArray:
    return np.asarray(np.floor(x / c.size) * c.size + c.size / 2 if c.other else np.round(x / c.size) * c.size)


def read_scans(rng: Rng, d: Drive, room: Room, causes: Causes) -> FloatArray:
    """Return readings of the drive's scans (s, beams); nan: no valid reading, inf: no return."""
    q = View(d, room, d.ts, at(d.path, d.ts), causes)
    m, las, scans = mean(q, causes), q.laser, len(d.ts)
    by = {c.id: c for c in causes}
    x = m + sd(q, causes) * _noise(rng, by, scans, q.n)
    if c := by.get("laser.common_mode"):
        x += _common(rng, m, c, scans)
    if c := by.get("laser.mixed_pixels"):
        _mix(rng, x, q, c)
    if c := by.get("laser.crosstalk"):
        g = crosstalk(rng, las, d, c)
        x[g] = rng.uniform(0.2, min(las.far, 4), g.sum())
    if d.tails:
        g = rng.random(len(x)) < d.tails
        x[g] += rng.normal(0, 0.15, g.sum())
    if c := by.get("laser.quantisation"):
        x = _quantised(x, c)
    x = np.round(x / RESOLUTION) * RESOLUTION
    x = np.where(x > las.far, np.inf, np.where(x < las.near, np.nan, x))
    if c := by.get("laser.dropout"):
        lost = c.size * (2 * np.minimum(q.r / min(las.far, 6), 1) if c.other else 1)
        x[rng.random(len(x)) < lost] = np.nan
    return x.reshape(scans, q.n)


def _mixed(k: FloatArray, one: Moments, other: Moments) -> Moments:
    """Return moments (mean, variance) where a share k has other ones."""
    (m, var), (a, b) = one, other
    return np.asarray((1 - k) * m + k * a), np.asarray((1 - k) * var + k * b + k * (1 - k) * (m - a) ** 2)


def tailed(c: Cause) -> float:
    """Return by how much heavy tails widen a variance."""
    return 1 + 3.75 * c.size if c.other else 1 / (1 - 2 * c.size)


def moments(q: View, causes: Causes) -> Moments:
    """Return mean and sd of readings, with all that they suffer."""
    m, var = mean(q, causes), sd(q, causes) ** 2
    for c in causes:
        p = c.size
        if c.id == "laser.common_mode":
            var = var + p * p * (m * m / (m * m).mean() if c.other else 1)
        elif c.id == "laser.heavy_tails":
            var = var * tailed(c)
        elif c.id == "laser.quantisation":
            var = var + p * p / 12
        elif c.id == "laser.mixed_pixels":
            lo, hi = q.around()
            m, var = _mixed(p * q.edge(), (m, var), ((lo + hi) / 2, (hi - lo) ** 2 / (20 if c.other else 12)))
        elif c.id == "laser.crosstalk":
            k = p * 0.7 * min(0.24 / (q.laser.bearing[-1] - q.laser.bearing[0]), 1)
            top = min(q.laser.far, 4)
            bursts = np.full(1, (0.2 + top) / 2), np.full(1, (top - 0.2) ** 2 / 12)
            m, var = _mixed(np.full(1, k), (m, var), bursts)
    return m, np.sqrt(var)

# SPDX-License-Identifier: BSD-3-Clause
"""Means and covariances of motions as measured."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Causes, size_of
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.motions import DT, at, between, clock, compose, integrate, observe, unobserve
from kurumaisu.bench.strangers.marl.things import Reference
from kurumaisu.types import FloatArray

H, PER = 0.1, 5  # length of the coarser cells, and how many cells are in one
POSE = (0, 0, 1)  # which of a reference's errors x, y and heading have


def increments(d: Drive, s0: FloatArray, s1: FloatArray, causes: Causes, m0: FloatArray | None = None) -> FloatArray:
    """Return mean motions (3, n) between stamps, from measured poses m0 or those that are true without causes."""
    path = integrate(d.rates(causes))
    rel = between(at(path, clock(s0, causes)), at(path, clock(s1, causes)))
    p0 = at(d.path, s0) if m0 is None else unobserve(m0, causes)
    return between(observe(p0, causes), observe(compose(p0, rel), causes))


def apart(t: FloatArray) -> FloatArray:
    """Return how far each two times are apart."""
    return np.asarray(np.abs(t[:, None] - t))


def _correlation(tau: float, k: int) -> FloatArray:
    """Return the correlation of coarser cells by their distance."""
    n, q = np.arange(k), np.exp(-H / tau)
    row = (tau / H) ** 2 * (1 - q) ** 2 * np.exp(-(np.maximum(n, 1) - 1) * H / tau)
    row[0] = 2 * tau / H * (1 - tau / H * (1 - q))
    row[row < 1e-9] = 0
    return np.asarray(row)


def _through(j: FloatArray, row: FloatArray) -> FloatArray:
    """Return J C J' for a C of this row."""
    jc = j * row[0]
    for i in range(1, int((row > 0).sum())):
        jc[:, i:] += row[i] * j[:, :-i]
        jc[:, :-i] += row[i] * j[:, i:]
    return np.asarray(jc @ j.T)


def _referred(ref: Reference, s: FloatArray, a: FloatArray, moved: FloatArray) -> FloatArray:
    """Return the covariance of motions by the reference's errors at stamps s, first of starts a, then of ends."""
    n = a.shape[1]
    same, far = apart(s) < 1e-6, np.exp(-apart(s) / ref.tau)
    errors = [ref.white[i] ** 2 * same + ref.wander[i] ** 2 * far for i in (0, 1)]
    e, i = np.zeros((3, n, 3, 2 * n)), np.arange(n)
    co, si = np.cos(a[2]), np.sin(a[2])
    for sign, o in ((-1, 0), (1, n)):
        e[0, i, 0, i + o], e[0, i, 1, i + o] = sign * co, sign * si
        e[1, i, 0, i + o], e[1, i, 1, i + o] = -sign * si, sign * co
        e[2, i, 2, i + o] = sign
    e[0, i, 2, i], e[1, i, 2, i] = moved[1], -moved[0]
    e = e.transpose(1, 0, 2, 3).reshape(3 * n, 3, 2 * n)
    return np.asarray(sum(e[:, q] @ errors[POSE[q]] @ e[:, q].T for q in range(3)))


def covariances(d: Drive, ref: Reference, s0: FloatArray, s1: FloatArray, causes: Causes = ()) -> list[FloatArray]:
    """Return covariances of motions (3n, 3n) by the noise of v, of w, and by the reference."""
    t0, t1 = clock(s0, causes), clock(s1, causes)
    n, k = len(s0), int(len(d.t) * DT / H)
    t = (np.arange(k) + 0.5) * H
    inside = np.clip(np.minimum(t1[:, None], t + H / 2) - np.maximum(t0[:, None], t - H / 2), 0, None)
    g = d.gain(*d.rates(causes)[:2], causes)[:, : k * PER].reshape(2, k, PER).mean(2)
    a, b, c = at(d.path, t0), at(d.path, t1), at(d.path, t)
    moved = between(a, b)
    b = observe(b, [q for q in causes if q.id.startswith("base.marker")])
    th = a[2] + size_of(causes, "base.marker_yaw")
    x, y = b[0][:, None] - c[0], b[1][:, None] - c[1]
    co, si = np.cos(th)[:, None], np.sin(th)[:, None]
    ex, ey = co * x + si * y, -si * x + co * y
    turn = c[2] - th[:, None]
    jv = np.stack([inside * g[0] * np.cos(turn), inside * g[0] * np.sin(turn), 0 * inside], 1).reshape(3 * n, k)
    jw = np.stack([-inside * g[1] * ey, inside * g[1] * ex, inside * g[1]], 1).reshape(3 * n, k)
    row = _correlation(d.noise.tau, k)
    rated = [s * s * _through(j, row) for j, s in ((jv, d.noise.v), (jw, d.noise.w))]
    return [*rated, _referred(ref, np.r_[s0, s1], a, moved)]

# SPDX-License-Identifier: BSD-3-Clause
"""The reference's poses, and what causes predict of the motions between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.knoll.driving import growth, open_rates
from kurumaisu.bench.strangers.knoll.signals import wandering
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Pose, Rng, Scene
from kurumaisu.types import FloatArray, IntArray

_PARTS = 10  # of a motion, in each of which its noise counts as one


def _marker(causes: Sequence[Cause]) -> FloatArray:
    return sum((c.marker for c in causes if c.marker is not None), np.zeros(3))


def compose(pose: Pose, m: FloatArray) -> Pose:
    """Return the pose of a point m (x, y, yaw) of the body."""
    x, y, th = pose
    c, s = np.cos(th), np.sin(th)
    return x + c * m[0] - s * m[1], y + s * m[0] + c * m[1], th + m[2]


def tracked(causes: Sequence[Cause], t: FloatArray, pose: Pose) -> Pose:
    """Return the reference's pose, without noise, of a true pose at t."""
    x, y, th = compose(pose, _marker(causes))
    for c in causes:
        if c.warp:
            dx, dy, dth = c.warp(t, x, y, th)
            x, y, th = x + dx, y + dy, th + dth
    return x, y, th


def untracked(causes: Sequence[Cause], t: FloatArray, pose: Pose) -> Pose:
    """Return the true pose of a pose of the reference at t."""
    x, y, th = pose
    for c in causes[::-1]:
        if c.warp:
            x0, y0, th0 = x, y, th
            for _ in range(3):
                dx, dy, dth = c.warp(t, x, y, th)
                x, y, th = x0 - dx, y0 - dy, th0 - dth
    m = _marker(causes)
    th = th - m[2]
    cos, sin = np.cos(th), np.sin(th)
    return x - cos * m[0] + sin * m[1], y - sin * m[0] - cos * m[1], th


def observe(rng: Rng, sc: Scene, causes: Sequence[Cause], x: Drive) -> None:
    """Draw the rows of the reference."""
    end = x.n * DT
    t = np.cumsum(rng.uniform(0.8, 1.2, int(end * sc.ref.rate)) / sc.ref.rate) + rng.uniform(0, 0.05)
    t = t[t < end - 0.05]
    for _ in range(rng.integers(0, 4)):
        a = rng.uniform(5, end - 5)
        t = t[(t < a) | (t > a + rng.uniform(0.3, 2.0))]
    n, dt = t.size, 1 / sc.ref.rate
    x.clean = np.array(tracked(causes, t, x.at(t)))
    q, much, x.bad = x.clean.copy(), np.ones(n), np.zeros(n, bool)
    for _ in range(rng.integers(0, 2)):
        a = rng.uniform(5, end - 5)
        j = (t > a) & (t < a + rng.uniform(0.5, 2))
        much[j], x.bad[j] = 3.0, True
    white = rng.normal(0, sc.ref.white_p, (2, n)) * much
    q[:2] += white + [wandering(rng, n, sc.ref.slow_p, sc.ref.slow_time, dt) for _ in range(2)]
    q[2] += rng.normal(0, sc.ref.white_h, n) * much + wandering(rng, n, sc.ref.slow_h, sc.ref.slow_time, dt)
    off = rng.random(n) < 0.0015
    q[:2, off] += rng.normal(0, 0.3, (2, off.sum()))
    q[2, off] += rng.normal(0, 0.2, off.sum())
    x.bad |= off
    x.rt, x.ref = t * (1 + sum(c.clock for c in causes)), q


@dataclass(frozen=True)
class Motions:
    """Motions (n, 3) in their first poses, and the true ways (3, n, edges) there at edges of time."""

    means: FloatArray
    way: FloatArray
    edges: FloatArray


def in_frame(start: FloatArray | Pose, end: FloatArray | Pose) -> FloatArray:
    """Return the motions from start to end, in start's frame, along the first axis."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    c, s = np.cos(start[2]), np.sin(start[2])
    return np.stack([c * dx + s * dy, -s * dx + c * dy, end[2] - start[2]])


def motions(
    sc: Scene, causes: Sequence[Cause], x: Drive, ta: FloatArray, tb: FloatArray, start: FloatArray, n: int = 60
) -> Motions:
    """Return the motions from the reference's poses start at ta to tb, in n steps."""
    rates = open_rates(sc, causes, x)
    f = np.linspace(0, 1, n + 1)
    e = (ta[:, None] + (tb - ta)[:, None] * f) / (1 + sum(c.clock for c in causes))
    ahead, turn, aside = (np.diff(x.integral(a, e), axis=1) for a in rates)
    h = np.maximum(np.diff(e, axis=1), 1e-12)
    px, py, th = untracked(causes, ta, (start[0], start[1], start[2]))
    places = [c.place for c in causes if c.place]
    way = np.zeros((3, ta.size, n + 1))
    way[:, :, 0] = px, py, th
    for j in range(n):
        a, b, u = ahead[:, j], turn[:, j], aside[:, j]
        for place in places:
            a, b = place(px, py, th, a / h[:, j], b / h[:, j])
            a, b = a * h[:, j], b * h[:, j]
        m = th + b / 2
        px, py, th = px + a * np.cos(m) - u * np.sin(m), py + a * np.sin(m) + u * np.cos(m), th + b
        way[:, :, j + 1] = px, py, th
    means = in_frame(start, tracked(causes, tb, (px, py, th))).T
    return Motions(means, in_frame(way[:, :, :1], way), e)


def integral_cov(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, sd: float, tau: float) -> FloatArray:
    """Return the covariance of the integrals of wandering noise over [a, b] and [c, d]."""

    def var(t: FloatArray) -> FloatArray:
        t = np.abs(t)
        return np.asarray(2 * sd**2 * tau * (t - tau * (1 - np.exp(-t / tau))))

    return 0.5 * (var(d - a) + var(c - b) - var(c - a) - var(d - b))


class MotionErrors:
    """How motions between rows ia and ib err: by the noise of the rates and by the poses at both ends."""

    def __init__(
        self, sc: Scene, causes: Sequence[Cause], x: Drive, ia: IntArray, ib: IntArray, moved: Motions
    ) -> None:
        self.sc, self.x, self.ia, self.ib = sc, x, ia, ib
        each = np.arange(0, moved.edges.shape[1], (moved.edges.shape[1] - 1) // _PARTS)
        e, way = moved.edges[:, each], moved.way[:, :, each]
        px, py, th = (way[..., 1:] + way[..., :-1]) / 2
        v, w, _ = open_rates(sc, causes, x)
        gv, gw = (
            np.diff(x.integral(a, e), axis=1) / np.maximum(np.diff(e, axis=1), 1e-9) for a in growth(causes, v, w)
        )
        by_v = np.stack([np.cos(th), np.sin(th), 0 * th], 1) * gv[:, None]
        by_w = np.stack([-(way[1][:, -1:] - py), way[0][:, -1:] - px, np.ones_like(px)], 1) * gw[:, None]
        self.edges, self.by_rates = e, ((by_v, sc.sd_v), (by_w, sc.sd_w))
        th, n, m = x.ref[2][ia], len(ia), moved.means
        r = np.zeros((n, 3, 3))
        r[:, 0, 0] = r[:, 1, 1] = np.cos(th)
        r[:, 0, 1], r[:, 1, 0], r[:, 2, 2] = np.sin(th), -np.sin(th), 1
        self.by_end, self.by_start = r, -r
        self.by_start[:, 0, 2], self.by_start[:, 1, 2] = m[:, 1], -m[:, 0]

    def each(self) -> FloatArray:
        """Return the covariance of each motion, (n, 3, 3)."""
        sc, n = self.sc, len(self.ia)
        white, slow = np.diag(sc.ref.white), np.diag(sc.ref.slow)
        apart = self.x.rt[self.ib] - self.x.rt[self.ia]
        out = np.zeros((n, 3, 3))
        for i in range(n):
            a, z = self.edges[i, :-1], self.edges[i, 1:]
            for g, sd in self.by_rates:
                out[i] += g[i] @ integral_cov(a[:, None], z[:, None], a, z, sd, sc.noise_time) @ g[i].T
            rho, by_a, by_b = np.exp(-apart[i] / sc.ref.slow_time), self.by_start[i], self.by_end[i]
            out[i] += (
                by_a @ (white + slow) @ by_a.T
                + by_b @ (white + slow) @ by_b.T
                + rho * (by_a @ slow @ by_b.T + by_b @ slow @ by_a.T)
            )
        return out

    def together(self) -> FloatArray:
        """Return the covariance of all motions, (3 n, 3 n)."""
        sc, n = self.sc, len(self.ia)
        a, z = self.edges[:, :-1].ravel(), self.edges[:, 1:].ravel()
        out = np.zeros((3 * n, 3 * n))
        for g, sd in self.by_rates:
            cov = integral_cov(a[:, None], z[:, None], a, z, sd, sc.noise_time).reshape(n, _PARTS, n, _PARTS)
            out += np.einsum("ipa,iajb,jqb->ipjq", g, cov, g, optimize=True).reshape(3 * n, 3 * n)
        rows = np.unique(np.concatenate([self.ia, self.ib]))
        h = np.zeros((3 * n, 3 * rows.size))
        for ends, by in ((self.ia, self.by_start), (self.ib, self.by_end)):
            for i, j in enumerate(np.searchsorted(rows, ends)):
                h[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] += by[i]
        return np.asarray(out + h @ sc.ref.cov(self.x.rt[rows]) @ h.T)

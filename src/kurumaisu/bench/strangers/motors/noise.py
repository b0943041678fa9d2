# SPDX-License-Identifier: BSD-3-Clause
"""Noise of rates and reference, and whitening by a Kalman filter whose covariance it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .plant import Array, H


@dataclass
class Noise:
    """Sizes: rates (Ornstein-Uhlenbeck, while commanded to move), reference white and drift, stamps."""

    sd_v: float
    sd_w: float
    sd_side: float
    tau: float
    position: float
    heading: float
    drift: float
    drift_heading: float
    slow: float
    stamp: float


def draw(rng: np.random.Generator) -> Noise:
    """Sizes of a recording."""
    u = rng.uniform
    stamp = float(rng.choice([0.0, 0.002], p=[0.8, 0.2]))
    return Noise(
        u(0.006, 0.014),
        u(0.012, 0.025),
        u(0.001, 0.004),
        u(0.15, 0.45),
        u(0.002, 0.006),
        u(0.002, 0.006),
        u(0, 0.002),
        u(0, 0.002),
        u(15, 40),
        stamp,
    )


def wandering(rng: np.random.Generator, steps: int, sd: float, tau: float, dt: float = H) -> Array:
    """An Ornstein-Uhlenbeck series with the mean over each step left as its value (dt much below tau)."""
    a = np.exp(-dt / tau)
    x, e = np.empty(steps), rng.normal(size=steps) * sd * np.sqrt(1 - a * a)
    x[0] = rng.normal() * sd
    for i in range(1, steps):
        x[i] = a * x[i - 1] + e[i]
    return x


def _parts(dt: Array, sd: Array, tau: float) -> tuple[Array, Array, Array, Array]:
    a = np.exp(-dt / tau)
    n = sd**2 * (1 - a * a)
    qn = sd**2 * tau * (1 - a) ** 2
    q = sd**2 * tau**2 * (2 * dt / tau - 3 + 4 * a - a * a)
    return a, n, qn, q


def integral_sd(span: float, sd: float, tau: float) -> float:
    """Standard deviation of the integral of a rate's noise over a span."""
    a = np.exp(-span / tau)
    return float(sd * tau * np.sqrt(2 * span / tau - 2 + 2 * a))


def whiten(t: Array, moving: Array, speed: tuple[float, float], noise: Noise, signals: Array) -> Array:
    """Whiten increments between rows at t: signals (channels, rows - 1, m) to the same shape.

    The covariance is that of: the integral q of an OU noise n (moving: share of each interval in which it acts),
    an OU drift d of the reference, white errors of both rows. The sum of the increments is filtered with a diffuse
    start; its normed innovations are the increments times the inverse Cholesky factor of their covariance, and are
    so for a signal as for the residual. speed: rms of v and w, for what errors of heading and stamps add.
    """
    dt = np.diff(t)
    gap = float(np.median(dt))
    v, w = speed
    extra = np.hypot(noise.position * w, noise.heading * v) * np.sqrt(gap)  # by turned frames, per root second
    sds = (noise.sd_v, noise.sd_side, noise.sd_w)
    white = (
        np.array([np.hypot(noise.position, v * noise.stamp), noise.position, np.hypot(noise.heading, w * noise.stamp)])
        ** 2
    )
    drift = np.array([noise.drift, noise.drift, noise.drift_heading])
    f = np.zeros((len(dt), 3, 3, 3))
    g = np.zeros((len(dt), 3, 3, 3))
    for c in range(3):
        a, n, qn, q = _parts(dt, np.full(len(dt), sds[c]), noise.tau)
        b = np.exp(-dt / noise.slow)
        f[:, c, 0, 0], f[:, c, 0, 1], f[:, c, 1, 1], f[:, c, 2, 2] = 1, moving * noise.tau * (1 - a), a, b
        g[:, c, 0, 0], g[:, c, 1, 1], g[:, c, 2, 2] = (
            q * moving**2 + (extra**2 * dt if c == 1 else 1e-14),
            n,
            drift[c] ** 2 * (1 - b * b),
        )
        g[:, c, 0, 1] = g[:, c, 1, 0] = qn * moving
    p = np.zeros((3, 3, 3))
    for c in range(3):
        p[c] = np.diag([1e-9, sds[c] ** 2, drift[c] ** 2])
    h = np.array([1.0, 0.0, 1.0])
    x = np.zeros((3, 3, signals.shape[2]))
    total = np.cumsum(signals, axis=1)
    y = np.concatenate([np.zeros_like(total[:, :1]), total], axis=1)
    p[:, 0, 0] = 1e2  # diffuse: the first row only says where it starts
    out = np.empty_like(signals)
    for k in range(len(t)):
        if k:
            x, p = f[k - 1] @ x, f[k - 1] @ p @ f[k - 1].transpose(0, 2, 1) + g[k - 1]
        ph = p @ h
        s = ph @ h + white
        e = y[:, k] - x[:, 0] - x[:, 2]
        gain = ph / s[:, None]
        if k:
            out[:, k - 1] = e / np.sqrt(s)[:, None]
        x = x + gain[:, :, None] * e[:, None, :]
        p = p - gain[:, :, None] * ph[:, None, :]
    return out

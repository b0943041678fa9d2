# SPDX-License-Identifier: BSD-3-Clause
"""The noise: first-order processes on the rates and on the reference, and the whitening of its increments.

C, the covariance of the increments of the reference, is that of a linear state space: the processes on the three
rates, the drifts of the reference, and the error of the last row (white, and v times the jitter of its stamp). A Kalman
filter factors it: its innovations, divided by their square roots, are the whitened increments, so s' C^-1 s is the sum
of their squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .plant import DT, Arr, increments


@dataclass
class Noise:
    """Processes (channel 0 v, 1 w, 2 sideways; sd; tau), and the errors of the reference."""

    parts: list[tuple[int, float, float]]
    position: float  # white [m], [rad]
    heading: float
    drift: tuple[float, float]  # sd of the drift of x and y, of the heading
    drift_tau: float
    jitter: float  # sd of the stamps [s]
    at_rest: float  # share of the fluctuations that is left at rest

    def rates(self, rng: np.random.Generator, n: int) -> Arr:
        """The fluctuations on the grid, as if the chair always moved."""
        out = np.zeros((n, 3))
        for channel, sd, tau in self.parts:
            out[:, channel] += ou(rng, n, DT, sd, tau)
        return out


def ou(rng: np.random.Generator, n: int, dt: float, sd: float, tau: float) -> Arr:
    """A stationary first-order process."""
    a = float(np.exp(-dt / tau))
    e = sd * np.sqrt(1 - a * a) * rng.standard_normal(n)
    e[0] = sd * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -a], e))


def draw(rng: np.random.Generator, jitter: bool, drift: bool) -> Noise:
    """Another chair on another floor, seen by another reference."""
    sd_v, sd_w, sd_y = rng.uniform(0.006, 0.014), rng.uniform(0.012, 0.028), rng.uniform(0.002, 0.005)
    share, parts = rng.uniform(0.3, 0.8), []
    for channel, sd in enumerate((sd_v, sd_w)):
        parts += [(channel, sd * np.sqrt(share), rng.uniform(0.1, 0.35))]
        parts += [(channel, sd * np.sqrt(1 - share), rng.uniform(0.5, 1.2))]
    parts.append((2, sd_y, rng.uniform(0.2, 0.5)))
    position, heading = rng.uniform(0.001, 0.005), rng.uniform(0.002, 0.007)
    slow = rng.uniform(2.0, 3.5) if drift else rng.uniform(0.3, 1.0)
    return Noise(
        parts, position, heading, (slow * position, 0.7 * slow * heading), rng.uniform(8, 30),
        rng.uniform(0.002, 0.006) if jitter else 0.0, float(rng.choice([1.0, rng.uniform(0.05, 0.4)])),
    )  # fmt: skip


class Whitener:
    """The filter for runs in lockstep (shorter ones are padded)."""

    def __init__(self, noise: Noise, runs: list[tuple[Arr, Arr, Arr, Arr]]) -> None:
        """Each run: stamps, rows (x, y, theta), rates at the rows (v, w), the gate between rows."""
        self.size = [len(t) - 1 for t, _, _, _ in runs]
        n, m, k = max(self.size), len(runs), len(noise.parts)
        self.n, self.m, self.k = n, m, k
        z = k + 6
        g, q = np.zeros((n, m, z + 3, z)), np.zeros((n, m, z + 3, z + 3))
        fresh0 = np.zeros((m, 3, 3))
        for r, (t, rows, speed, open_) in enumerate(runs):
            pad = n - self.size[r]
            wide, flat = ((0, pad), (0, 0)), (0, pad)
            rows, speed = np.pad(rows, wide, "edge"), np.pad(speed, wide, "edge")
            dt, open_ = np.pad(np.diff(t), flat, "edge"), np.pad(open_, flat, "edge")
            g[:, r], q[:, r], fresh0[r] = _system(noise, rows, speed, dt, open_)
        p = np.zeros((m, z, z))
        for i, (_, sd, _) in enumerate(noise.parts):
            p[:, i, i] = sd * sd
        p[:, k : k + 3, k : k + 3] = np.diag(np.array([noise.drift[0], noise.drift[0], noise.drift[1]]) ** 2)
        p[:, k + 3 :, k + 3 :] = fresh0
        self.f, self.h = g[:, :, :z], g[:, :, z:]
        self.gain, self.root = np.zeros((n, m, z, 3)), np.zeros((n, m, 3, 3))
        for i in range(n):
            full = g[i] @ p @ g[i].transpose(0, 2, 1) + q[i]
            s = full[:, z:, z:]
            inverse = np.linalg.inv(s)
            self.gain[i] = full[:, :z, z:] @ inverse
            p = full[:, :z, :z] - self.gain[i] @ full[:, z:, :z]
            self.root[i] = s
        self.root = np.linalg.inv(np.linalg.cholesky(self.root))

    def apply(self, signals: list[Arr]) -> Arr:
        """Whiten increments; one array (rows x 3 x columns) per run; all in one column each."""
        cols = signals[0].shape[2]
        y = np.zeros((self.n, self.m, 3, cols))
        for r, s in enumerate(signals):
            y[: self.size[r], r] = s
        state = np.zeros((self.m, self.k + 6, cols))
        for i in range(self.n):
            y[i] -= self.h[i] @ state
            state = self.f[i] @ state + self.gain[i] @ y[i]
        y = self.root @ y
        return np.concatenate([y[:size, r].reshape(-1, cols) for r, size in enumerate(self.size)])


def _system(noise: Noise, rows: Arr, speed: Arr, dt: Arr, gates: Arr) -> tuple[Arr, Arr, Arr]:
    """Transition and covariance of (processes, drifts, row error; increments), and the first row's covariance."""
    n, k = len(dt), len(noise.parts)
    z = k + 6
    step = increments(rows)
    g, q = np.zeros((n, z + 3, z)), np.zeros((n, z + 3, z + 3))
    # how the integrals over the three rates show in (dx, dy, dtheta)
    show = np.zeros((n, 3, 3))
    show[:, 0, 0] = show[:, 1, 2] = show[:, 2, 1] = 1.0
    show[:, 0, 1], show[:, 1, 1] = -0.5 * step[:, 1], 0.5 * step[:, 0]
    show *= gates[:, None, None]
    for i, (channel, sd, tau) in enumerate(noise.parts):
        a, u = np.exp(-dt / tau), dt / tau
        seen = show[:, :, channel]
        g[:, i, i] = a
        g[:, z:, i] = seen * (tau * (1 - a))[:, None]
        q[:, i, i] = sd**2 * (1 - a * a)
        cross = seen * (sd**2 * tau * (1 - a) ** 2)[:, None]
        q[:, i, z:] += cross
        q[:, z:, i] += cross
        inside = sd**2 * tau**2 * np.maximum(2 * u - 3 + 4 * a - a * a, 2 / 3 * u**3 * (u < 1e-3))
        q[:, z:, z:] += inside[:, None, None] * seen[:, :, None] * seen[:, None, :]
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    turn = np.zeros((n, 3, 3))  # map to body at the earlier row
    turn[:, 0, 0] = turn[:, 1, 1] = c[:-1]
    turn[:, 0, 1], turn[:, 1, 0] = s[:-1], -s[:-1]
    turn[:, 2, 2] = 1.0
    before = -turn
    before[:, 0, 2], before[:, 1, 2] = step[:, 1], -step[:, 0]
    b = np.exp(-dt / noise.drift_tau)
    drift = np.array([noise.drift[0], noise.drift[0], noise.drift[1]]) ** 2
    g[:, k : k + 3, k : k + 3] = b[:, None, None] * np.eye(3)
    g[:, z:, k : k + 3] = before + turn * b[:, None, None]
    g[:, z:, k + 3 :] = before
    along = np.stack([speed[:, 0] * c, speed[:, 0] * s, speed[:, 1]], axis=1) * noise.jitter
    white = (
        np.diag(np.array([noise.position, noise.position, noise.heading]) ** 2) + along[:, :, None] * along[:, None, :]
    )
    slow = (1 - b * b)[:, None, None] * np.diag(drift)
    for at, cov in ((k, slow), (k + 3, white[1:])):
        q[:, at : at + 3, at : at + 3] = cov
        q[:, at : at + 3, z:] = cov @ turn.transpose(0, 2, 1)
        q[:, z:, at : at + 3] = turn @ cov
        q[:, z:, z:] += turn @ cov @ turn.transpose(0, 2, 1)
    return g, q, white[0]


def query_sd(noise: Noise, t: Arr, rows: Arr, gates: Arr) -> Arr:
    """Sd of (dx, dy, dtheta) of one query, from the true noise; t, rows and gates on a fine grid from t0 to t1."""
    c, s = np.cos(rows[0, 2]), np.sin(rows[0, 2])
    d = rows[:, :2] - rows[0, :2]
    x, y, psi = c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], rows[:, 2] - rows[0, 2]
    one, none, dt = np.ones(len(t)), np.zeros(len(t)), t[1] - t[0]
    weight = [
        [np.cos(psi), np.sin(psi), none], [-(y[-1] - y), x[-1] - x, one], [-np.sin(psi), np.cos(psi), none]
    ]  # fmt: skip
    cov = np.zeros(3)
    for channel, sd, tau in noise.parts:
        r = sd**2 * np.exp(-np.abs(t[:, None] - t[None]) / tau)
        for i in range(3):
            a = weight[channel][i] * gates * dt
            cov[i] += a @ r @ a
    drift = 2 * (1 - np.exp(-(t[-1] - t[0]) / noise.drift_tau))
    place, head = (
        2 * noise.position**2 + drift * noise.drift[0] ** 2,
        2 * noise.heading**2 + drift * noise.drift[1] ** 2,
    )
    start = noise.heading**2 + noise.drift[1] ** 2
    cov += np.array([place + y[-1] ** 2 * start, place + x[-1] ** 2 * start, head])
    return np.asarray(np.sqrt(cov))

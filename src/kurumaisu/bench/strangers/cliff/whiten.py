# SPDX-License-Identifier: BSD-3-Clause
"""What a signal weighs in the reference's poses: a Kalman filter with the true noise whitens increments.

Deviations are in the body frame: d[k+1] = Ad(D^-1) d[k] + eps, D the model's increment. The state is (error of
the pose 3, drift of the reference 3, noise of v and w 2); rows measure pose error + drift + white noise. The
covariance C of all rows together is that of this linear model, exactly: the norm of the innovations of a signal
s, each divided by its own sd, is sqrt(s' C^-1 s). The first pose is unknown (sd 2 m, 2 rad).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .values import Array, Noise, wrap

Path = Callable[[Array], Array]


def increments(poses: Array) -> Array:
    """Motion from each row to the next, in the body frame of the first."""
    d = np.diff(poses, axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], wrap(d[:, 2])])


def epsilon(have: Array, model: Array) -> Array:
    """Difference of increments, in the body frame of their end."""
    d = have - model
    c, s = np.cos(model[:, 2]), np.sin(model[:, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], wrap(d[:, 2])])


def adjoint(d: Array) -> Array:
    """How a deviation is carried through an increment."""
    c, s = np.cos(d[2]), np.sin(d[2])
    return np.array([[c, s, -c * d[1] + s * d[0]], [-s, c, s * d[1] + c * d[0]], [0.0, 0.0, 1.0]])


def deviations(have: list[Array], model: Array) -> Array:
    """Rows of deviations (rows, 3, signals) of measured rows from the model's."""
    inc = increments(model)
    eps = np.stack([epsilon(increments(h), inc) for h in have], axis=2)
    out = np.zeros((len(model), 3, len(have)))
    for k, d in enumerate(inc):
        out[k + 1] = adjoint(d) @ out[k] + eps[k]
    return out


def transitions(d: Array, dt: Array, gate: Array, noise: Noise) -> tuple[Array, Array]:
    """Matrices and covariances of steps of the state."""
    n = len(dt)
    f, q, ad, lead = np.zeros((n, 8, 8)), np.zeros((n, 8, 8)), np.zeros((n, 3, 3)), np.zeros((n, 3, 2))
    tau, fade, keep = noise.tau, np.exp(-dt / noise.tau), np.exp(-dt / noise.drift_tau)
    c, s = np.cos(d[:, 2]), np.sin(d[:, 2])
    ad[:, 0, 0], ad[:, 0, 1], ad[:, 1, 0], ad[:, 1, 1], ad[:, 2, 2] = c, s, -s, c, 1.0
    ad[:, 0, 2], ad[:, 1, 2] = -c * d[:, 1] + s * d[:, 0], s * d[:, 1] + c * d[:, 0]
    lead[:, 0, 0], lead[:, 1, 1], lead[:, 2, 1] = 1.0, 0.5 * d[:, 0], 1.0
    lead *= gate[:, None, None]
    var = noise.rates**2
    f[:, :3, :3], f[:, :3, 6:] = ad, (tau * (1.0 - fade))[:, None, None] * lead
    f[:, 3:5, 3:5], f[:, 5, 5] = keep[:, None, None] * ad[:, :2, :2], keep
    f[:, 6, 6], f[:, 7, 7] = fade, fade
    whole = np.maximum(2.0 * tau * dt - tau * tau * (3.0 - 4.0 * fade + fade * fade), 0.0)
    q[:, :3, :3] = whole[:, None, None] * ((lead * var) @ lead.transpose(0, 2, 1))
    q[:, :3, 6:] = (tau * (1.0 - fade) ** 2)[:, None, None] * lead * var
    q[:, 6:, :3] = q[:, :3, 6:].transpose(0, 2, 1)
    q[:, 6, 6], q[:, 7, 7] = var[0] * (1.0 - fade**2), var[1] * (1.0 - fade**2)
    q[:, [3, 4, 5], [3, 4, 5]] = (1.0 - keep**2)[:, None] * noise.drift**2
    return f, q


class Filter:
    """A pass over one run's rows: steps between rows, and what each row tells."""

    def __init__(self, times: Array, model: Path, gate: Path, noise: Noise, jitter: float = 0.0) -> None:
        self.times, self.model, self.gate, self.noise = times, model, gate, noise
        inc, dt = increments(model(times)), np.diff(times)
        f, q = transitions(inc, dt, gate(0.5 * (times[1:] + times[:-1])), noise)
        for k in np.flatnonzero(dt > 0.15):
            f[k], q[k] = self.span(float(times[k]), float(times[k + 1]))
        lo, hi = np.maximum(np.arange(len(times)) - 1, 0), np.minimum(np.arange(len(times)) + 1, len(times) - 1)
        ends = model(times)
        speed = (ends[hi] - ends[lo]) / np.maximum(times[hi] - times[lo], 1e-3)[:, None]
        speed[:, :2] = np.hypot(speed[:, 0], speed[:, 1])[:, None] * [1.0, 0.0]
        white = noise.white**2 + (jitter * speed) ** 2  # stamps that jitter blur what moves
        p = np.zeros((8, 8))
        p[:3, :3] = 4.0 * np.eye(3)
        p[3:6, 3:6] = np.diag(noise.drift**2)
        p[6:, 6:] = np.diag(noise.rates**2)
        self.steps, self.after = f, np.zeros((len(times), 8, 8))
        self.gains, self.roots = np.zeros((len(times), 8, 3)), np.zeros((len(times), 3, 3))
        inverses = np.zeros((len(times), 3, 3))
        for k in range(len(times)):
            if k:
                p = f[k - 1] @ p @ f[k - 1].T + q[k - 1]
            hp = p[:3] + p[3:6]
            inverses[k] = np.linalg.inv(hp[:, :3] + hp[:, 3:6] + np.diag(white[k]))
            self.gains[k] = hp.T @ inverses[k]
            p = p - self.gains[k] @ hp
            p = 0.5 * (p + p.T)
            self.after[k] = p
        self.roots = np.linalg.cholesky(inverses).transpose(0, 2, 1)

    def span(self, a: float, b: float) -> tuple[Array, Array]:
        """The step from one time to another, in parts of at most 0.1 s."""
        n = max(1, int(np.ceil((b - a) / 0.1)))
        t = np.linspace(a, b, n + 1)
        f, q = np.eye(8), np.zeros((8, 8))
        for g, r in zip(
            *transitions(increments(self.model(t)), np.diff(t), self.gate(0.5 * (t[1:] + t[:-1])), self.noise),
            strict=True,
        ):
            f, q = g @ f, g @ q @ g.T + r
        return f, q

    def run(self, y: Array) -> tuple[Array, Array]:
        """Whitened innovations (rows, 3, signals) and the mean state after each row."""
        x = np.zeros((8, y.shape[2]))
        nu, states = np.zeros_like(y), np.zeros((len(y), 8, y.shape[2]))
        for k in range(len(y)):
            if k:
                x = self.steps[k - 1] @ x
            nu[k] = y[k] - x[:3] - x[3:6]
            x = x + self.gains[k] @ nu[k]
            states[k] = x
        return self.roots @ nu, states

    def predict(self, row: int, y: Array, state: Array, t1: float, measured: bool) -> tuple[Array, Array]:
        """Mean and covariance of the motion from a row to t1, as measured there, or as it is, but for the drift."""
        t0 = float(self.times[row])
        f, q = self.span(t0, t1) if t1 > t0 else (np.eye(8), np.zeros((8, 8)))
        d = increments(self.model(np.array([t0, t1])))[0]
        d[2] = np.diff(self.model(np.array([t0, t1]))[:, 2])[0]
        x, p = f @ state, f @ self.after[row] @ f.T + q
        eps: Array = x[:3] + x[3:6] - adjoint(d) @ y
        h = np.hstack([np.eye(3), np.eye(3), np.zeros((3, 2))])
        c, s = np.cos(d[2]), np.sin(d[2])
        r = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        cov = h @ p @ h.T + np.diag((self.noise.white**2) if measured else self.noise.drift**2)
        return d + r @ eps, r @ cov @ r.T


def left_beside(gram: Array, i: int, group: list[int]) -> float:
    """From S' C^-1 S: what least squares by a group of signals leaves of the norm of signal i."""
    scale = np.sqrt(np.maximum(np.diag(gram)[group], 1e-12))
    inside = gram[np.ix_(group, group)] / np.outer(scale, scale) + 1e-9 * np.eye(len(group))
    across = gram[i, group] / scale
    return float(np.sqrt(max(gram[i, i] - across @ np.linalg.solve(inside, across), 0.0)))

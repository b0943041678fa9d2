# SPDX-License-Identifier: BSD-3-Clause
"""The base's noise, as a Kalman filter over increments; and whoever drives, looking where they go."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kurumaisu.bench.strangers.loch.laser import Walls, clearance
from kurumaisu.bench.strangers.loch.motion import DT, Array, Drive, Hidden, Law, truth


class Noise(NamedTuple):
    """Sizes of fluctuation and of the reference's errors."""

    sd_v: float
    sd_w: float
    tau: float
    position: float
    heading: float


class Filtered(NamedTuple):
    """Whitened columns, log likelihood of the first, and mean, covariance and signal at all rows."""

    white: Array
    log_likelihood: float
    states: dict[int, tuple[Array, Array, Array]]


def increments(poses: Array) -> Array:
    """Motion between neighbouring rows in the body frame of the first, a row each."""
    d = np.diff(poses, axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], (d[:, 2] + np.pi) % (2 * np.pi) - np.pi], 1)


def _ou(h: float, tau: float, sd: float) -> tuple[float, float, Array]:
    """Decay, integral of the start, and covariance of integral and end of a fluctuating rate over a time."""
    a = float(np.exp(-h / tau))
    cov = sd**2 * tau * (1 - a) ** 2
    area = sd**2 * tau**2 * max(2 * h / tau - 3 + 4 * a - a * a, 1e-12)
    return a, tau * (1 - a), np.array([[area, cov], [cov, sd**2 * (1 - a * a)]])


def _step(m: Array, h: float, noise: Noise, factor: float) -> tuple[Array, Array]:
    """Transition and noise of [x, y, heading, rate v, rate w] over one row, in the frame of its end."""
    c, s = np.cos(m[2]), np.sin(m[2])
    move = np.array([[c, s, c * -m[1] + s * m[0]], [-s, c, s * m[1] + c * m[0]], [0, 0, 1.0]])
    along = np.array([np.cos(m[2] / 2), -np.sin(m[2] / 2), 0.0])
    turn = np.array([0.0, m[0] / 2, 1.0])
    trans, q = np.zeros((5, 5)), np.zeros((5, 5))
    trans[:3, :3] = move
    for i, (way, sd) in enumerate(((along, noise.sd_v), (turn, noise.sd_w))):
        a, area, cov = _ou(h, noise.tau, sd * factor)
        trans[:3, 3 + i], trans[3 + i, 3 + i] = way * area, a
        into = np.zeros((5, 2))
        into[:3, 0], into[3 + i, 1] = way, 1.0
        q += into @ cov @ into.T
    return trans, q


def run(
    t: Array,
    model: Array,
    delta: Array,
    noise: Noise,
    used: NDArray[np.bool_] | None = None,
    factor: Array | None = None,
) -> Filtered:
    """Filters differences of increments (row, 3, column) about the model's increments."""
    n, cols = len(t), delta.shape[2]
    r = np.diag([noise.position**2, noise.position**2, noise.heading**2])
    p = np.diag([noise.position**2, noise.position**2, noise.heading**2, noise.sd_v**2, noise.sd_w**2])
    m, y = np.zeros((5, cols)), np.zeros((3, cols))
    white, ll, states = np.zeros((n - 1, 3, cols)), 0.0, {0: (m.copy(), p.copy(), y.copy())}
    for k in range(1, n):
        trans, q = _step(model[k - 1], float(t[k] - t[k - 1]), noise, 1.0 if factor is None else float(factor[k - 1]))
        c, s = np.cos(model[k - 1, 2]), np.sin(model[k - 1, 2])
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        y = trans[:3, :3] @ y + turn @ delta[k - 1]
        m, p = trans @ m, trans @ p @ trans.T + q
        if used is None or used[k]:
            chol = np.linalg.cholesky(p[:3, :3] + r)
            inv = np.linalg.inv(chol)
            e = inv @ (y - m[:3])
            white[k - 1] = e
            ll -= float(np.log(np.diag(chol)).sum() + 0.5 * (e[:, 0] ** 2).sum())
            gain = p[:, :3] @ inv.T
            m, p = m + gain @ e, p - gain @ gain.T
        states[k] = (m, p, y)
    return Filtered(white.reshape(-1, cols), ll, states)


def fluctuation(n: int, dt: float, tau: float, sd: float, rng: np.random.Generator) -> Array:
    """A rate's noise on a grid."""
    a = float(np.exp(-dt / tau))
    e = rng.normal(size=n) * sd * np.sqrt(1 - a * a)
    out, y = np.empty(n), float(rng.normal()) * sd
    for i, d in enumerate(e.tolist()):
        y = a * y + d
        out[i] = y
    return out


Move = tuple[float, float, float]


def _menu(rng: np.random.Generator) -> Move:
    """A manoeuvre: speed, yaw rate, duration."""
    kind, side, u = rng.random(), float(rng.choice([-1, 1])), rng.uniform
    if kind < 0.14:
        return 0.0, 0.0, u(0.8, 2.5)
    if kind < 0.36:
        return u(0.08, 0.8), 0.0, u(1.0, 4.0)
    if kind < 0.52:
        return -u(0.08, 0.45), side * float(rng.choice([0, 0, 0.25])), u(1.0, 3.0)
    if kind < 0.70:
        return 0.0, side * u(0.12, 1.0), u(0.8, 3.5)
    return u(0.1, 0.8), side * u(0.1, 0.8), u(1.0, 4.0)


def _dull(rng: np.random.Generator, dull: str, v: float, w: float) -> Move:
    """A manoeuvre of somebody who always does the same."""
    if rng.random() < 0.2:
        return 0.0, 0.0, 2.0
    if dull == "left":
        return (0.0, w, 3.0) if rng.random() < 0.5 else (v, 0.0, 4.0)
    return {"straight": (v, 0.0, 5.0), "circle": (v, w, 6.0), "spin": (0.0, w * float(rng.choice([-1, 1])), 3.0)}[dull]


def _arc(pose: Array, v: float, w: float, duration: float) -> Array:
    """Where a manoeuvre would lead."""
    t = np.linspace(0, duration + 0.4, 14)
    mid, way = pose[2] + w * t / 2, v * t * np.sinc(w * t / 2 / np.pi)
    return np.stack([pose[0] + way * np.cos(mid), pose[1] + way * np.sin(mid), pose[2] + w * t], axis=1)


def _choose(rng: np.random.Generator, walls: Walls, pose: Array) -> Move:
    """The first manoeuvre that comes to mind and is safe, else the safest."""
    best, found = (0.0, 0.0, 0.5), -np.inf
    for _ in range(30):
        m = _menu(rng)
        room = min(clearance(walls, _arc(pose, m[0] * 1.1, m[1] * k, m[2])) for k in (0.7, 1.0, 1.3))
        if room > 0.25:
            return m
        if room > found and (m[0] or m[1]):
            best, found = m, room
    return best


def _shape(style: str, have: float, want: float, n: int, dt: float, rng: np.random.Generator, fast: float) -> Array:
    """How a command gets from what it is to what it shall be."""
    if style == "steps":
        return np.full(n, want)
    if style == "planner":
        return np.asarray(have + np.sign(want - have) * np.minimum(fast * dt * np.arange(1, n + 1), abs(want - have)))
    out = want + (have - want) * np.exp(-dt / 0.18 * np.arange(1, n + 1))
    tremor = (want != 0) * np.repeat(rng.normal(0, 0.04, n // 5 + 1), 5)[:n]
    return np.asarray(np.where(np.abs(out) < 0.03, 0, out) * (1 + tremor))


def drive(
    name: str,
    start: float,
    length: float,
    style: str,
    law: Law | None,
    noise: Noise,
    walls: Walls,
    hidden: Sequence[Hidden],
    rng: np.random.Generator,
    columns: dict[str, Array],
    dull: tuple[str, float, float] | None = None,
) -> Drive:
    """Drives until the time is over, seeing after each manoeuvre where the chair really is."""
    n, every = int(length / DT), int(rng.choice([2, 4, 5, 10]))
    nv, nw = (fluctuation(n, DT, noise.tau, sd, rng) for sd in (noise.sd_v, noise.sd_w))
    pose = (rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6), rng.uniform(-3, 3))
    d = Drive(name, start, np.arange(n) * DT, np.zeros(n), np.zeros(n), nv, nw, pose, law, columns)
    i, v, w, here = int(rng.uniform(1.5, 3) / DT) // every * every, 0.0, 0.0, np.array(pose)
    while i < n - 250:
        m = _choose(rng, walls, here) if dull is None else _dull(rng, *dull)
        count = min(int(m[2] / DT) // every, (n - 200 - i) // every)
        end = i + count * every
        d.cv[i:end] = np.round(np.repeat(_shape(style, v, m[0], count, every * DT, rng, 0.7), every), 4)
        d.cw[i:end] = np.round(np.repeat(_shape(style, w, m[1], count, every * DT, rng, 1.5), every), 4)
        v, w, i = float(d.cv[end - 1]), float(d.cw[end - 1]), end
        if dull is None:
            here = truth(d.cut(end), hidden).at(d.t[end - 1 : end])[0]
    d.rows = [(k * DT, float(d.cv[k]), float(d.cw[k])) for k in range(0, n, every)]
    return d


def safe(d: Drive, walls: Walls, hidden: Sequence[Hidden]) -> bool:
    """Whether the chair touched nothing."""
    return clearance(walls, truth(d, hidden).at(d.t[::10])) > 0.02

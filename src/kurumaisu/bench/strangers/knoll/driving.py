# SPDX-License-Identifier: BSD-3-Clause
"""How commands become motion, and a driver who gives them and sees where the robot is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.knoll.signals import rates, volts, wandering
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Rates, Rng, Scene
from kurumaisu.types import FloatArray, IntArray

_CHOICES = 40  # pieces of a drive that a driver chooses from


def open_rates(sc: Scene, causes: Sequence[Cause], x: Drive) -> Rates:
    """Return the rates v, w and sideways u on the grid that the commands come to."""
    v, w, u = x.vc, x.wc, np.zeros(x.vc.size)
    ordered = sorted(causes, key=lambda c: c.order)
    if sc.voltage:
        f, s = volts(sc.law, v, w)
        for c in ordered:
            f, s = c.volt(x, f, s) if c.volt else (f, s)
        v, w = rates(next((c.law for c in causes if c.law), sc.law), f, s, x.wc)
    for c in ordered:
        v, w, u = c.rate(x, v, w, u) if c.rate else (v, w, u)
    return v, w, u


def growth(causes: Sequence[Cause], v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the factors of the process noise; none at rest."""
    a = b = ((np.abs(v) > 1e-3) | (np.abs(w) > 1e-3)).astype(float)
    for c in causes:
        if c.growth:
            p, q = c.growth(v, w)
            a, b = a * p, b * q
    return a, b


def _sum(a: FloatArray) -> FloatArray:
    return np.concatenate([[0], np.cumsum(a)])


def _drive_on(sc: Scene, causes: Sequence[Cause], x: Drive, k0: int, k1: int) -> None:
    """Continue the true path from node k0 to k1."""
    v, w, x.u = open_rates(sc, causes, x)
    a, b = growth(causes, v, w)
    x.v, x.w = v + a * x.nv, w + b * x.nw
    places = [c.place for c in causes if c.place]
    px, py, th = x.path[:, k0]
    if not places:
        v, w, u = x.v[k0:k1], x.w[k0:k1], x.u[k0:k1]
        t = th + _sum(w * DT)
        m = (t[1:] + t[:-1]) / 2
        steps = DT * (v * np.cos(m) - u * np.sin(m)), DT * (v * np.sin(m) + u * np.cos(m))
        x.path[:, k0 : k1 + 1] = px + _sum(steps[0]), py + _sum(steps[1]), t
        return
    for k in range(k0, k1):
        ahead, turn, u = x.v[k], x.w[k], x.u[k]
        for place in places:
            ahead, turn = place(px, py, th, ahead, turn)
        m = th + turn * DT / 2
        px, py = px + DT * (ahead * np.cos(m) - u * np.sin(m)), py + DT * (ahead * np.sin(m) + u * np.cos(m))
        th = th + turn * DT
        x.path[:, k + 1] = px, py, th


def _wishes(rng: Rng, sc: Scene, mode: str, kind: str, r: int) -> tuple[FloatArray, FloatArray]:
    """Draw speeds and yaw rates of r rows that a driver might give."""
    vm, wm, dt, c = sc.vmax, sc.wmax, sc.command_step, _CHOICES
    v = vm * rng.choice([0.6] if mode == "one_speed" else [0.25, 0.4, 0.6, 0.8, 1.0], c)[:, None] * np.ones(r)
    turns = rng.choice([0, 0.15, 0.3, 0.5, 0.8], c, p=[0.25, 0.25, 0.2, 0.2, 0.1])
    w = wm * turns[:, None] * rng.choice([-1, 1], c)[:, None]
    weave = (rng.random(c) < 0.25)[:, None]
    w = w * np.where(weave, np.sin(np.arange(r) * dt * DT * rng.uniform(1, 3)), 1.0)
    if kind == "turn":
        v, w = v * 0, wm * rng.uniform(0.3, 0.9, c)[:, None] * rng.choice([-1, 1], c)[:, None] * np.ones(r)
    elif kind == "back":
        v, w = -0.6 * v, 0.5 * w
    elif kind == "stop":
        v, w = v * 0, w * 0
    if mode == "left":
        w = np.abs(w)
    elif mode == "one_turn":
        w = 0.4 * wm * np.sign(np.round(w / wm, 2))
    if sc.person and kind in ("go", "back") and not mode:
        w = w + wm * 0.05 * wandering(rng, r, 1, 1.0, dt * DT)
        v = v * (1 + 0.05 * wandering(rng, r, 1, 1.0, dt * DT))
    return np.clip(v, -0.6 * vm, vm), np.clip(w, -wm, wm)


def _slewed(x: FloatArray, start: float, most: float) -> FloatArray:
    """Return rows that change by no more than most."""
    a = np.full(len(x), start)
    for j in range(x.shape[1]):
        a = a + np.clip(x[:, j] - a, -most, most)
        x[:, j] = a
    return np.round(x, 4)


def _free(sc: Scene, x: Drive, k: int, v: FloatArray, w: FloatArray) -> IntArray:
    """Return which of the wishes keep off the walls, from node k on."""
    dt = sc.command_step
    th = x.path[2, k] + np.cumsum(w, 1) * dt * DT
    ways = [np.cumsum(v * f(th), 1) * dt * DT for f in (np.cos, np.sin)]
    q = np.stack([x.path[0, k] + ways[0], x.path[1, k] + ways[1]], 2)
    look = 0.35 * v[:, -1]
    end = q[:, -1] + look[:, None] * np.stack([np.cos(th[:, -1]), np.sin(th[:, -1])], 1)
    pts = np.concatenate([q[:, ::3], end[:, None]], 1)
    clear = sc.room.clearance(pts.reshape(-1, 2)).reshape(len(v), -1)
    here = sc.room.clearance(x.path[:2, k][None])[0]
    return np.flatnonzero(clear.min(1) > min(sc.margin, here - 0.02))


def _start(rng: Rng, sc: Scene, seconds: float, day: float) -> Drive:
    n = int(seconds / DT)
    t = np.arange(n) * DT
    cov = {k: f(day + t) for k, f in sc.covariates.items()}
    nv, nw = (wandering(rng, n, sd, sc.noise_time) for sd in (sc.sd_v, sc.sd_w))
    x = Drive(n, day, t, np.zeros(n), np.zeros(n), cov, nv, nw, np.zeros((3, n + 1)))
    for _ in range(500):
        p = rng.uniform([0.5, 0.5], [sc.room.width - 0.5, sc.room.depth - 0.5])
        if sc.room.clearance(p[None])[0] > sc.margin + 0.3:
            break
    x.path[:, 0] = *p, rng.uniform(-np.pi, np.pi)
    return x


def _kind(rng: Rng, mode: str) -> str:
    kind = str(rng.choice(["go", "turn", "stop", "back"], p=[0.62, 0.16, 0.12, 0.1]))
    return "go" if mode == "one_speed" and kind in ("back", "turn") else kind


def _piece(rng: Rng, sc: Scene, mode: str, x: Drive, k: int, most: tuple[float, float]) -> FloatArray:
    """Draw the rows of v and w that go on from node k."""
    step, kind = sc.command_step, _kind(rng, mode)
    r = int(rng.uniform(*((2, 7) if kind == "go" else (1, 3.5))) / (step * DT))
    r = max(min(r, (x.n - 200 - k) // step), 3)
    v, w = _wishes(rng, sc, mode, kind, r)
    v, w = _slewed(v, x.rows[-1][1], most[0]), _slewed(w, x.rows[-1][2], most[1])
    free = _free(sc, x, k, v, w)
    if free.size:
        return np.stack([v[free[0]], w[free[0]]], 1)
    if mode == "one_speed" and sc.room.clearance(x.path[:2, k][None])[0] > 0:
        turn = 0.6 * sc.wmax * rng.choice([-1, 1])
    else:
        r, turn = min(r, 12), 0.5 * sc.wmax * (1 if mode == "left" else rng.choice([-1, 1]))
    return np.stack([np.zeros(r), np.full(r, turn)], 1)


def _give(x: Drive, k: int, m: int, v: float, w: float) -> int:
    """Give a row at node k for m nodes, and return the next one."""
    x.rows.append((k, v, w))
    x.vc[k : k + m], x.wc[k : k + m] = v, w
    return k + m


def draw_drive(rng: Rng, sc: Scene, causes: Sequence[Cause], seconds: float, mode: str, day: float) -> Drive:
    """Draw a drive through the room; mode: how it is limited."""
    x = _start(rng, sc, seconds, day)
    n, step = x.n, sc.command_step
    k = int(rng.uniform(1.5, 3) / DT)
    _drive_on(sc, causes, x, 0, k)
    acc = (1e9, 1e9) if mode or sc.sharp else (1.2 * max(sc.vmax, 0.4), 3.0 * sc.wmax)
    most = acc[0] * step * DT, acc[1] * step * DT
    while k < n - 250:
        k0 = k
        for v, w in _piece(rng, sc, mode, x, k, most).tolist():
            k = _give(x, k, int(step + rng.integers(-1, 2) * (step > 3)), v, w)
            if k > n - 200:
                break
        _drive_on(sc, causes, x, k0, min(k, n))
    v, w = x.rows[-1][1:]
    while abs(v) + abs(w) > 1e-9:
        v -= float(np.clip(v, -most[0], most[0]))
        w -= float(np.clip(w, -most[1], most[1]))
        k = _give(x, k, step, round(v, 4), round(w, 4))
    _drive_on(sc, causes, x, 0, n)
    return x

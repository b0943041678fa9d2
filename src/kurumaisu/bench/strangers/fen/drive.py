# SPDX-License-Identifier: BSD-3-Clause
"""Drives: what is asked for, when it is measured, and what the chair then does."""

import numpy as np

from .base import State, rates, shift
from .model import Cause, F, Noise, Run, arr, flutter, path, turn

STYLES = ("steps", "ramps", "joystick", "stop_and_go", "goals")
Wish = tuple[float, float, float]
MONOTONE = ("one_speed", "one_turn", "left_only", "forward_only", "one_speed_one_turn", "straight")


def _next(style: str, top: tuple[float, float], rng: np.random.Generator) -> Wish:
    """One wish: v, w, for how long."""
    v = float(rng.choice([1, 1, 1, -1])) * rng.uniform(0.12, 1.0) * top[0]
    w = float(rng.choice([1, -1])) * rng.uniform(0.15, 1.0) * top[1]
    long = rng.uniform(1.0, 4.0)
    a, b = top[0] * 0.6, top[1] * 0.6
    side = float(rng.choice([1, -1]))
    fixed = {
        "one_speed": (a, side * rng.uniform(0.3, 1.0) * top[1]),
        "one_turn": (abs(v), side * b),
        "left_only": (abs(v), b),
        "forward_only": (abs(v), w),
        "one_speed_one_turn": (a, side * b),
        "straight": (a, 0.0),
    }
    if style in fixed:
        q = fixed[style]
        return q[0], q[1] if rng.random() < 0.7 else 0.0, long
    kind = rng.random()
    if kind < 0.12 or (style == "stop_and_go" and kind < 0.35):
        return 0.0, 0.0, rng.uniform(0.6, 2.0)
    if kind < 0.5:
        return v, 0.0, long
    if kind < 0.65:
        return 0.0, w, long
    return v, w, long


def _wishes(style: str, long: float, top: tuple[float, float], rng: np.random.Generator) -> list[Wish]:
    """Wishes that keep a chair that obeys within an arena."""
    out, t, x, y, th = [(0.0, 0.0, rng.uniform(0.5, 1.2))], 0.0, 0.0, 0.0, 0.0
    goal, room = rng.uniform(-2, 2, 2), rng.uniform(1.4, 2.6)
    while t < long:
        best = (1e9, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        for _ in range(1 if style in MONOTONE else 10):
            v, w, d = _next(style, top, rng)
            if style == "goals" and rng.random() < 0.8:
                bend = (np.arctan2(goal[1] - y, goal[0] - x) - th + np.pi) % (2 * np.pi) - np.pi
                v, d = rng.uniform(0.3, 1) * top[0] * (1.0 if abs(bend) < 1 else 0.3), rng.uniform(0.4, 1.0)
                w = float(np.clip(bend * 1.2, -top[1], top[1]))
            m, n = th + w * d / 2, d * np.sinc(w * d / 2 / np.pi)
            q = (x + v * n * np.cos(m), y + v * n * np.sin(m), th + w * d)
            far = float(np.hypot(q[0], q[1]))
            if far < best[0]:
                best = (far, v, w, d, *q)
            if far < room:
                break
        _, v, w, d, x, y, th = best
        if np.hypot(goal[0] - x, goal[1] - y) < 0.4:
            goal = rng.uniform(-2, 2, 2)
        out.append((v, w, d))
        t += d
    return out


def commands(style: str, long: float, rate: float, rng: np.random.Generator) -> tuple[F, F, F]:
    """Rates asked for, at the stamps of the commands."""
    top = (rng.uniform(0.45, 1.0), rng.uniform(0.5, 1.0))
    wish = _wishes(style, long, top, rng)
    t = np.cumsum(np.maximum(1 + 0.1 * rng.standard_normal(int(long * rate)), 0.2)) / rate
    t = np.round(np.concatenate([[0.0], t[t < long]]), 6)
    i = np.clip(np.searchsorted(np.cumsum([k[2] for k in wish]), t), 0, len(wish) - 1)
    v, w = np.array([k[0] for k in wish])[i], np.array([k[1] for k in wish])[i]
    if style == "ramps":
        v, w = _ramp(v, rng.uniform(0.3, 1.0) / rate), _ramp(w, rng.uniform(0.5, 1.5) / rate)
    if style == "joystick":
        f = np.exp(-1 / (rate * rng.uniform(0.15, 0.5)))
        for z, size in ((v, 0.03), (w, 0.04)):
            hand = flutter(t, 0.3, rng) * size * (np.abs(z) > 0)
            last = 0.0
            for k in range(len(z)):
                last = f * last + (1 - f) * z[k]
                z[k] = last + hand[k]
    v, w = np.where(np.abs(v) < 0.02, 0.0, v), np.where(np.abs(w) < 0.04, 0.0, w)
    keep = np.ones(len(t), bool)
    if rng.random() < 0.5:  # lost on the way: the one before holds, on the chair as well
        keep[rng.choice(np.arange(1, len(t)), len(t) // 200, replace=False)] = False
    if style in ("steps", "stop_and_go", *MONOTONE) and rng.random() < 0.3:  # said only when it changes
        keep &= np.concatenate([[True], (np.diff(v) != 0) | (np.diff(w) != 0)])
    return t[keep], np.round(v, 4)[keep], np.round(w, 4)[keep]


def _ramp(u: F, step: float) -> F:
    out, last = [], 0.0
    for want in u.tolist():
        last += min(max(want - last, -step), step)
        out.append(last)
    return np.array(out)


def stamps(long: float, rate: float, rng: np.random.Generator, first: float) -> F:
    """Times of measurements, with jitter."""
    t = first + np.arange(0, long - first - 0.2, 1 / rate)
    t = t + rng.uniform(0, 0.15) / rate * np.clip(rng.standard_normal(len(t)), -2, 2)
    return arr(np.unique(np.round(np.maximum(t, 0.01), 6)))


def columns(long: float, names: list[str], rng: np.random.Generator) -> tuple[F, dict[str, F]]:
    """Columns of covariate.csv."""
    t = arr(np.round(np.arange(0.0, long + 2, float(rng.choice([0.5, 1.0]))), 3))
    out: dict[str, F] = {}
    for n in names:
        if n == "temperature":
            out[n] = arr(np.round(20 + 6 * np.sin(2 * np.pi * (t / rng.uniform(60, 200) + rng.random())), 2))
        elif n == "battery":
            out[n] = arr(np.round(25.2 - 0.01 * t + 0.1 * rng.standard_normal(len(t)), 2))
        else:
            waves = np.sin(np.outer(1 / rng.uniform(3, 15, 3), t) + rng.uniform(0, 6, (3, 1)))
            k = np.array([1.0, 0.5, 0.3])[:, None] * waves
            out[n] = np.round(k.sum(0) * 2.5 + 10, 3)
    return arr(t), out


def simulate(run: Run, causes: list[Cause], noise: Noise) -> State:
    """Drive: the path goes into the run."""
    rng = np.random.default_rng(run.seed)
    late = [c.p["delay"] for c in causes if c.id == "base.delay" and c.form == 0]
    run.prepare(late)
    base = np.arange(0.0, run.t[-1] + 2, 0.004)
    run.nv = np.interp(run.t, base, flutter(base, noise.tau, rng)) * noise.v
    run.nw = np.interp(run.t, base, flutter(base, noise.tau, rng)) * noise.w
    placed = any(c.id == "base.slope" or c.id.startswith("unknown.") for c in causes)
    for _ in range(10 if placed else 1):
        s = rates(run, causes)
        v = s.v + s.grow_v * (run.nv[1:] + run.nv[:-1]) / 2
        w = s.w + s.grow_w * (run.nw[1:] + run.nw[:-1]) / 2
        old = run.x
        run.x, run.y, run.th = path(run.t, v, w, s.u, run.pose0)
        if np.abs(run.x - old).max() < 1e-7:
            break
    return s


def increments(run: Run, causes: list[Cause], state: State | None = None) -> F:
    """Motion from each row of the reference to the next, in its frame, without noise: n x 3."""
    s = rates(run, causes) if state is None else state
    x, y, th = path(run.t, s.v, s.w, s.u, run.pose0)
    i = np.searchsorted(run.t, run.pt)
    a, b = turn(-th[i[:-1]], np.diff(x[i]), np.diff(y[i]))
    phi = np.diff(th[i])
    if any(c.id.startswith(("base.marker", "unknown.position", "unknown.heading")) for c in causes):
        sx, sy, st = shift(run, causes, run.pt)
        real = run.th[i[:-1]]
        dx, dy = turn(-real, np.diff(sx), np.diff(sy))
        a, b = turn(-st[:-1], a + dx, b + dy)
        phi = phi + np.diff(st)
    return np.stack([a, b, phi], axis=1)


def measure(run: Run, causes: list[Cause], noise: Noise) -> F:
    """Rows of the reference, with its noise: n x 3."""
    rng = np.random.default_rng(run.seed + 1)
    q = np.stack(run.at(run.pt), axis=1) + np.stack(shift(run, causes, run.pt), axis=1)
    size = np.array([noise.position, noise.position, noise.heading])
    return arr(np.round(q + size * rng.standard_normal(q.shape), 6))

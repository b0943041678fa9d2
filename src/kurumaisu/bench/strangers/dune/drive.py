# SPDX-License-Identifier: BSD-3-Clause
"""Drivers: random splines, a joystick with expo, step sequences; each looks where the chair is and goes on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from .plant import DT, Arr, Cause, Run, simulate
from .world import Room


@dataclass
class Driver:
    """One person's habits."""

    v_max: float
    w_max: float
    reverse: float  # share of pieces driven backwards
    expo: float
    styles: Arr  # odds of spline, joystick, steps
    tick: float  # seconds between commands
    mode: str = "free"  # what the driver is confined to: free, one_speed, left, back, arc, one_turn
    v_one: float = 0.0
    w_one: float = 0.0


def draw(rng: np.random.Generator, mode: str) -> Driver:
    """Somebody else."""
    v_one, w_one = rng.uniform(0.3, 0.6), float(rng.choice([-1, 1])) * rng.uniform(0.4, 0.7)
    fast, turn, back, expo = (
        rng.uniform(0.5, 0.8),
        rng.uniform(0.6, 1.0),
        rng.uniform(0.15, 0.35),
        rng.uniform(0.2, 0.8),
    )
    return Driver(fast, turn, back, expo, rng.dirichlet([2, 2, 2]), float(rng.choice([0.05, 0.1])), mode, v_one, w_one)


def piece(rng: np.random.Generator, d: Driver) -> tuple[Arr, Arr]:
    """Some seconds of commands, a value a tick."""
    n = int(rng.uniform(2.5, 8.0) / d.tick)
    t = np.arange(n) * d.tick
    style = int(rng.choice(3, p=d.styles))
    back = -1.0 if rng.random() < d.reverse else 1.0
    if style == 0:
        knots = np.linspace(0, t[-1], max(4, int(t[-1] / rng.uniform(0.8, 1.6))))
        v = CubicSpline(knots, back * rng.uniform(0.1, 1.0, len(knots)) * d.v_max)(t)
        w = CubicSpline(knots, rng.uniform(-1, 1, len(knots)) * d.w_max)(t)
    elif style == 1:
        stick = []
        for low in (0.2, -1.0):
            hold = np.repeat(rng.uniform(low, 1, 12), rng.integers(int(0.5 / d.tick), int(1.6 / d.tick), 12))[:n]
            hold = np.pad(hold, (0, n - len(hold)), "edge")
            hold = np.convolve(np.pad(hold, (4, 4), "edge"), np.ones(9) / 9, "valid")
            stick.append((1 - d.expo) * hold + d.expo * hold**3)
        v, w = back * stick[0] * d.v_max, stick[1] * d.w_max
    else:
        v, w = steps(rng, d, t, back)
    dead = 0.02
    v, w = np.where(np.abs(v) < dead, 0.0, v), np.where(np.abs(w) < dead, 0.0, w)
    return confine(d, np.clip(v, -0.6, 0.8), np.clip(w, -1, 1), rng)


def steps(rng: np.random.Generator, d: Driver, t: Arr, back: float) -> tuple[Arr, Arr]:
    """A straight line with a stop, a turn on the spot, an eight, a bend."""
    kind = int(rng.integers(4))
    v = np.full(len(t), back * d.v_max * rng.uniform(0.3, 1.0))
    w = np.full(len(t), float(rng.choice([-1, 1])) * d.w_max * rng.uniform(0.25, 1.0))
    stop = rng.uniform(0.5, 0.85) * t[-1]
    if kind == 0:
        return np.where(t < stop, v, 0.0), np.zeros(len(t))
    if kind == 1:
        return np.zeros(len(t)), np.where(t < stop, w, 0.0)
    if kind == 2:
        return v, w * np.sign(np.sin(2 * np.pi * t / t[-1] + 1e-3))
    return v, w


def confine(d: Driver, v: Arr, w: Arr, rng: np.random.Generator) -> tuple[Arr, Arr]:
    """What remains of a piece in this mode."""
    if d.mode == "one_speed":
        v = d.v_one * (np.abs(v) > 0.12)
    elif d.mode == "left":
        w = np.abs(w)
    elif d.mode == "back":
        v = -np.abs(v)
    elif d.mode == "one_turn":
        w = abs(d.w_one) * np.sign(w) * (np.abs(w) > 0.1)
    elif d.mode == "arc":
        go = np.arange(len(v)) * d.tick > rng.uniform(0.3, 1.5)
        v, w = d.v_one * go, d.w_one * go
    return v, w


def away(rng: np.random.Generator, d: Driver, room: Room, pose: Arr) -> tuple[Arr, Arr]:
    """Turn on the spot towards the middle (or with the back to it)."""
    middle = room.boxes[:4, :2].mean(axis=0) + rng.uniform(-0.7, 0.7, 2) - pose[:2]
    want = np.arctan2(middle[1], middle[0]) + (np.pi if d.mode == "back" else 0.0)
    turn = (want - pose[2] + np.pi) % (2 * np.pi) - np.pi
    if d.mode == "left":
        turn %= 2 * np.pi
    rate = abs(d.w_one) if d.mode == "one_turn" else rng.uniform(0.5, 0.95) * d.w_max
    n = max(int(abs(turn) / rate / d.tick), 3)
    return np.zeros(n), np.full(n, np.sign(turn) * rate)


def room_left(room: Room, pose: Arr, v: Arr, w: Arr, tick: float) -> float:
    """Smallest clearance of base_link on a piece, by the commands."""
    th = pose[2] + np.cumsum(w) * tick
    p = pose[:2] + np.cumsum(np.stack([v * np.cos(th), v * np.sin(th)], axis=1), axis=0) * tick
    return float(room.clearance(p).min())


def activity(run: Run, at_rest: float) -> Arr:
    """How much of the fluctuations acts on the grid: less at rest, none against a wall."""
    return np.asarray(np.where((run.v != 0) | (run.w != 0), 1.0, at_rest) * run.free)


def grid(v: Arr, stamps: Arr) -> Arr:
    """Commands held from their stamps on, on the fine grid."""
    edges = np.round(stamps / DT).astype(int)
    return np.repeat(v, np.diff(edges))


def crash(room: Room, pose: Arr, rng: np.random.Generator, d: Driver) -> tuple[Arr, Arr, float] | None:
    """Straight on into what stands ahead, push, and back off; with the way to go until contact."""
    ahead = np.array([[np.cos(pose[2]), np.sin(pose[2])]])
    r = float(room.cast(pose[None, :2], ahead)[0][0]) - 0.70
    if not 0.25 < r < 3.0:
        return None
    speed = rng.uniform(0.25, 0.45)
    push, off = int((r / speed + rng.uniform(1.5, 3.0)) / d.tick), int(3.0 / d.tick)
    return np.concatenate([np.full(push, speed), np.full(off, -0.3)]), np.zeros(push + off), r


def make_run(
    rng: np.random.Generator, room: Room, d: Driver, causes: list[Cause], noise: Arr, at_rest: float, seconds: float,
    start: float, columns: dict[str, Arr], crashes: bool,
) -> tuple[Run, Arr]:  # fmt: skip
    """A run with the causes and the noise acting on it, and the stamps of its commands."""
    n_ticks = int(seconds / d.tick)
    spread = rng.uniform(0.0, 0.1) * d.tick
    stamps = np.round((np.arange(n_ticks + 1) * d.tick + rng.uniform(-spread, spread, n_ticks + 1)) / DT) * DT
    stamps[0] = 0.0
    middle = room.boxes[:4, :2].mean(axis=0)
    pose0 = np.array([*(middle + rng.uniform(-0.6, 0.6, 2)), rng.uniform(-np.pi, np.pi)])
    if d.mode == "arc":
        pose0[:2] = middle - d.v_one / d.w_one * np.array([-np.sin(pose0[2]), np.cos(pose0[2])])
    rest = int(rng.uniform(0.6, 2.0) / d.tick)
    v, w = np.zeros(rest), np.zeros(rest)
    stuck = (0.0, 0.0)
    crash_at = rng.uniform(0.3, 0.7) * n_ticks if crashes else np.inf

    def build(k: int) -> Run:
        k = min(k, n_ticks)
        vg, wg = grid(v[:k], stamps[: k + 1]), grid(w[:k], stamps[: k + 1])
        free = np.ones(len(vg))
        free[int(stuck[0] / DT) : int(stuck[1] / DT)] = 0.0
        return Run(vg, wg, pose0, start, free, {c: x[: len(vg)] for c, x in columns.items()})

    def follow(k: int) -> Arr:
        run = build(k)
        return simulate(run, causes, noise[: len(run.v)] * activity(run, at_rest)[:, None], None, 1).pose

    while len(v) < n_ticks:
        pose = follow(len(v))[-1]
        more = None
        hit = crash(room, pose, rng, d) if len(v) > crash_at else None
        if hit is not None:
            first = len(v)
            v, w, crash_at = np.concatenate([v, hit[0]]), np.concatenate([w, hit[1]]), np.inf
            gone = np.hypot(*(follow(len(v))[:, :2] - pose[:2]).T)
            touch = np.flatnonzero((gone >= hit[2]) & (np.arange(len(gone)) * DT > stamps[first]))
            end = min(first + int((hit[0] > 0).sum()), n_ticks)
            stuck = (touch[0] * DT, float(stamps[end])) if len(touch) and touch[0] * DT < stamps[end] else stuck
            continue
        for _ in range(14):
            more = piece(rng, d)
            if room_left(room, pose, *more, d.tick) > 0.8:
                break
            more = None
        more = (
            (confine(d, *piece(rng, d), rng) if d.mode == "arc" else away(rng, d, room, pose)) if more is None else more
        )
        pause = int(rng.uniform(0.5, 2.5) / d.tick) if rng.random() < 0.25 else 0
        v, w = (np.concatenate([a, b, np.zeros(pause)]) for a, b in zip((v, w), more, strict=True))
    return build(n_ticks), stamps[:n_ticks]

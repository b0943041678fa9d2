# SPDX-License-Identifier: BSD-3-Clause
"""How somebody drives the robot through the room: pieces of a way, chosen where there is space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.asking import asked
from kurumaisu.bench.strangers.scree.basics import STEP, Array, Path, Rates, Rng, Rows, integrate, wandering
from kurumaisu.bench.strangers.scree.plant import Causes, Drive, rates_of
from kurumaisu.bench.strangers.scree.rates import follow
from kurumaisu.bench.strangers.scree.robots import Robot
from kurumaisu.bench.strangers.scree.rooms import Room


@dataclass(frozen=True)
class Manner:
    """How it is driven: the period of the commands, ramps, a trembling hand, what is left out."""

    period: float
    ramp: float
    tremble: float
    one_speed: bool = False
    one_side: bool = False


@dataclass(frozen=True)
class Piece:
    """A stretch with one speed and one yaw rate."""

    v: float
    w: float
    lasts: float


def draw_manner(rng: Rng) -> Manner:
    """A person at a stick, or a planner."""
    if rng.random() < 0.4:
        return Manner(float(rng.choice([0.05, 0.1])), float(rng.uniform(0.4, 0.9)), float(rng.uniform(0.02, 0.05)))
    return Manner(float(rng.choice([0.1, 0.1, 0.2])), float(rng.uniform(0.0, 0.4)), 0.0)


def _wish(rng: Rng, robot: Robot, manner: Manner) -> Piece:
    kind = rng.choice(5, p=[0.33, 0.32, 0.15, 0.12, 0.08])
    level = 0.6 if manner.one_speed else float(rng.choice([0.25, 0.4, 0.6, 0.8, 1.0]))
    turn = float(rng.choice([0.2, 0.35, 0.5, 0.75, 1.0])) * (1.0 if manner.one_side or rng.random() < 0.5 else -1.0)
    lasts = float(rng.uniform(1.5, 4.5))
    v, w = level * robot.v_top, turn * robot.w_top
    if kind == 0:
        return Piece(v, 0.0, lasts)
    if kind == 1:
        return Piece(v, 0.7 * w, lasts)
    if kind == 2:
        return Piece(0.0, w, float(rng.uniform(0.8, 2.5)))
    if kind == 3 and not manner.one_speed:
        return Piece(-0.6 * v, 0.4 * w * float(rng.integers(0, 2)), 0.6 * lasts)
    return Piece(0.0, 0.0, float(rng.uniform(1.0, 3.0)))


def _real(p: Piece, robot: Robot, causes: Causes) -> Piece:
    """What the driver has learnt that the robot makes of a command."""
    law = tuple(c for c in causes if c.id == "base.steering_law")
    one = np.ones(1)
    a = asked(Rows(-one, one * p.v, one * p.w), law, robot, 1)
    return Piece(float(a.v[0]), float(a.w[0]), p.lasts)


def _choose(room: Room, drive: Drive, causes: Causes, manner: Manner, rng: Rng) -> Piece:
    robot = drive.robot
    pose = np.array([drive.path.x[-1], drive.path.y[-1], drive.path.th[-1]])
    for _ in range(30):
        p = _wish(rng, robot, manner)
        n = max(int(p.lasts / 0.2), 2)
        real = _real(p, robot, causes)
        way = integrate(Rates(np.full(n, real.v * 10), np.full(n, real.w * 10), np.zeros(n)), pose)
        margin = 0.42 + 0.4 * robot.v_top * (p.v != 0)
        if p.v == 0 or float(room.clearance(np.stack([way.x, way.y], axis=-1)).min()) > margin:
            return p
    side = 1.0 if manner.one_side or rng.random() < 0.5 else -1.0
    return Piece(0.0, 0.7 * side * robot.w_top, float(rng.uniform(1.0, 3.0)))


def _append(rows: Rows, p: Piece, manner: Manner, end: float, rng: Rng) -> Rows:
    n = max(int(p.lasts / manner.period), 1)
    t = end + manner.period * np.arange(n)
    part = np.minimum((t - end + manner.period) / max(manner.ramp, 1e-6), 1.0)
    part = 0.5 - 0.5 * np.cos(np.pi * part)
    last_v, last_w = (rows.v[-1], rows.w[-1]) if len(rows.t) else (0.0, 0.0)
    v, w = last_v + (p.v - last_v) * part, last_w + (p.w - last_w) * part
    if manner.tremble:
        hand = 1 + manner.tremble * rng.standard_normal((2, n))
        v, w = v * hand[0], w * hand[1]
    t = t + rng.uniform(0, 0.12 * manner.period, n)
    late = rng.random(n) < 0.01
    t = t + np.where(late, 0.6 * manner.period, 0.0)
    keep = rng.random(n) > 0.004
    keep[0] = True
    u = [np.concatenate(x)[:] for x in ((rows.t, t[keep]), (rows.v, v[keep]), (rows.w, w[keep]))]
    return Rows(np.round(u[0], 6), np.round(u[1], 5), np.round(u[2], 5))


def _noise(robot: Robot, n: int, rng: Rng) -> Array:
    t = STEP * np.arange(n)
    return np.stack([wandering(rng, t, sd, robot.tau) for sd in (robot.noise_v, robot.noise_w)])


def activity(drive: Drive, n: int) -> Array:
    """How much of the noise of the rates is there: all of it while something drives, none at rest."""
    idle = drive.rows.v**2 + drive.rows.w**2 < 1e-6
    k = np.searchsorted(drive.rows.t, STEP * (np.arange(n) + 0.5), side="right") - 1
    return follow(np.where((k >= 0) & ~idle[np.maximum(k, 0)], 1.0, 0.0), 0.1)


def _move(drive: Drive, causes: Causes, noise: Array, begun: int, end: int) -> Drive:
    """Carry the path from cell `begun` to cell `end`; what depends on the place is made consistent."""
    path = drive.path
    start = np.array([path.x[begun], path.y[begun], path.th[begun]])
    guess = [np.concatenate([u[: begun + 1], np.full(end - begun, u[begun])]) for u in (path.x, path.y, path.th)]
    now = replace(drive, path=Path(*guess))
    busy = activity(drive, end)[begun:]
    for _ in range(3 if causes else 1):
        rates, _s = rates_of(now, causes, end)
        v, w = rates.v[begun:] + busy * noise[0, begun:end], rates.w[begun:] + busy * noise[1, begun:end]
        on = integrate(Rates(v, w, rates.side[begun:]), start)
        joined = [np.concatenate([u[:begun], x]) for u, x in ((path.x, on.x), (path.y, on.y), (path.th, on.th))]
        now = replace(now, path=Path(*joined))
    return now


def drive_through(room: Room, empty: Drive, causes: Causes, manner: Manner, rng: Rng) -> Drive:
    """A drive of the length that the empty one has, from a free place."""
    n = empty.n
    noise = _noise(empty.robot, n, rng)
    places = rng.uniform(0.2, 0.8, (60, 2)) * np.array([room.length, room.width])
    at = places[int(np.argmax(room.clearance(places) + rng.uniform(0, 0.5, 60)))]
    one = np.ones(1)
    path = Path(one * at[0], one * at[1], one * rng.uniform(-np.pi, np.pi))
    none = np.zeros(0)
    rows = _append(Rows(none, none, none), Piece(0.0, 0.0, rng.uniform(1.5, 4.0)), manner, 0.03, rng)
    drive = replace(empty, rows=rows, path=path)
    begun, clock = 0, float(rows.t[-1]) + manner.period
    while begun < n:
        end = min(int(clock / STEP), n)
        drive = _move(drive, causes, noise, begun, end)
        begun = end
        p = _choose(room, drive, causes, manner, rng)
        drive = replace(drive, rows=_append(drive.rows, p, manner, clock, rng))
        clock = max(clock + max(int(p.lasts / manner.period), 1) * manner.period, float(drive.rows.t[-1]) + 0.02)
    rows = drive.rows
    keep = rows.t < n * STEP
    return replace(drive, rows=Rows(rows.t[keep], rows.v[keep], rows.w[keep]))

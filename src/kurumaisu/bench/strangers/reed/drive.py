# SPDX-License-Identifier: BSD-3-Clause
"""Somebody who drives: by joystick, by steps or by a planner, and sees where the chair really is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.reed.core import DT, Array, Drive, Noise, Use, ou, simulate
from kurumaisu.bench.strangers.reed.room import Room

Pose = tuple[float, float, float]
Pair = tuple[float, float]
CLEARANCE = 0.82


@dataclass
class Manner:
    """How somebody drives, with which robot; menu: the only rates that dull drives ask for."""

    style: str
    robot: str
    law: str
    period: int
    menu: list[tuple[float, float]] | None
    jitter: bool


def manner(rng: np.random.Generator, robot: str, law: str, menu: list[tuple[float, float]] | None = None) -> Manner:
    """Draw a way to drive."""
    style = "steps" if menu else str(rng.choice(["joystick", "steps", "planner"]))
    return Manner(style, robot, law, int(rng.choice([4, 5, 8, 10, 20])), menu, bool(rng.random() < 0.4))


def _wish(rng: np.random.Generator, how: Manner) -> tuple[float, float, float]:
    """The next thing that the driver wants: v, w, and for how long."""
    if how.menu:
        v, w = how.menu[int(rng.integers(len(how.menu)))]
        return v, w, float(rng.uniform(2.0, 5.0))
    kind = rng.random()
    speed = 0.06 + 0.74 * rng.random() ** 1.2
    v = speed * (1.0 if rng.random() < 0.58 else -0.8)
    w = float(rng.choice([-1, 1])) * (0.06 + 0.94 * rng.random() ** 1.1)
    if kind < 0.10:
        return 0.0, 0.0, float(rng.uniform(0.8, 2.5))
    if kind < 0.42:
        return v, 0.0, float(rng.uniform(1.0, 3.5))
    if kind < 0.64:
        return 0.0, w, float(rng.uniform(1.0, 3.5))
    return v, w, float(rng.uniform(1.0, 4.0))


def _shape(rng: np.random.Generator, how: Manner, last: Pair, wish: Pair, n: int) -> Array:
    """Rows of v, w for n ticks from the last to what is wanted."""
    if how.style == "steps":
        return np.round(np.tile(wish, (n, 1)), 4)
    dt, out, now = how.period * DT, np.empty((n, 2)), np.array(last)
    keep, shake = np.exp(-dt / 0.22), np.zeros(2)
    for i in range(n):
        if how.style == "planner":
            now = now + np.clip(np.array(wish) - now, -dt * np.array([0.6, 1.3]), dt * np.array([0.6, 1.3]))
            out[i] = now
        else:
            shake = 0.9 * shake + rng.normal(size=2) * 0.02
            now = wish + (now - wish) * keep
            out[i] = np.where(np.abs(now) < 0.025, 0.0, now * (1 + shake))
    if how.style == "joystick":
        out = np.round(out * 127) / 127
    return np.asarray(np.round(np.clip(out, -1.0, 1.0), 5), dtype=np.float64)


def _start(rng: np.random.Generator, room: Room) -> Pose:
    """A place with space around it."""
    low, high = room.boxes[:, :2].min(axis=0), room.boxes[:, :2].max(axis=0)
    spots = rng.uniform(low, high, size=(400, 2))
    best = int(np.argmax(np.minimum(room.clear(spots[:, 0], spots[:, 1]), 1.6)))
    return float(spots[best, 0]), float(spots[best, 1]), float(rng.uniform(-np.pi, np.pi))


def blank(rng: np.random.Generator, seconds: float, start: float, how: Manner, noise: Noise) -> Drive:
    """A drive that asks for nothing, yet."""
    n = int(seconds / DT)
    marks = np.arange(0, n, how.period)
    if how.jitter:
        marks = np.unique(np.clip(marks + rng.integers(-1, 2, size=len(marks)), 0, n - 1))
    seconds_all = start + np.arange(n) * DT
    hum, bump = rng.uniform(25, 60), rng.uniform(0, 6, size=3)
    wave = np.sin(6.283 * seconds_all / hum + bump[0]) + 0.6 * np.sin(17.0 * seconds_all / hum + bump[1])
    columns = {"temperature": 21 + 4 * np.sin(2 * np.pi * seconds_all / 260 + bump[2]), "pressure": 2.4 + 0.15 * wave}
    return Drive(
        np.zeros(n),
        np.zeros(n),
        marks,
        start,
        how.robot,
        how.law,
        ou(rng, n, noise.sd_v, noise.tau)[0],
        ou(rng, n, noise.sd_w, noise.tau)[0],
        columns,
    )


def safe(room: Room, drive: Drive, uses: list[Use], pose: Pose, first: int = 0) -> bool:
    """Whether the chair touches nothing from one cell on."""
    _, path = simulate(drive, uses, pose)
    return bool(np.all(room.clear(path.x[first::10], path.y[first::10]) > CLEARANCE))


def _append(rng: np.random.Generator, drive: Drive, how: Manner, k: int, wish: tuple[float, float, float]) -> int:
    """Write a wish into the commands from tick k on, and return the tick after it."""
    count = max(2, int(wish[2] / (how.period * DT)))
    until = min(k + count, len(drive.ticks))
    at = int(drive.ticks[k])
    last = (float(drive.v[at - 1]), float(drive.w[at - 1])) if at else (0.0, 0.0)
    rows = _shape(rng, how, last, wish[:2], until - k)
    ends = np.append(drive.ticks, len(drive.v))
    widths = ends[k + 1 : until + 1] - ends[k:until]
    stop = int(ends[until])
    drive.v[at:stop], drive.w[at:stop] = np.repeat(rows[:, 0], widths), np.repeat(rows[:, 1], widths)
    drive.v[stop:], drive.w[stop:] = 0.0, 0.0
    return until


def _likely(room: Room, here: Pose, wish: tuple[float, float, float]) -> bool:
    """Whether an arc as asked for stays clear, at first sight."""
    t = np.linspace(0.1, 1.0, 9) * wish[2]
    turn = here[2] + wish[1] * t
    step = wish[0] * wish[2] / 9
    x, y = here[0] + np.cumsum(step * np.cos(turn)), here[1] + np.cumsum(step * np.sin(turn))
    return bool(np.all(room.clear(x, y) > CLEARANCE - 0.1))


def plan(rng: np.random.Generator, drive: Drive, how: Manner, room: Room, uses: list[Use]) -> Pose:
    """Fill a drive with wishes, each tried before it is taken; returns the pose at the start."""
    pose = _start(rng, room)
    odd = any(use.id == "base.steering_law" for use in uses)
    k = _append(rng, drive, how, 0, (0.0, 0.0, 1.5))
    while k < len(drive.ticks):
        at = int(drive.ticks[k])
        path = simulate(drive.upto(at), uses, pose)[1]
        here = (float(path.x[-1]), float(path.y[-1]), float(path.th[-1]))
        for _ in range(30):
            wish = _wish(rng, how)
            if not odd and not _likely(room, here, wish):
                continue
            until = _append(rng, drive, how, k, wish)
            stop = min(int(drive.ticks[until - 1]) + 160, len(drive.v))
            if safe(room, drive.upto(stop), uses, pose, at):
                break
        else:
            until = _append(rng, drive, how, k, (0.0, float(rng.choice([-0.7, 0.7])) if not how.menu else 0.0, 1.5))
        k = until
    return pose

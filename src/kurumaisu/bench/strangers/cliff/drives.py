# SPDX-License-Identifier: BSD-3-Clause
"""Drives: what a careful and a careless driver ask for, and the rows in which it is recorded."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .room import Room, clearance
from .values import STEP, Array, Rng


@dataclass
class Run:
    """One drive: commands held over steps of the plant, where it starts, and what else is measured."""

    name: str
    start: float  # [s] on the session's clock
    pose0: tuple[float, float, float]
    rows: Array  # [s] when a command is sent, from the start of the run
    asked: Array  # rows of v, w
    v: Array  # commands on the steps of the plant
    w: Array
    columns: dict[str, Array] = field(default_factory=dict)
    stuck: Array = field(default_factory=lambda: np.zeros(0, bool))  # the chair stands at a wall

    @property
    def t(self) -> Array:
        """Start of each step of the plant."""
        return STEP * np.arange(len(self.v))


@dataclass(frozen=True)
class Driver:
    """Habits of a driver."""

    careful: bool
    fast: float
    turn: float
    reverse: float  # share of the pieces that go back
    rest: float  # probability of a stop after a piece
    rough: float  # how much the stick shakes
    only: str = ""  # what the drives are restricted to


def draw_driver(rng: Rng, only: str = "") -> Driver:
    """A driver by chance."""
    careful = bool(rng.random() < 0.5)
    return Driver(
        careful,
        float(rng.uniform(0.45, 0.8)),
        float(rng.uniform(0.5, 1.0)),
        float(rng.uniform(0.1, 0.3)),
        float(rng.uniform(0.25, 0.6)) if careful else float(rng.uniform(0.1, 0.35)),
        0.0 if careful else float(rng.uniform(0.005, 0.03)),
        only,
    )


def _piece(d: Driver, rng: Rng) -> list[tuple[float, float, float]]:
    """One thing a driver does: (v, w, seconds) in a row."""
    if d.only:
        v, w = round(0.7 * d.fast, 2), round(0.7 * d.turn, 2)
        way = 1.0 if rng.random() < 0.5 else -1.0
        seconds = float(rng.uniform(1.0, 3.0))
        return {
            "speed": [(v, way * float(rng.choice([0.0, 0.3, 0.5, 0.8])), seconds)],
            "left": [(float(rng.choice([0.0, 0.3, 0.5])), w, seconds), (v, 0.0, 0.5 * seconds)],
            "arc": [(v, w, seconds)],
            "forward": [(float(rng.uniform(0.2, d.fast)), way * float(rng.uniform(0.1, d.turn)), seconds)],
            "spin": [(0.0, way * w, seconds)],
            "straight": [(way * v, 0.0, seconds)],
        }[d.only]
    v = float(rng.uniform(0.35, 1.0)) * d.fast
    w = float(rng.uniform(0.25, 1.0)) * d.turn * float(rng.choice([-1, 1]))
    what = rng.random()
    if what < d.reverse:
        return [(-0.6 * v, float(rng.choice([0.0, 0.5])) * w, float(rng.uniform(1.0, 3.0)))]
    if what < d.reverse + 0.2:
        return [(v, 0.0, float(rng.uniform(1.5, 4.0)))]
    if what < d.reverse + 0.35:
        return [(0.0, w, float(rng.uniform(1.0, 4.0)))]
    if what < d.reverse + 0.45:
        seconds = float(rng.uniform(2.0, 4.0))
        return [(v, w, seconds), (v, -w, seconds)]
    return [(v, float(rng.uniform(0.1, 0.7)) * w, float(rng.uniform(1.0, 4.0)))]


def _arc(pose: Array, v: float, w: float, seconds: float) -> Array:
    """Where such a piece leads, in steps of about 0.2 s."""
    n = max(2, int(seconds / 0.2))
    th = pose[2] + w * seconds * (np.arange(n) + 0.5) / n
    x = pose[0] + np.cumsum(v * np.cos(th)) * seconds / n
    y = pose[1] + np.cumsum(v * np.sin(th)) * seconds / n
    return np.column_stack([x, y, th + 0.5 * w * seconds / n])


def _plan(d: Driver, room: Room, pose: Array, length: float, rng: Rng) -> list[tuple[float, float, float]]:
    """Pieces that stay clear of the walls, as well as a driver manages."""
    plan = [(0.0, 0.0, float(rng.uniform(0.5, 2.0)))]
    left = length - plan[0][2]
    while left > 0.0:
        best: tuple[float, list[tuple[float, float, float]], Array] | None = None
        for _ in range(25):
            piece = _piece(d, rng)
            if d.careful:
                piece = [(round(v, 2), round(w, 2), round(s, 1)) for v, w, s in piece]
            path, at = [], pose
            for v, w, s in piece:
                path.append(_arc(at, v, w, s))
                at = path[-1][-1]
            room_left = clearance(room, np.concatenate(path))
            if best is None or room_left > best[0]:
                best = (room_left, piece, at)
            if room_left > 0.9:
                break
        assert best is not None
        plan += best[1]
        pose = best[2]
        if rng.random() < d.rest:
            plan.append((0.0, 0.0, float(rng.uniform(0.6, 2.5))))
        left = length - sum(p[2] for p in plan)
    return plan


def draw_run(name: str, start: float, d: Driver, room: Room, rng: Rng) -> Run:
    """A drive of 40 to 70 s."""
    length = float(rng.uniform(40.0, 66.0))
    pose0 = np.array([*room.free, float(rng.uniform(-np.pi, np.pi))])
    plan = _plan(d, room, pose0, length, rng)
    plan.append((0.0, 0.0, 1.0))
    ends = np.cumsum([p[2] for p in plan])
    steps = min(int(ends[-1] / STEP), int(70.0 / STEP))
    period = float(rng.choice([0.05, 0.1])) if d.careful else float(rng.choice([0.05, 0.066, 0.1]))
    jitter = float(rng.choice([0.0, 0.004]))
    at = np.arange(0.0, steps * STEP - 0.2, period)
    at[1:] += jitter * rng.standard_normal(len(at) - 1)
    index = np.unique(np.maximum(np.rint(at / STEP).astype(int), 0))
    index[0] = 0
    goal = np.array([plan[int(k)][:2] for k in np.minimum(np.searchsorted(ends, index * STEP, "right"), len(plan) - 1)])
    asked = _by_hand(goal, d, rng)
    hold = np.searchsorted(index, np.arange(steps), "right") - 1
    return Run(
        name,
        start,
        (float(pose0[0]), float(pose0[1]), float(pose0[2])),
        STEP * index,
        asked,
        asked[hold, 0],
        asked[hold, 1],
    )


def _by_hand(goal: Array, d: Driver, rng: Rng) -> Array:
    """A careful driver sends steps; a careless one's stick ramps and shakes."""
    if d.careful or d.only:
        return goal
    out = np.zeros_like(goal)
    now, shake = np.zeros(2), np.zeros(2)
    rate = np.array([0.06, 0.15])
    for k, aim in enumerate(goal):
        shake = 0.8 * shake + d.rough * rng.standard_normal(2) * [0.6, 1.5]
        target = np.where(np.abs(aim) > 0, aim + shake, 0.0)
        target = np.clip(target, [-0.6, -1.0], [0.8, 1.0])
        now = now + np.clip(target - now, -rate, rate)
        out[k] = np.where((np.abs(now) < 0.02) & (aim == 0), 0.0, now)
    return np.round(out, 3)

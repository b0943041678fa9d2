# SPDX-License-Identifier: BSD-3-Clause
"""A person or a robot drives about a room: safe manoeuvres, chosen every few seconds by where the chair is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess import plant
from kurumaisu.bench.strangers.loess.robots import Robot
from kurumaisu.bench.strangers.loess.rooms import Room, clearance, free_spot
from kurumaisu.bench.strangers.loess.values import STEP, Array, Hidden

AHEAD = np.arange(0.0, 1.01, 0.1)


@dataclass
class Drive:
    """A drive: what was sent when, what that causes, and where the chair really went."""

    commands: Array
    sent: list[int]
    caused: Array
    rates: Array
    path: Array
    columns: dict[str, Array]
    clock: float = 0.0


@dataclass(frozen=True)
class Manner:
    """How it is driven: usual, one_speed, one_side, one_turn or carousel, and in what room."""

    style: str
    room: Room
    robot: Robot


def draw_columns(rng: np.random.Generator, n: int, clock: float) -> dict[str, Array]:
    """Humidity, tyre pressure and temperature during a drive."""
    t = np.arange(n) * STEP
    waves = [np.sin(2 * np.pi * t / rng.uniform(40, 110) + rng.uniform(0, 6.28)) for _ in range(5)]
    warm = 20.0 + 4.5 * np.sin(2 * np.pi * (clock + t) / 420.0) + 0.4 * waves[4]
    return {
        "humidity": 50 + 10 * waves[0] + 7 * waves[1],
        "pressure": 2.0 + 0.15 * waves[2] + 0.09 * waves[3],
        "temperature": warm,
    }


def _candidates(manner: Manner, rng: np.random.Generator) -> Array:
    """Manoeuvres: v, w, how long, and how much they are liked."""
    fast, turn = manner.robot.fast, manner.robot.turn
    one_speed, one_turn = manner.style in ("one_speed", "carousel"), manner.style == "one_turn"
    rows = []
    for _ in range(16):
        v = fast * (0.7 if one_speed else rng.choice([0.25, 0.45, 0.7, 1.0]))
        w = turn * (rng.choice([0.0, 0.5]) if one_turn else rng.choice([0.0, 0.12, 0.3, 0.55])) * rng.choice([-1, 1])
        rows.append([v, w, rng.uniform(1.2, 3.8), 1.0])
    for _ in range(4):
        w = turn * (0.5 if one_turn else rng.choice([0.3, 0.6, 1.0])) * rng.choice([-1, 1])
        v = 0.7 * fast if manner.style == "carousel" else 0.0
        rows.append([v, w, rng.uniform(0.8, 2.6), -0.3])
    for _ in range(4):
        v = -fast * (0.7 if one_speed else rng.choice([0.2, 0.35, 0.55]))
        w = turn * (0.5 * rng.integers(0, 2) if one_turn else rng.choice([0.0, 0.15, 0.35])) * rng.choice([-1, 1])
        rows.append([v, w, rng.uniform(1.2, 2.8), -0.5 if manner.style != "one_speed" else -50.0])
    rows.append([0.0, 0.0, rng.uniform(1.0, 3.0), 0.3])
    found = np.array(rows)
    if manner.style == "one_side":
        found[:, 1] = np.abs(found[:, 1])
    return found


def _choose(manner: Manner, pose: Array, before: Array, rng: np.random.Generator) -> Array:
    """The manoeuvre that is safe, liked, and leads where it has not just been."""
    options = _candidates(manner, rng)
    time = AHEAD * (options[:, 2:3] + 0.6)
    v, w = options[:, :1], options[:, 1:2]
    middle = pose[2] + w * time / 2
    way = v * time * np.sinc(w * time / 2 / np.pi)
    x, y = pose[0] + way * np.cos(middle), pose[1] + way * np.sin(middle)
    segments = manner.room.segments()
    room = clearance(segments, x, y)
    safe = manner.robot.radius + 0.12
    short = np.minimum(room.min(axis=1) - safe, 0)
    away = np.where(room[:, 0] < safe, room[:, -1] - room[:, 0], 0)
    fresh = np.hypot(x[:, -1] - before[0], y[:, -1] - before[1])
    score = options[:, 3] + 0.35 * np.minimum(fresh, 4) + rng.gumbel(0, 0.6, len(options)) + 60 * short + 8 * away
    chosen: Array = options[int(np.argmax(score))]
    return chosen


def _send(drive: Drive, robot: Robot, goal: Array, span: tuple[int, int], rng: np.random.Generator) -> None:
    """Send commands towards a goal over a span of the grid; a person ramps and trembles."""
    k, end = span
    v, w = drive.commands[k - 1] if k else np.zeros(2)
    usual = round(robot.hold / STEP)
    while k < end:
        wait = max(1, usual + int(rng.integers(-1, 2))) if usual > 1 else 1
        if rng.random() < 0.002:
            wait = min(40, end - k)
        wait = min(wait, end - k)
        if robot.person:
            most = np.array([0.7, 1.6]) * wait * STEP
            v, w = np.array([v, w]) + np.clip(goal[:2] - [v, w], -most, most)
            shake = rng.normal(0, [0.008, 0.012]) * [abs(v) > 0.05, abs(w) > 0.05]
        else:
            v, w = goal[:2]
            shake = np.zeros(2)
        drive.commands[k : k + wait] = np.round([v + shake[0], w + shake[1]], 4)
        drive.sent.append(k)
        k += wait


def follow(drive: Drive, robot: Robot, noise: Array, hidden: list[Hidden], end: int, passes: int = 1) -> None:
    """Work out rates and path up to a point of the grid, by what is known of the path before."""
    columns = {name: c[:end] for name, c in drive.columns.items()}
    for _ in range(passes):
        caused = plant.motion(robot.law, drive.commands[:end], drive.path[:end], columns, hidden)
        share = robot.amplitude(caused[:, 0], caused[:, 1])
        rates = caused.copy()
        rates[:, :2] += noise[:end] * share[:, None]
        drive.path[:end] = plant.integrate(rates, drive.path[0])
        drive.path[end:] = drive.path[end - 1]
    drive.caused, drive.rates = caused, rates


def _worn(drive: Drive, k: int) -> Array:
    return np.asarray(drive.path[max(0, k - round(9 / STEP))])


def go(manner: Manner, hidden: list[Hidden], rng: np.random.Generator, clock: float) -> Drive:
    """One drive of 90 to 200 s."""
    n = round(rng.uniform(95, 190) / STEP)
    robot = manner.robot
    start = [*free_spot(manner.room, rng, robot.radius + 0.35), rng.uniform(-np.pi, np.pi)]
    drive = Drive(
        np.zeros((n, 2)), [], np.zeros((n, 3)), np.zeros((n, 3)), np.tile(start, (n, 1)), draw_columns(rng, n, clock)
    )
    drive.clock = clock
    noise = np.column_stack([s * plant.wander(rng, n, STEP, robot.tau) for s in (robot.sd_v, robot.sd_w)])
    first = round(rng.uniform(1.0, 2.5) / STEP)
    _send(drive, robot, np.zeros(2), (0, first), rng)
    k = first
    while k < n:
        follow(drive, robot, noise, hidden, k)
        goal = _choose(manner, drive.path[k - 1], _worn(drive, k - 1), rng)
        end = min(n, k + max(10, round(goal[2] / STEP)))
        _send(drive, robot, goal, (k, end), rng)
        k = end
    follow(drive, robot, noise, hidden, n, 3)
    near = clearance(manner.room.segments(), drive.path[:, 0], drive.path[:, 1]).min()
    inside = (drive.path[:, 0].min() > 0) & (drive.path[:, 0].max() < manner.room.width)
    if near < 0.05 or not inside:
        raise RuntimeError("it drove into a wall")
    return drive

# SPDX-License-Identifier: BSD-3-Clause
"""A person drives: manoeuvres chosen by where the chair is, commands at an uneven rate."""

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.chair import simulate
from kurumaisu.bench.strangers.delta.core import DT, Array, Cause, Drive, Setup
from kurumaisu.bench.strangers.delta.law import held, integrate

KEEP, CLEAR = 0.95, 0.78


def manoeuvre(rng: np.random.Generator, style: str) -> list[tuple[float, float, float]]:
    """A few phases (v, w, seconds) of one kind."""
    side = float(rng.choice([-1, 1]))
    v = float(rng.choice([0.12, 0.2, 0.3, 0.4, 0.55, 0.75, 0.95], p=[0.1, 0.2, 0.25, 0.2, 0.12, 0.08, 0.05]))
    w = side * float(rng.choice([0.12, 0.25, 0.4, 0.6, 0.9]))
    long = float(rng.uniform(1.5, 5))
    if style == "one_speed":
        return (
            [(0.35, float(rng.uniform(-0.6, 0.6)), long)] if rng.random() < 0.7 else [(0.0, 0.0, 1.5), (0.0, w, long)]
        )
    if style == "one_turn":
        w = 0.5 * side
        return [[(v, 0.0, long)], [(v, w, long)], [(0.0, w, long)], [(0.0, 0.0, 1.5)], [(-0.2, 0.0, 2.0)]][
            rng.integers(5)
        ]
    if style == "left_only":
        return [[(v, 0.0, long)], [(v, abs(w), long)], [(0.0, abs(w), long)], [(-0.2, abs(w), 2.0)]][rng.integers(4)]
    if style == "reverse_only":
        return [[(-min(v, 0.6), 0.0, long)], [(-min(v, 0.6), w, long)], [(0.0, w, long)], [(0.0, 0.0, 1.5)]][
            rng.integers(4)
        ]
    if style == "slow":
        return [(v, w, 2 * long)] if rng.random() < 0.7 else [(0.0, w, long)]
    kinds = {
        "straight": [(v, 0.0, long)],
        "curve": [(v, w, long)],
        "spot": [(0.0, side * float(rng.uniform(0.3, 1.0)), float(rng.uniform(1.5, 5)))],
        "reverse": [(-min(v, 0.6), 0.0 if rng.random() < 0.5 else 0.6 * w, min(long, 4.0))],
        "stop": [(0.0, 0.0, float(rng.uniform(1, 3)))],
        "slalom": [(min(v, 0.6), w, 1.2), (min(v, 0.6), -w, 1.2), (min(v, 0.6), w, 1.2)],
        "there_and_back": [(min(v, 0.4), 0.0, 2.5), (0.0, 0.0, 0.7), (-min(v, 0.4), 0.0, 2.5)],
    }
    share = [3, 3, 2, 1.5, 1.2, 1, 1] if style == "lab" else [4, 2, 2, 1, 1.5, 0.2, 0.5]
    return kinds[str(rng.choice(list(kinds), p=np.array(share) / sum(share)))]


def command_rows(
    rng: np.random.Generator, last: Array, phases: Sequence[tuple[float, float, float]], rate: float, soft: float
) -> Array:
    """Rows of commands of a few phases: a joystick moves at a limited speed, rows come at uneven times."""
    t, v, w = last.tolist()
    rows = []
    for goal_v, goal_w, seconds in phases:
        end = t + seconds
        while t < end:
            h = min(max(1 + 0.06 * rng.standard_normal(), 0.6), 1.6) / rate
            t += h
            v += min(max(goal_v - v, -soft * h), soft * h)
            w += min(max(goal_w - w, -2 * soft * h), 2 * soft * h)
            rows.append((round(t, 4), round(v, 4), round(w, 4)))
    return np.array(rows)


def drive_it(setup: Setup, drive: Drive, causes: Sequence[Cause]) -> bool:
    """Choose commands by where the chair really is, and drive them; false if it came too near to a wall."""
    rng, cells = setup.rng, round(drive.length / DT)
    keep, room = setup.noise, setup.room
    drive.noise_v, drive.noise_w = coloured(rng, cells, keep.sd_v, keep.tau), coloured(rng, cells, keep.sd_w, keep.tau)
    rate, soft = setup.facts["command_rate"], setup.facts["soft"]
    drive.commands = np.array([[0.0, 0.0, 0.0]])
    first = (0.0, 0.0, float(rng.uniform(1.5, 3)))
    drive.commands = np.vstack([drive.commands, command_rows(rng, drive.commands[-1], [first], rate, soft)])
    while True:
        places = rng.uniform(1.2, 1.0 * min(room.width, room.depth) - 1.2, (40, 2))
        good = places[room.clearance(places[:, 0], places[:, 1]) > KEEP + 0.15]
        if len(good):
            break
    drive.origin = (float(good[0, 0]), float(good[0, 1]), float(rng.uniform(-np.pi, np.pi)))
    while drive.commands[-1, 0] < drive.length:
        now = drive.commands[-1, 0]
        done = simulate(setup, drive, causes, noisy=True, cells=max(1, min(cells, round(now / DT))))
        pose = (float(done.x[-1]), float(done.y[-1]), float(done.th[-1]))
        drive.commands = np.vstack([drive.commands, chosen(setup, drive.commands[-1], pose, rate, soft)])
    drive.commands = drive.commands[drive.commands[:, 0] < drive.length]
    tail = drive.commands[:, 0] > drive.length - 1.5
    drive.commands[tail, 1:] = 0.0
    drive.path = simulate(setup, drive, causes, noisy=True)
    return bool(room.clearance(drive.path.x, drive.path.y).min() > CLEAR - 0.04)


def chosen(setup: Setup, last: Array, pose: tuple[float, float, float], rate: float, soft: float) -> Array:
    """Rows of the first of many manoeuvres that stay clear of the walls, else of the one that stays clearest."""
    here = float(setup.room.clearance(np.array([pose[0]]), np.array([pose[1]]))[0])
    best, most = np.zeros((0, 3)), -1.0
    for _ in range(25):
        phases = [p for _ in range(int(setup.rng.integers(1, 3))) for p in manoeuvre(setup.rng, setup.style)]
        rows = command_rows(setup.rng, last, phases, rate, soft)
        shifted = rows - np.array([last[0], 0.0, 0.0])
        stop = np.array([[shifted[-1, 0] + 0.01, 0.0, 0.0]])
        v, w = held(np.vstack([[0.0, last[1], last[2]], shifted, stop]), round(shifted[-1, 0] / DT) + 1)
        coast = np.concatenate([v, np.linspace(rows[-1, 1], 0, 20)])
        path = integrate(coast, np.concatenate([w, np.zeros(20)]), np.zeros(len(coast)), pose)
        gap = float(setup.room.clearance(path.x[::5], path.y[::5]).min())
        if gap >= min(KEEP, here - 0.03):
            return rows
        if gap > most:
            best, most = rows, gap
    return best


def coloured(rng: np.random.Generator, n: int, sd: float, tau: float) -> Array:
    """Noise of an Ornstein-Uhlenbeck process on the grid."""
    return lag_noise(rng.normal(0, 1, n), np.exp(-DT / tau)) * sd


def lag_noise(white: Array, a: float) -> Array:
    """White noise to a stationary one of unit variance."""
    white = white * np.sqrt(1 - a * a)
    white[0] /= np.sqrt(1 - a * a)
    out, y = np.empty(len(white)), 0.0
    for i, e in enumerate(white.tolist()):
        y = a * y + e
        out[i] = y
    return out

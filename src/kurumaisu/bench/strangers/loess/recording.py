# SPDX-License-Identifier: BSD-3-Clause
"""From drives to the tables of a recording: stamps with jitter and gaps, noise, bursts, rows that are off."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.strangers.loess import plant, robots
from kurumaisu.bench.strangers.loess.case import Case, columns_at, true_scans
from kurumaisu.bench.strangers.loess.driving import Drive
from kurumaisu.bench.strangers.loess.pose_effects import clock, refer
from kurumaisu.bench.strangers.loess.sensing import look, read
from kurumaisu.bench.strangers.loess.values import STEP, Array, Flags, Hidden

NATURE = (Hidden("laser.heavy_tails", 0.0005), Hidden("laser.dropout", 0.003))


@dataclass
class Tables:
    """The tables of a drive; stamps count from the recording's epoch, scan_t and pose_t from the drive's start."""

    name: str
    start: float
    command: Array
    pose: Array
    fair: Flags
    scan: Array = field(default_factory=lambda: np.zeros((0, 0)))
    covariate: Array = field(default_factory=lambda: np.zeros((0, 0)))
    columns: list[str] = field(default_factory=list)
    query: Array = field(default_factory=lambda: np.zeros((0, 2)))


def _stamps(rng: np.random.Generator, period: float, length: float, gaps: float) -> Array:
    steps = period * np.maximum(0.25, 1 + rng.normal(0, 0.06, int(length / period * 1.3)))
    late = rng.random(steps.size) < 0.01
    steps = np.where(late, 1.6 * steps, steps)
    steps[1:] = np.where(late[:-1], 0.45 * steps[1:], steps[1:])
    steps = steps + np.where(rng.random(steps.size) < gaps * period, rng.uniform(0.3, 1.2, steps.size), 0.0)
    t = 0.05 + np.cumsum(steps)
    return np.asarray(np.round(t[t < length - 0.1], 6))


def _reference(case: Case, drive: Drive, rng: np.random.Generator) -> tuple[Array, Array, Flags]:
    """Stamps (since the start), measured poses, and which rows are neither off nor in a burst."""
    ref = case.robot.reference
    t = _stamps(rng, ref.period, len(drive.path) * STEP, 0.02)
    pose = refer(plant.at(drive.path, t), t, case.hidden)
    slow = [plant.wander(rng, int(t[-1] / 0.1) + 2, 0.1, ref.wander_tau) for _ in range(3)]
    grid = np.arange(slow[0].size) * 0.1
    burst = np.zeros(t.size, dtype=bool)
    for start in rng.uniform(0, t[-1], int(rng.integers(0, 3))):
        burst |= (t > start) & (t < start + 0.4)
    off = (rng.random(t.size) < 0.0008) & ~burst
    sds = np.array([ref.position, ref.position, ref.heading])
    slow_sds = np.array([ref.wander, ref.wander, ref.wander_heading])
    white = rng.standard_normal((t.size, 3)) * np.where(burst, 2.5, 1.0)[:, None]
    pose += sds * white + slow_sds * np.column_stack([np.interp(t, grid, s) for s in slow])
    pose[:, :2] += np.where(off[:, None], rng.normal(0, 0.3, (t.size, 2)), 0.0)
    return np.round(clock(t, case.hidden), 6), pose, ~(burst | off)


def record(case: Case, drive: Drive, name: str, epoch: float, rng: np.random.Generator) -> Tables:
    """Write down what was commanded, measured and seen during a drive."""
    start = epoch + drive.clock
    sent = np.array(drive.sent)
    t = sent * STEP + rng.uniform(0, 0.002, sent.size)
    v, w = drive.commands[sent].T
    command = np.column_stack([start + t, v, w])
    if case.robot.law:
        f, s = robots.volts(case.robot.law, v, w)
        command = np.column_stack([start + t, f, s, v, w])
    stamps, pose, fair = _reference(case, drive, rng)
    tables = Tables(name, start, command, np.column_stack([start + stamps, pose]), fair)
    if case.laser is not None:
        length = len(drive.path) * STEP
        looks = _stamps(rng, case.laser.period, length - 1.0, 0.01) + 0.5
        scans = true_scans(drive, looks)
        has = {h.id for h in case.hidden}
        natural = [h for h in NATURE if h.id not in has]
        sight = look(case.laser, case.room, scans, case.hidden)
        tables.scan = np.column_stack([start + looks, read(case.laser, sight, [*case.hidden, *natural], rng)])
    return tables


def add_covariates(tables: Tables, drive: Drive, names: list[str], rng: np.random.Generator) -> None:
    """A slow table of extra columns."""
    t = _stamps(rng, 0.5, len(drive.path) * STEP, 0.0)
    columns = columns_at(drive, t)
    digits = {"humidity": 2, "pressure": 3, "temperature": 2}
    tables.columns = names
    tables.covariate = np.column_stack([tables.start + t, *(np.round(columns[n], digits[n]) for n in names)])

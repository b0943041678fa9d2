# SPDX-License-Identifier: BSD-3-Clause
"""A drive and what a list of causes makes of it: rates, path, and what the reference would measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.asking import asked
from kurumaisu.bench.strangers.scree.basics import STEP, Array, Cause, Column, Path, Rates, Rows, compose, integrate
from kurumaisu.bench.strangers.scree.rates import EQUATIONS, State
from kurumaisu.bench.strangers.scree.robots import Robot
from kurumaisu.bench.strangers.scree.unknowns import OFFSETS, RATES

Causes = tuple[Cause, ...]


@dataclass(frozen=True)
class Drive:
    """What happened: rows of commands, the true path, when it began in the recording's time."""

    name: str
    start: float
    rows: Rows
    path: Path
    robot: Robot
    columns: tuple[Column, ...]

    @property
    def n(self) -> int:
        """How many cells of the grid it has."""
        return len(self.path.x) - 1

    @property
    def length(self) -> float:
        """Its duration."""
        return self.n * STEP


def rates_of(drive: Drive, causes: Causes, n: int) -> tuple[Rates, State]:
    """Rates in the first n cells, by the equations of the causes, without noise."""
    a = asked(drive.rows, causes, drive.robot, n)
    rates = Rates(a.v, a.w, np.zeros(n))
    t = STEP * (np.arange(n) + 0.5)
    state = State(a, rates, drive.path.cut(n), t, drive.start, drive.robot, drive.columns)
    for c in causes:
        equation = EQUATIONS.get(c.id) or RATES.get(c.id)
        if equation is not None:
            rates = equation(c, State(a, rates, state.path, t, drive.start, drive.robot, drive.columns))
    return rates, state


def stamp(causes: Causes, t: Array) -> Array:
    """What the reference's clock shows at true times of a drive."""
    for c in causes:
        if c.id == "base.clock_scale":
            late = 20 * (1 - np.exp(-t / 20)) if c.other else 0.0
            return np.asarray(t + c.size * (t - 0.5 * late))
    return t


def unstamp(causes: Causes, shown: Array) -> Array:
    """True times of what the reference's clock shows."""
    t = np.linspace(-20.0, 400.0, 8401)
    if not any(c.id == "base.clock_scale" for c in causes):
        return shown
    return np.interp(shown, stamp(causes, np.maximum(t, 0.0)) + np.minimum(t, 0.0), t)


def _marker(c: Cause, pose: Array) -> Array:
    """Where on the robot the mark is; the other one hangs on a mount that gives as the robot turns away."""
    at = np.zeros_like(pose)
    swing = c.size * (1 + 0.2 * np.sin(pose[:, 2] + 6 * c.draws[0])) if c.other else np.full(len(pose), c.size)
    at[:, {"base.marker_x": 0, "base.marker_y": 1, "base.marker_yaw": 2}[c.id]] = swing
    return compose(pose, at)


def seen(drive: Drive, causes: Causes, pose: Array, t: Array) -> Array:
    """What the reference would show of poses of base_link at true times, without noise."""
    out = pose
    for c in causes:
        if c.id.startswith("base.marker"):
            out = _marker(c, out)
        elif c.id in OFFSETS:
            r = Rates(t, t, t)
            a = asked(drive.rows, (), drive.robot, 1)
            out = out + OFFSETS[c.id](c, State(a, r, drive.path, t, drive.start, drive.robot, drive.columns), pose)
    return out


def unseen(drive: Drive, causes: Causes, shown: Array, t: Array) -> Array:
    """Poses of base_link of which the reference would show this."""
    pose = shown
    for _ in range(3):
        pose = shown - (seen(drive, causes, pose, t) - pose)
    return pose


def reference_path(drive: Drive, causes: Causes, shown: Array) -> Array:
    """What the reference would show at its stamps, if the rates were exactly those of the causes."""
    rates, _ = rates_of(drive, causes, drive.n)
    path = integrate(rates, np.array([drive.path.x[0], drive.path.y[0], drive.path.th[0]]))
    t = unstamp(causes, shown)
    pose, real = path.at(t), drive.path.at(t)
    if not any(c.id in OFFSETS for c in causes):
        return seen(drive, causes, pose, t)
    off = seen(drive, causes, real, t) - real
    turn = np.stack([np.zeros(len(t)), np.zeros(len(t)), pose[:, 2] - real[:, 2]], axis=-1)
    moved = compose(turn, off)
    moved[:, 2] = off[:, 2]
    return pose + moved

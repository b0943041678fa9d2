# SPDX-License-Identifier: BSD-3-Clause
"""Robots that drive UMBmark's square (Borenstein and Feng 1996), and what is made of it: its formulas and others.

The robots are wheels: radii and a track that differ from what the software has; the way is their own, not the critic's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.critic import least_squares
from kurumaisu.bench.critic.least_squares import Inputs
from kurumaisu.bench.table import Table
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import Multipliers
from kurumaisu.params import robot_of
from kurumaisu.settings import Section
from kurumaisu.types import FloatArray

SIDE, RADIUS, TRACK = 4.0, 0.10, 0.50  # [m] of the square; of the robot, as its software has it
_STEP = 0.01  # [s]
_SPEED, _TURN = 0.2, np.pi / 4  # [m/s], [rad/s]
_REST = 1.0  # [s] at each corner, before and after the turn
_RUNS = 2  # in each direction; the paper has five
_UNEVEN = 0.01  # [rad] by which a floor turns a robot on each metre, 1 sd
_POSITION, _HEADING = 0.003, 0.003  # [m], [rad] error of the reference, 1 sd


@dataclass(frozen=True)
class Wheels:
    """Radius of the left and the right wheel, over that of the software, and the track over that of the software."""

    left: float
    right: float
    track: float


NOMINAL = Wheels(1.0, 1.0, 1.0)


def compare(draws: int, criticised: Callable[[Recording], Multipliers | None]) -> None:
    """Print how well the square closes with what each method makes of a few squares; rms over robots."""
    methods: dict[str, Callable[[list[Inputs]], Wheels]] = {
        "nothing": lambda _: NOMINAL,
        "UMBmark": _umbmark,
        "least squares, 6 parameters": _by_least_squares,
        "the critic": lambda driven: _by_critic(driven, criticised),
    }
    off: dict[str, list[tuple[float, float, float]]] = {name: [] for name in methods}
    for seed in range(draws):
        rng = np.random.default_rng(1000 + seed)
        robot = Wheels(*rng.normal(1.0, [0.01, 0.01, 0.04]))
        driven = [drive(robot, NOMINAL, side, rng) for _ in range(_RUNS) for side in (1.0, -1.0)]
        for name, method in methods.items():
            found = method(driven)
            ratios = found.right / found.left - robot.right / robot.left, found.track - robot.track
            off[name].append((100 * ratios[0], 100 * ratios[1], 1000 * closes(robot, found)))
    title = f"{draws} robots that drive {_RUNS} squares of {SIDE:g} m in each direction on an uneven floor; rms"
    table = Table(
        title, "method", "right over left wheel off by [%]", "track off by [%]", "next square ends off by [mm]"
    )
    for name, rows in off.items():
        table.row(name, *np.sqrt(np.mean(np.square(rows), axis=0)))


def closes(robot: Wheels, software: Wheels) -> float:
    """Return how far from its start [m] a square ends on an even floor, the worse of both directions."""
    return max(float(np.hypot(*drive(robot, software, side).poses[-1, :2])) for side in (1.0, -1.0))


def drive(robot: Wheels, software: Wheels, side: float, rng: np.random.Generator | None = None) -> Inputs:
    """Return a square to the left (side 1) or to the right (-1); without rng the floor is even, nothing scatters."""
    corner = [
        (SIDE / _SPEED, _SPEED, 0.0),
        (_REST, 0.0, 0.0),
        (np.pi / 2 / _TURN, 0.0, side * _TURN),
        (_REST, 0.0, 0.0),
    ]
    rows = [np.tile([v, w], (round(seconds / _STEP), 1)) for seconds, v, w in 4 * corner]
    v, w = np.vstack(rows).T
    turn = w * TRACK * software.track / 2
    left, right = robot.left * (v - turn) / software.left, robot.right * (v + turn) / software.right
    way, turned = (left + right) / 2 * _STEP, (right - left) / (TRACK * robot.track) * _STEP
    if rng is not None:
        turned = turned + _UNEVEN * np.sqrt(np.abs(way)) * rng.standard_normal(len(way))
    theta = np.append(0.0, np.cumsum(turned))
    x, y = (np.append(0.0, np.cumsum(way * f(theta[:-1] + turned / 2))) for f in (np.cos, np.sin))
    poses = np.column_stack([x, y, theta])[::10]
    if rng is not None:
        poses = poses + rng.normal(0.0, [_POSITION, _POSITION, _HEADING], poses.shape)
    return Inputs(0.0, _STEP, v, w, 0.1 * np.arange(len(poses)), poses)


def umbmark(left: FloatArray, right: FloatArray) -> Wheels:
    """Return the wheels by the paper's formulas; left, right (n, 2): ends [m] of squares in either direction."""
    x_left, x_right = left[:, 0].mean(), right[:, 0].mean()
    alpha, beta = (x_right + x_left) / (-4 * SIDE), (x_right - x_left) / (-4 * SIDE)
    track = (np.pi / 2) / (np.pi / 2 - alpha)
    radius = SIDE / 2 / np.sin(beta / 2) if beta else np.inf  # of the way that should be straight
    ratio = (radius + TRACK / 2) / (radius - TRACK / 2) if np.isfinite(radius) else 1.0
    return Wheels(2 / (ratio + 1), 2 / (1 / ratio + 1), float(track))


def _umbmark(driven: list[Inputs]) -> Wheels:
    ends = np.array([one.poses[-1, :2] - one.poses[0, :2] for one in driven])
    return umbmark(ends[::2], ends[1::2])


def _by_least_squares(driven: list[Inputs]) -> Wheels:
    ahead, around, curve = least_squares.fitted(driven)[:3]
    track = ahead / around
    apart = curve * ahead * TRACK * track / 2
    return Wheels(float(ahead - apart), float(ahead + apart), float(track))


def _by_critic(driven: list[Inputs], criticised: Callable[[Recording], Multipliers | None]) -> Wheels:
    said = Section({"robot": {"kind": "diff_drive", "radius": RADIUS, "track": TRACK}}, "squares")
    runs = []
    for i, one in enumerate(driven):
        t = one.start + one.dt * np.arange(len(one.v))
        command = Series(t, np.column_stack([one.v, one.w]), ("v", "w"))
        runs.append(Run(f"square_{i}", command=command, pose=Series(one.times, one.poses, ("x", "y", "theta"))))
    truth = (_POSITION, _HEADING)
    names = tuple(run.name for run in runs)
    found = criticised(Recording("squares", tuple(runs), train=names, truth=truth, robot=robot_of(said)))
    if found is None:
        return NOMINAL
    parts = found.left_wheel_radius_multiplier, found.right_wheel_radius_multiplier, found.wheel_separation_multiplier
    return Wheels(*(part.estimate for part in parts))

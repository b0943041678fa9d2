# SPDX-License-Identifier: BSD-3-Clause
"""What odometry says where it was left unsaid: rates out of poses, and poses out of wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error
from kurumaisu.params import Robot
from kurumaisu.types import FloatArray

COLUMNS = ("x", "y", "theta", "v", "w")
WHEEL_TABLES = ("wheels", "wheel_rates")  # of angles or ticks, of rates


@dataclass(frozen=True)
class Wheels:
    """Wheels driven apart from each other. radius, track [m]; left, right: joints of `topic`, or topics of numbers.

    ticks_per_turn: of what the numbers count; None: they are rates [rad/s].
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    radius: float
    track: float
    topic: str = ""
    ticks_per_turn: float | None = None

    @property
    def turn(self) -> float:
        """Return by what the numbers are angles [rad], or rates of them."""
        return 1.0 if self.ticks_per_turn is None else 2 * np.pi / self.ticks_per_turn

    def motion(self, wheels: FloatArray) -> FloatArray:
        """Return way and turn, (n, 2), of angles of the left and the right wheel, (n, 2), or the rates of rates."""
        left, right = self.radius * wheels.T
        return np.stack([(left + right) / 2, (right - left) / self.track], axis=1)


def with_wheels(where: str, parts: dict[str, Series | None], robot: Robot | None) -> None:
    """Put the odometry in place of tables of wheels: of angles [rad] or ticks, or of rates [rad/s].

    Raise Error naming where, if there is other odometry, or nothing says how large the wheels are.
    """
    given = [name for name in WHEEL_TABLES if parts.get(name) is not None]
    for name in given:
        if len(given) > 1 or "odom" in parts:
            raise Error(
                f"{where}/{name}: is odometry, and so is {'odom' if 'odom' in parts else given[1]}: one of them"
            )
        if robot is None or robot.radius is None or robot.track is None:
            raise Error(f"{where}/{name}: how large the wheels are is not said: `robot` in meta.yaml, radius and track")
        table = parts.pop(name)
        assert table is not None
        angles = name == WHEEL_TABLES[0]
        wheels = Wheels((), (), robot.radius, robot.track, ticks_per_turn=robot.ticks_per_turn if angles else None)
        moved = wheels.motion(wheels.turn * (np.diff(table.values, axis=0) if angles else table.values))
        poses = along(moved) if angles else driven_by(table.t, moved)
        rates = rates_between(table.t, poses) if angles else moved
        parts["odom"] = Series(table.t, np.column_stack([poses, rates]), COLUMNS)


def rates_between(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Return v [m/s] and w [rad/s], (n, 2), of the arcs between poses (n, 3) at times (n,) [s].

    The rates of a row are those of the interval that ends there; the first row's are those of the second.
    """
    if len(t) < 2:
        return np.zeros((len(t), 2))
    step = geometry.between(poses[:-1], poses[1:])
    turn = geometry.wrap(step[:, 2])
    # Equation (3) in closed form: an arc is longer than its chord, which points half the turn aside.
    chord = step[:, 0] * np.cos(turn / 2) + step[:, 1] * np.sin(turn / 2)
    arc = chord / np.sinc(turn / (2 * np.pi))
    dt = np.diff(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.column_stack([arc, turn]) / dt[:, None]
    return np.vstack([rates[:1], rates])


def driven_by(t: FloatArray, rates: FloatArray) -> FloatArray:
    """Return poses (n, 3), the first 0, of rates v [m/s] and w [rad/s], (n, 2), that change evenly between rows."""
    return along((rates[1:] + rates[:-1]) / 2 * np.diff(t)[:, None])


def along(arcs: FloatArray) -> FloatArray:
    """Return the poses (n + 1, 3), the first 0, at the ends of arcs (n, 2) of a length [m] and a turn [rad]."""
    theta = np.append(0.0, np.cumsum(arcs[:, 1]))
    # The chord of an arc points half the turn aside, and is shorter than the arc.
    course, chord = (theta[1:] + theta[:-1]) / 2, arcs[:, 0] * np.sinc(arcs[:, 1] / (2 * np.pi))
    x, y = (np.append(0.0, np.cumsum(chord * f(course))) for f in (np.cos, np.sin))
    return np.stack([x, y, theta], axis=1)

# SPDX-License-Identifier: BSD-3-Clause
"""What odometry says where it was left unsaid: rates out of poses, and poses out of wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.counters import Counter, Spans, counted
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

    def counter(self, where: str) -> Counter:
        """Return the counter of a wheel that is read there."""
        return Counter(where, self.turn, self.turn * self.radius)

    def odometry(self, t: FloatArray, counts: FloatArray, lost: Spans) -> FloatArray:
        """Return rows (n, 5) of x, y, theta, v, w, from 0, of what both sides' counters say (n, 2) at times (n,) [s].

        lost: spans of time [s] in which it is not known what was driven: nothing, then.
        """
        steps = np.diff(counts, axis=0)
        for start, stop in lost:
            steps[(t[1:] > start) & (t[:-1] < stop)] = 0.0
        poses = along(self.motion(self.turn * steps))
        return np.column_stack([poses, rates_between(t, poses)])


def with_wheels(where: str, name: str, parts: dict[str, Series | None], robot: Robot | None, faults: Faults) -> Spans:
    """Put the odometry in place of tables of wheels: of angles [rad] or ticks, or of rates [rad/s].

    where, name: of the run, in errors and in faults. Return the spans [s] in which it is not known what was driven.
    Raise Error naming where, if there is other odometry, or nothing says how large the wheels are.
    """
    lost: Spans = ()
    given = [name for name in WHEEL_TABLES if parts.get(name) is not None]
    for each in given:
        if len(given) > 1 or "odom" in parts:
            raise Error(
                f"{where}/{each}: is odometry, and so is {'odom' if 'odom' in parts else given[1]}: one of them"
            )
        if robot is None or robot.radius is None or robot.track is None:
            raise Error(f"{where}/{each}: how large the wheels are is not said: `robot` in meta.yaml, radius and track")
        table = parts.pop(each)
        assert table is not None
        if each == WHEEL_TABLES[0]:
            wheels = Wheels(("left",), ("right",), robot.radius, robot.track, ticks_per_turn=robot.ticks_per_turn)
            sides = [
                counted(wheels.counter(f"{name}/{each}: {side}"), table.t, table.column(side), faults)
                for side in table.columns
            ]
            lost = tuple(sorted({span for _, spans in sides for span in spans}))
            rows = wheels.odometry(table.t, np.stack([counts for counts, _ in sides], axis=1), lost)
        else:
            moved = Wheels((), (), robot.radius, robot.track).motion(table.values)
            rows = np.column_stack([driven_by(table.t, moved), moved])
        parts["odom"] = Series(table.t, rows, COLUMNS)
    return lost


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

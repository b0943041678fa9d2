# SPDX-License-Identifier: BSD-3-Clause
"""What odometry says where it was left unsaid: rates out of poses, poses out of wheels that tables or bags tell of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.bags.messages import shown
from kurumaisu.critic.bags.topics import absolute, read_topics
from kurumaisu.critic.data.clean import HICCUP_SHARE, Faults
from kurumaisu.critic.values.digits import moment, times
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import Robot
from kurumaisu.types import BoolArray, FloatArray

COLUMNS = ("x", "y", "theta", "v", "w")
WHEEL_TABLES = ("wheels", "wheel_rates")  # of angles or ticks, of rates
Spans = tuple[tuple[float, float], ...]
_RANGES = (2.0**8, 2.0**16, 2.0**32)  # of counters, beside a turn of the wheel
_FASTER = 1.5  # times the largest of the other steps that a wheel may take
_ANEW = 10.0  # times that which a jump from or to 0 has at least, and
_NEAR = 0.1  # share of the jump by which one end of it may be off 0
_LEAST = 0.1  # [rad] that any wheel may turn in a step, or
_LEAST_SHARE = 1 / 16  # of the range
_FASTEST = 100.0  # [m/s] no wheel drives faster
JOINTS = "sensor_msgs/msg/JointState"


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


@dataclass(frozen=True)
class Wheel:
    """A wheel of either side: where it is read, in words, and what it says (n,) at increasing times (n,) [s]."""

    where: str
    t: FloatArray
    values: FloatArray


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
        wheels = Wheels(("left",), ("right",), robot.radius, robot.track, ticks_per_turn=robot.ticks_per_turn)
        said = [Wheel(f"{name}/{each}: {side}", table.t, table.column(side)) for side in table.columns]
        parts["odom"], lost = _odometry(wheels, said, faults, counts=each == WHEEL_TABLES[0])
    return lost


def _odometry(wheels: Wheels, said: Sequence[Wheel], faults: Faults, *, counts: bool) -> tuple[Series, Spans]:
    """Return the poses, from 0, by the wheels of the left and then the right side, and spans [s] that are not known.

    counts: whether they say angles or ticks, of which nothing is driven in those spans; else rates, which the odometry
    has then, too. faults gets jumps of what is counted.
    """
    lost: set[tuple[float, float]] = set()
    t, at = said[0].t, []
    for wheel in said:
        values, spans = counted(wheels, wheel, faults) if counts else (wheel.values, ())
        lost.update(spans)
        at.append(np.interp(t, wheel.t, values))
    left, right = np.array(at[: len(wheels.left)]), np.array(at[len(wheels.left) :])
    sides = np.stack([left.mean(axis=0), right.mean(axis=0)], axis=1)
    if not counts:
        rates = wheels.motion(sides)
        return Series(t, np.column_stack([driven_by(t, rates), rates]), COLUMNS), ()
    steps = np.diff(sides, axis=0)
    for start, stop in lost:
        steps[(t[1:] > start) & (t[:-1] < stop)] = 0.0
    return Series(t, along(wheels.motion(wheels.turn * steps)), COLUMNS[:3]), tuple(sorted(lost))


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


def counted(wheels: Wheels, wheel: Wheel, faults: Faults) -> tuple[FloatArray, Spans]:
    """Return what a wheel counts, (n,), without overflows, and spans [s] in which it is not known what was counted.

    An overflow is a jump to the other end of the smallest range that holds all counts, if the wheel, had it turned past
    that end, would not have turned faster than elsewhere, but otherwise much faster. In other jumps nothing is counted.
    faults gets the jumps of each kind: how many, and where the first is.
    """
    t, counts = wheel.t, wheel.values
    steps = np.diff(counts)
    if not len(steps):
        return counts, ()
    whole = 2 * np.pi / wheels.turn
    size = _range(counts, whole)
    around = np.where(np.abs(steps) > size / 2, steps - np.sign(steps) * size, steps)
    overflows, unsure, jumps = _jumps(wheels, wheel, around, size)
    lost = unsure | jumps

    def tell(which: BoolArray, what: str, so: str) -> None:
        if which.any():
            first = int(np.argmax(which))
            place = f"from {counts[first]:.10g} to {counts[first + 1]:.10g} at t = {moment(float(t[first + 1]))}"
            faults.add(f"{wheel.where}: {what}, {times(int(which.sum()))} (first: {place}): {so}")

    kind = "begins each turn of the wheel anew" if size == whole else f"overflows, as it counts to {size:.0f}"
    tell(overflows, kind, "it is counted on")
    tell(unsure, "may have turned either way", "that time is left out")
    tell(jumps, "jumps, which is neither an overflow nor motion", "that time is left out")
    if lost.sum() > HICCUP_SHARE * len(lost):
        faults.add(
            f"{wheel.where}: it is too often not known what was counted: {lost.sum()} of {len(lost)}", fatal=True
        )
    moved = np.where(lost, 0.0, np.where(overflows, around, steps))
    return counts[0] + np.append(0.0, np.cumsum(moved)), tuple(
        (float(t[i]), float(t[i + 1])) for i in np.flatnonzero(lost)
    )


def _range(counts: FloatArray, whole: float) -> float:
    """Return the smallest range that holds all counts, from 0 or from minus its half; inf: there is none."""
    low, high = float(counts.min()), float(counts.max())
    for size in sorted({*_RANGES, whole}):
        slack = 1e-3 * size if size == whole else 0.0  # angles are rounded
        if (low >= -slack and high <= size + slack) or (low >= -size / 2 - slack and high <= size / 2 + slack):
            return size
    return float("inf")


def _jumps(wheels: Wheels, wheel: Wheel, around: FloatArray, size: float) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return which steps are overflows, which may have gone either way, and which are no motion, (n - 1,) each.

    around: the steps, or the shorter way past the end of the range.
    """
    counts = wheel.values
    steps, lasts = np.abs(np.diff(counts)), np.diff(wheel.t)
    usual = float(np.median(lasts))
    slow = np.maximum(lasts / usual, 1.0)
    over = steps > size / 2
    at_zero = np.minimum(np.abs(counts[:-1]), np.abs(counts[1:])) <= _NEAR * steps
    wild = steps * wheels.turn * wheels.radius > _FASTEST * usual * slow
    others = (steps / slow)[~(over | at_zero | wild)]
    least = max(float(others.max(initial=0.0)), min(_LEAST / wheels.turn, _LEAST_SHARE * size))
    may = _FASTER * slow * least
    possible = np.abs(around) <= may
    overflows = over & possible & (steps > may)
    unsure = over & possible & (steps <= may)
    if overflows.any():  # then any step may have gone around
        unsure |= ~over & (size - steps <= may)
    jumps = (over & ~possible & (steps > may)) | (at_zero & (steps > _ANEW * slow * least)) | wild
    return overflows, unsure, jumps & ~overflows & ~unsure


def read_wheels(path: Path, wheels: Wheels, faults: Faults) -> tuple[Series, Spans]:
    """Return the odometry of a bag's wheels, and spans [s] that are not known, as _odometry has them.

    Angles or ticks of joints are used where they are given, else rates. faults gets jumps of what is counted.
    Raise Error naming file, topic and joint.
    """
    said, counts = _joints(path, wheels) if wheels.topic else _topics(path, wheels)
    return _odometry(wheels, said, faults, counts=counts)


def _joints(path: Path, wheels: Wheels) -> tuple[list[Wheel], bool]:
    """Return the joints of the left and then the right side, and whether they say angles or ticks."""
    names = (*wheels.left, *wheels.right)
    seen: set[str] = set()
    topic = absolute(wheels.topic)

    def convert(message: Any) -> tuple[float, ...] | None:
        seen.update(message.name)
        return None if any(name not in message.name for name in names) else _of(message, names)

    def converter(kind: str) -> Any:
        if kind != JOINTS:
            raise Error(f"is of type {shown(kind)}, not of {shown(JOINTS)}")
        return convert

    found = read_topics(path, {topic: converter})
    if topic not in found:
        for name in names:
            if seen and name not in seen:
                raise Error(f"{path}: wheels: {topic} has no joint {name!r}; {hint(name, sorted(seen))}")
        raise Error(f"{path}: wheels: {topic} says nothing of the wheels: there is no such topic, or no message")
    t, rows = found[topic].times(), found[topic].rows()
    angles, rates = rows[:, : len(names)], rows[:, len(names) :]
    counts = bool(np.isfinite(angles).all())
    values = angles if counts else rates
    known = np.isfinite(values).all(axis=1) & np.r_[True, np.diff(t) > 0]
    return [Wheel(f"{path.name} wheels: {name}", t[known], values[known, i]) for i, name in enumerate(names)], counts


def _of(message: Any, names: Sequence[str]) -> tuple[float, ...]:
    """Return the angles of some joints, and then their rates, nan where they are not given."""
    places = [message.name.index(name) for name in names]
    given = [
        values if len(values) == len(message.name) else [math.nan] * len(message.name)
        for values in (message.position, message.velocity)
    ]
    return tuple(float(values[place]) for values in given for place in places)


def _topics(path: Path, wheels: Wheels) -> tuple[list[Wheel], bool]:
    """Return the topics of the left and then the right side, and whether they count ticks."""
    names = [absolute(name) for name in (*wheels.left, *wheels.right)]
    found = read_topics(path, dict.fromkeys(names, lambda _: lambda message: (float(message.data),)))
    for name in names:
        if name not in found:
            raise Error(f"{path}: wheels: there is no topic {name}; for joints of a JointState, say wheels.topic too")
    said = []
    for name in names:
        times, order = np.unique(found[name].times(), return_index=True)
        said.append(Wheel(f"{path.name} wheels: {name}", times, found[name].rows()[order, 0]))
    return said, wheels.ticks_per_turn is not None

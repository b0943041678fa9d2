# SPDX-License-Identifier: BSD-3-Clause
"""Odometry out of the wheels that a bag tells of: joints of a JointState, or a topic of a number for each wheel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.critic.bags.decoding import shown
from kurumaisu.critic.bags.topics import Topic, absolute, read_topics
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.counters import Spans, counted
from kurumaisu.critic.data.odometry import Wheels, driven_by
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.types import FloatArray

JOINTS = "sensor_msgs/msg/JointState"


@dataclass(frozen=True)
class _Wheel:
    """A joint or topic, and what it says (n,) at increasing times (n,) [s]."""

    name: str
    t: FloatArray
    values: FloatArray


def read_wheels(path: Path, wheels: Wheels, faults: Faults) -> tuple[FloatArray, FloatArray, Spans]:
    """Return times (n,) [s], rows (n, 5) of x, y, theta, v, w, beginning at 0, and spans [s] that are not known.

    Angles or ticks of joints are used where they are given, else rates. faults gets jumps of what is counted.
    Raise Error naming file, topic and joint.
    """
    said, counts = _joints(path, wheels) if wheels.topic else _topics(path, wheels)
    lost: set[tuple[float, float]] = set()
    for i, wheel in enumerate(said if counts else ()):
        values, spans = counted(wheels.counter(f"{path.name} wheels: {wheel.name}"), wheel.t, wheel.values, faults)
        said[i] = _Wheel(wheel.name, wheel.t, values)
        lost.update(spans)
    t = said[0].t
    at = np.array([np.interp(t, wheel.t, wheel.values) for wheel in said])
    lefts = len(wheels.left)
    sides = np.stack([at[:lefts].mean(axis=0), at[lefts:].mean(axis=0)], axis=1)
    if counts:
        return t, wheels.odometry(t, sides, tuple(sorted(lost))), tuple(sorted(lost))
    rates = wheels.motion(sides)
    return t, np.column_stack([driven_by(t, rates), rates]), ()


def _joints(path: Path, wheels: Wheels) -> tuple[list[_Wheel], bool]:
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
    return [_Wheel(name, t[known], values[known, i]) for i, name in enumerate(names)], counts


def _of(message: Any, names: Sequence[str]) -> tuple[float, ...]:
    """Return the angles of some joints, and then their rates, nan where they are not given."""
    places = [message.name.index(name) for name in names]
    given = [
        values if len(values) == len(message.name) else [math.nan] * len(message.name)
        for values in (message.position, message.velocity)
    ]
    return tuple(float(values[place]) for values in given for place in places)


def _topics(path: Path, wheels: Wheels) -> tuple[list[_Wheel], bool]:
    """Return the topics of the left and then the right side, and whether they count ticks."""
    names = [absolute(name) for name in (*wheels.left, *wheels.right)]
    found = read_topics(path, dict.fromkeys(names, _number))
    for name in names:
        if name not in found:
            raise Error(f"{path}: wheels: there is no topic {name}; for joints of a JointState, say wheels.topic too")
    return [_of_topic(name, found[name]) for name in names], wheels.ticks_per_turn is not None


def _number(kind: str) -> Any:
    def convert(message: Any) -> tuple[float]:
        return (float(message.data),)

    return convert


def _of_topic(name: str, topic: Topic) -> _Wheel:
    times, order = np.unique(topic.times(), return_index=True)
    return _Wheel(name, times, topic.rows()[order, 0])

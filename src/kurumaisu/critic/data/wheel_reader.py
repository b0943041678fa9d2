# SPDX-License-Identifier: BSD-3-Clause
"""Odometry out of the wheels that a bag tells of: joints of a JointState, or a topic of a rate for each wheel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.critic.bags.decoding import shown
from kurumaisu.critic.bags.topics import Topic, absolute, read_topics
from kurumaisu.critic.data.odometry import Wheels, along, driven_by, rates_between
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.types import FloatArray

JOINTS = "sensor_msgs/msg/JointState"


def read_wheels(path: Path, wheels: Wheels) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and rows (n, 5) of x, y, theta, v, w, beginning at 0.

    Angles of joints are used where they are given, else rates. Raise Error naming file, topic and joint.
    """
    t, left, right, angles = _joints(path, wheels) if wheels.topic else _rates(path, wheels)
    turned = np.stack([left, right], axis=1)
    known = np.isfinite(turned).all(axis=1) & np.r_[True, np.diff(t) > 0]
    t, turned = t[known], turned[known]
    if angles:
        poses = along(wheels.motion(np.diff(turned, axis=0)))
        return t, np.column_stack([poses, rates_between(t, poses)])
    rates = wheels.motion(turned)
    return t, np.column_stack([driven_by(t, rates), rates])


def _joints(path: Path, wheels: Wheels) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """Return times, what the left and the right wheels say, (n,) each, and whether these are angles."""
    seen: set[str] = set()
    topic = absolute(wheels.topic)

    def convert(message: Any) -> tuple[float, ...] | None:
        seen.update(message.name)
        sides = [_side(message, names) for names in (wheels.left, wheels.right)]
        return None if None in sides else tuple(value for side in sides if side is not None for value in side)

    def converter(kind: str) -> Any:
        if kind != JOINTS:
            raise Error(f"is of type {shown(kind)}, not of {shown(JOINTS)}")
        return convert

    found = read_topics(path, {topic: converter})
    if topic not in found:
        for name in (*wheels.left, *wheels.right):
            if seen and name not in seen:
                raise Error(f"{path}: wheels: {topic} has no joint {name!r}; {hint(name, sorted(seen))}")
        raise Error(f"{path}: wheels: {topic} says nothing of the wheels: there is no such topic, or no message")
    rows = found[topic].rows()
    angles = bool(np.isfinite(rows[:, [0, 2]]).all())
    left, right = (rows[:, [0, 2]] if angles else rows[:, [1, 3]]).T
    return found[topic].times(), left, right, angles


def _side(message: Any, names: Sequence[str]) -> tuple[float, float] | None:
    """Return the mean angle and rate of some joints, nan where they are not given; None where a joint is missing."""
    if any(name not in message.name for name in names):
        return None
    places = [message.name.index(name) for name in names]
    count = len(message.name)
    given = [values if len(values) == count else [math.nan] * count for values in (message.position, message.velocity)]
    angle, rate = (sum(float(values[place]) for place in places) / len(places) for values in given)
    return angle, rate


def _rates(path: Path, wheels: Wheels) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """Return times of the left wheel, both wheels' rates or angles there, and whether they are angles."""
    sides = [[absolute(name) for name in names] for names in (wheels.left, wheels.right)]
    found = read_topics(path, {name: _number for names in sides for name in names})
    for name in (name for names in sides for name in names if name not in found):
        raise Error(f"{path}: wheels: there is no topic {name}; for joints of a JointState, say wheels.topic too")
    t = found[sides[0][0]].times()
    left, right = (np.mean([_at(t, found[name]) for name in names], axis=0) for names in sides)
    return t, wheels.turn * left, wheels.turn * right, wheels.ticks_per_turn is not None


def _number(kind: str) -> Any:
    def convert(message: Any) -> tuple[float]:
        return (float(message.data),)

    return convert


def _at(t: FloatArray, topic: Topic) -> FloatArray:
    times, order = np.unique(topic.times(), return_index=True)
    return np.interp(t, times, topic.rows()[order, 0])

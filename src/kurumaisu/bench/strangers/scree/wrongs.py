# SPDX-License-Identifier: BSD-3-Clause
"""Recordings that are wrong as a whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Rng
from kurumaisu.bench.strangers.scree.recorded import Scans, Setup, Taken
from kurumaisu.bench.strangers.scree.rooms import draw_room
from kurumaisu.bench.strangers.scree.writing import Notes


@dataclass(frozen=True)
class Written:
    """What the owner writes down."""

    setup: Setup
    taken: list[Taken]
    notes: Notes


@dataclass(frozen=True)
class Wrong:
    """What is wrong, and whether it takes a laser."""

    sentence: str
    laser: bool
    spoil: Callable[[Written, Rng], Written]


def _poses(w: Written, change: Callable[[Array], Array]) -> Written:
    taken = [replace(t, poses=replace(t.poses, pose=np.round(change(t.poses.pose), 6))) for t in w.taken]
    return replace(w, taken=taken)


def _ranges(w: Written, change: Callable[[Array], Array]) -> Written:
    taken = [replace(t, scans=Scans(t.scans.t, change(t.scans.r))) for t in w.taken if t.scans is not None]
    return replace(w, taken=taken)


def _pose_of_another(w: Written, rng: Rng) -> Written:
    a, b = w.taken[0], w.taken[1]
    n = min(len(a.poses.t), len(b.poses.t))
    some = np.arange(n)
    swapped = replace(a.poses, t=a.poses.t[some], pose=b.poses.pose[some], good=a.poses.good[some])
    return replace(w, taken=[replace(a, poses=swapped), *w.taken[1:]])


def _twice(w: Written, rng: Rng) -> Written:
    first = w.taken[0]
    again = replace(first, drive=replace(first.drive, name=w.taken[1].drive.name))
    return replace(w, taken=[first, again, *w.taken[2:]])


def _mirrored_map(w: Written, rng: Rng) -> Written:
    room = w.setup.room
    boxes = tuple(replace(b, x=round(room.length - b.x, 4), turned=-b.turned) for b in room.boxes)
    return replace(w, setup=replace(w.setup, room=replace(room, boxes=boxes)))


def _other_map(w: Written, rng: Rng) -> Written:
    return replace(w, setup=replace(w.setup, room=draw_room(rng, w.setup.robot.v_top * 1.4)))


def _late(w: Written, rng: Rng) -> Written:
    by = float(np.round(rng.uniform(3, 8) * rng.choice([-1.0, 1.0]), 3))
    return replace(w, notes=replace(w.notes, command_late=by))


WRONGS = (
    Wrong("positions are in mm", False, lambda w, rng: _poses(w, lambda p: p * np.array([1e3, 1e3, 1.0]))),
    Wrong("headings are in degrees", False, lambda w, rng: _poses(w, lambda p: p * np.array([1, 1, 180 / np.pi]))),
    Wrong("x has the wrong sign", False, lambda w, rng: _poses(w, lambda p: p * np.array([-1.0, 1.0, 1.0]))),
    Wrong("x and y are swapped", False, lambda w, rng: _poses(w, lambda p: p[:, [1, 0, 2]])),
    Wrong("headings are clockwise", False, lambda w, rng: _poses(w, lambda p: p * np.array([1.0, 1.0, -1.0]))),
    Wrong("stamps of poses are in ms", False, lambda w, rng: replace(w, notes=replace(w.notes, pose_clock=1e3))),
    Wrong("the clock of the commands is some seconds off", False, _late),
    Wrong("poses of the first drive are those of another", False, _pose_of_another),
    Wrong("a drive is given twice", False, _twice),
    Wrong("ranges are in mm", True, lambda w, rng: _ranges(w, lambda r: r * 1e3)),
    Wrong("the fan is mirrored", True, lambda w, rng: _ranges(w, lambda r: r[:, ::-1])),
    Wrong("the map is mirrored", True, _mirrored_map),
    Wrong("the map is of another room", True, _other_map),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong as a whole: units, signs, axes, stamps, clocks, mix-ups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.bench.strangers.loess.recording import Tables
from kurumaisu.bench.strangers.loess.rooms import Room, draw_room

OF_POSES = (
    "positions are in mm",
    "headings are in degrees",
    "y of the poses has the wrong sign",
    "x and y of the poses are swapped",
    "headings are clockwise",
    "the stamps of the commands are in ms",
    "the clock of the commands is some seconds off",
    "yaw rates that were asked for have the wrong sign",
    "the poses of one drive are of another",
    "a drive is given twice",
)
OF_SCANS = ("ranges are in mm", "scans are mirrored", "the map is mirrored", "the map is of another room")


def _spoil_poses(t: Tables, what: str) -> None:
    pose = t.pose
    if what == OF_POSES[0]:
        pose[:, 1:3] *= 1000
    elif what == OF_POSES[1]:
        pose[:, 3] = np.degrees(pose[:, 3])
    elif what == OF_POSES[2]:
        pose[:, 2] *= -1
    elif what == OF_POSES[3]:
        pose[:, 1:3] = pose[:, 2:0:-1].copy()
    elif what == OF_POSES[4]:
        pose[:, 3] *= -1


def _spoil_commands(t: Tables, what: str, late: float) -> None:
    if what == OF_POSES[5]:
        t.command[:, 0] *= 1000
    elif what == OF_POSES[6]:
        t.command[:, 0] += late
    elif what == OF_POSES[7]:
        t.command[:, -1] *= -1
        if t.command.shape[1] == 5:
            t.command[:, 2] *= -1


def _spoil_scans(t: Tables, what: str) -> None:
    if what == OF_SCANS[0]:
        t.scan[:, 1:] *= 1000
    elif what == OF_SCANS[1]:
        t.scan[:, 1:] = t.scan[:, :0:-1].copy()


def _mix_up(tables: list[Tables], what: str) -> None:
    first, second = tables[0], tables[1]
    if what == OF_POSES[8]:
        moved, back = second.pose.copy(), first.pose.copy()
        moved[:, 0] += first.start - second.start
        back[:, 0] += second.start - first.start
        first.pose, second.pose = moved, back
    elif what == OF_POSES[9]:
        tables[1] = replace(first, name=second.name)


def spoil(tables: list[Tables], room: Room, laser: bool, rng: np.random.Generator) -> tuple[str, Room]:
    """Make one thing wrong in all tables, or in the map; a sentence that says what, and the map."""
    choices = [*OF_POSES, *(OF_SCANS if laser else ())]
    what = str(choices[int(rng.integers(len(choices)))])
    late = float(rng.choice([-1, 1]) * rng.uniform(3, 9))
    for t in tables:
        _spoil_poses(t, what)
        _spoil_commands(t, what, late)
        if laser:
            _spoil_scans(t, what)
    _mix_up(tables, what)
    if what == OF_SCANS[2]:
        boxes = tuple(replace(b, x=room.width - b.x, turn=-b.turn) for b in room.boxes)
        return what, replace(room, boxes=boxes)
    if what == OF_SCANS[3]:
        return what, draw_room(rng, False)
    return what, room

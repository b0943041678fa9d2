# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong, as a user would have to repair them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.moor.world import Array, Room

Table = dict[str, Array]


@dataclass
class Tables:
    """All that a recording says, before it is written."""

    drives: dict[str, dict[str, Table]]
    room: Room
    train: list[str]

    def each(self, part: str, change: Callable[[Table], None], only: bool = False) -> None:
        """Change a table in every drive, or only in the first."""
        for name, tables in self.drives.items():
            if part in tables and (not only or name == self.train[0]):
                change(tables[part])


@dataclass(frozen=True)
class Wrong:
    """What is wrong, in words, and how it came about."""

    words: str
    act: Callable[[Tables], None]
    scans: bool = False
    volts: bool | None = None


def times(factor: float, *names: str) -> Callable[[Table], None]:
    """Some columns in another unit."""
    return lambda table: table.update({n: table[n] * factor for n in names})


def swap(a: str, b: str) -> Callable[[Table], None]:
    """Two columns exchanged."""
    return lambda table: table.update({a: table[b], b: table[a]})


def give(t: Tables, part: str, source: str, target: str) -> None:
    """The table of one drive in another one, by its clock."""
    new = {k: v.copy() for k, v in t.drives[source][part].items()}
    new["t"] = new["t"] - new["t"][0] + t.drives[target][part]["t"][0]
    t.drives[target][part] = new


def copy_drive(t: Tables) -> None:
    """The second drive is the first once more."""
    t.drives[t.train[1]] = {k: {n: c.copy() for n, c in v.items()} for k, v in t.drives[t.train[0]].items()}


def mirror_fan(table: Table) -> None:
    """The beams in the opposite order."""
    beams = [k for k in table if k != "t"]
    table.update(dict(zip(beams, [table[k] for k in reversed(beams)], strict=True)))


def freeze(table: Table) -> None:
    """The reference stands still during a third of the drive."""
    n = table["t"].size
    for k in ("x", "y", "theta"):
        table[k][n // 3 : 2 * n // 3] = table[k][n // 3]


def mirror_map(t: Tables) -> None:
    """The map with left and right exchanged."""
    t.room = t.room.mirrored()


WRONGS = [
    Wrong("positions of the reference are in millimetres", lambda t: t.each("pose", times(1000, "x", "y"))),
    Wrong("positions of the reference are in centimetres", lambda t: t.each("pose", times(100, "x", "y"))),
    Wrong("headings of the reference are in degrees", lambda t: t.each("pose", times(180 / np.pi, "theta"))),
    Wrong("headings of the reference are clockwise", lambda t: t.each("pose", times(-1, "theta"))),
    Wrong("y of the reference has the wrong sign", lambda t: t.each("pose", times(-1, "y"))),
    Wrong("x and y of the reference are swapped", lambda t: t.each("pose", swap("x", "y"))),
    Wrong("yaw rates asked for have the wrong sign", lambda t: t.each("command", times(-1, "w")), volts=False),
    Wrong("speeds asked for are in km/h", lambda t: t.each("command", times(3.6, "v")), volts=False),
    Wrong("yaw rates asked for are in deg/s", lambda t: t.each("command", times(180 / np.pi, "w")), volts=False),
    Wrong("v and w asked for are swapped", lambda t: t.each("command", swap("v", "w")), volts=False),
    Wrong("voltages are in millivolts", lambda t: t.each("voltage", times(1000, "v_f", "v_s")), volts=True),
    Wrong("the clock of the reference is 7 s ahead in the first drive",
          lambda t: t.each("pose", lambda p: p.update(t=p["t"] + 7.0), True)),
    Wrong("times of the reference are in milliseconds", lambda t: t.each("pose", times(1000, "t"))),
    Wrong("poses of the second drive are those of the first", lambda t: give(t, "pose", t.train[0], t.train[1])),
    Wrong("the second drive is the first, given twice", copy_drive),
    Wrong("the reference stands still during a third of the first drive", lambda t: t.each("pose", freeze, True)),
    Wrong("the fan is mirrored: beams are in the opposite order", lambda t: t.each("scan", mirror_fan), scans=True),
    Wrong("ranges are in millimetres",
          lambda t: t.each("scan", lambda s: s.update({k: v * 1000 for k, v in s.items() if k != "t"})), scans=True),
    Wrong("the map is mirrored", mirror_map, scans=True),
    Wrong("scans of the first drive are stamped 4 s late",
          lambda t: t.each("scan", lambda s: s.update(t=s["t"] + 4.0), True),
          scans=True),
]  # fmt: skip

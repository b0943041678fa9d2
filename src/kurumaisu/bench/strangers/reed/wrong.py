# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong: units, signs, axes, clocks, scans, maps, copies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu.bench.strangers.reed.core import Array
from kurumaisu.bench.strangers.reed.write import Tables

Change = Callable[[Array], Array]


def _at(columns: list[int], factor: float) -> Change:
    """Some columns times a factor."""
    return lambda a: np.asarray(a * np.where(np.isin(np.arange(a.shape[1]), columns), factor, 1.0))


def _jump(a: Array) -> Array:
    """A clock that was set forward by 2.5 s in the middle."""
    a = a.copy()
    a[len(a) // 2 :, 0] += 2.5
    return a


def _late(seconds: float) -> Change:
    """A clock that is off."""
    return lambda a: np.asarray(a + np.eye(a.shape[1])[0] * seconds)


WRONG: list[tuple[str, str, Change | None]] = [
    ("positions are in millimetres", "pose", _at([1, 2], 1000.0)),
    ("headings are in degrees", "pose", _at([3], 57.29578)),
    ("y and nothing else has the wrong sign", "pose", _at([2], -1.0)),
    ("headings are clockwise", "pose", _at([3], -1.0)),
    ("x and y of the reference are swapped", "pose", lambda a: a[:, [0, 2, 1, 3]]),
    ("the clock of the reference is 4 s late", "pose", _late(4.0)),
    ("the clock of the reference jumps", "pose", _jump),
    ("speeds are in km/h", "command", _at([1], 3.6)),
    ("yaw rates are in deg/s", "command", _at([2], 57.29578)),
    ("the speed asked for has the wrong sign", "command", _at([1], -1.0)),
    ("v and w asked for are swapped", "command", lambda a: a[:, [0, 2, 1]]),
    ("the clock of the commands is 6 s early", "command", _late(-6.0)),
    ("scans are mirrored", "scan", lambda a: np.concatenate([a[:, :1], a[:, :0:-1]], axis=1)),
    ("ranges are in millimetres", "scan", lambda a: np.concatenate([a[:, :1], a[:, 1:] * 1000], axis=1)),
    (
        "beams are numbered from another one",
        "scan",
        lambda a: np.concatenate([a[:, :1], np.roll(a[:, 1:], 60, 1)], axis=1),
    ),
    ("the clock of the scans is 5 s late", "scan", _late(5.0)),
    ("the map is another room's", "world", None),
    ("the first drive has the poses of the second one", "copy", None),
]


def apply(which: tuple[str, str, Change | None], drives: dict[str, Tables]) -> None:
    """Make the tables wrong, in all drives alike."""
    _, part, change = which
    names = list(drives)
    if part == "copy":
        drives[names[0]]["pose"] = drives[names[1]]["pose"]
    for tables in drives.values():
        if change is not None and part in tables:
            header, rows = tables[part]
            tables[part] = (header, change(rows))

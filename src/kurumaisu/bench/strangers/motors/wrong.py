# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong: units, signs, axes, clocks, maps, copies."""

from __future__ import annotations

import numpy as np

from .drive import make_room
from .plant import Array
from .record import Recording

KINDS = (
    "positions in mm", "positions in cm", "headings in degrees", "compass headings", "headings clockwise",
    "x and y swapped",
    "x mirrored", "speeds in km/h", "yaw rates in degrees per second", "forward speed of the wrong sign",
    "v and w swapped",
    "clock of the reference off by seconds", "stamps in ms", "ranges in mm", "fan mirrored", "map of another room",
    "a run is another run again", "voltages in mV", "no return written as 65.533", "scans turned by 90 degrees",
)  # fmt: skip
SCANS = {
    "ranges in mm",
    "fan mirrored",
    "map of another room",
    "no return written as 65.533",
    "scans turned by 90 degrees",
}


def _pose(kind: str, a: Array) -> None:
    if kind == "positions in mm":
        a[:, 1:3] *= 1000
    elif kind == "positions in cm":
        a[:, 1:3] *= 100
    elif kind == "headings in degrees":
        a[:, 3] = np.degrees(a[:, 3])
    elif kind == "compass headings":
        a[:, 3] = (np.pi / 2 - a[:, 3]) % (2 * np.pi)
    elif kind == "headings clockwise":
        a[:, 3] = -a[:, 3]
    elif kind == "x and y swapped":
        a[:, 1:3] = a[:, [2, 1]]
    elif kind == "x mirrored":
        a[:, 1] = -a[:, 1]
    elif kind == "clock of the reference off by seconds":
        a[:, 0] += 4.0


def _command(kind: str, a: Array) -> None:
    if kind == "speeds in km/h":
        a[:, 1] *= 3.6
    elif kind == "yaw rates in degrees per second":
        a[:, 2] = np.degrees(a[:, 2])
    elif kind == "forward speed of the wrong sign":
        a[:, 1] = -a[:, 1]
    elif kind == "v and w swapped":
        a[:, 1:] = a[:, [2, 1]]


def _scan(kind: str, a: Array) -> None:
    if kind == "ranges in mm":
        a[:, 1:] *= 1000
    elif kind == "fan mirrored":
        a[:, 1:] = a[:, :0:-1].copy()
    elif kind == "no return written as 65.533":
        a[:, 1:][~np.isfinite(a[:, 1:])] = 65.533
    elif kind == "scans turned by 90 degrees":
        a[:, 1:] = np.roll(a[:, 1:], a.shape[1] * 90 // 240, axis=1)


def spoil(kind: str, rec: Recording, rng: np.random.Generator) -> None:
    """Make the data of a recording wrong in one way."""
    commands = {
        "speeds in km/h",
        "yaw rates in degrees per second",
        "forward speed of the wrong sign",
        "v and w swapped",
    }
    for one in rec.runs:
        _pose(kind, one["pose"][1])
        _command(kind, one["command"][1])
        if "scan" in one:
            _scan(kind, one["scan"][1])
        if kind in commands:  # voltages would contradict the commands
            one.pop("voltage", None)
        if kind == "voltages in mV" and "voltage" in one:
            one["voltage"][1][:, 1:] *= 1000
            one.pop("command")
        if kind == "stamps in ms":
            for name, (_, a) in one.items():
                a[:, : 2 if name == "query" else 1] *= 1000
    if kind == "a run is another run again":
        rec.runs[1] = {n: (h, a.copy()) for n, (h, a) in rec.runs[0].items()}
    if kind == "map of another room":
        room = make_room(rng)
        rec.world = room.text(room.boxes, False)

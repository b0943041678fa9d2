# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong, as a user would have to repair them."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.delta.core import Array, Setup
from kurumaisu.bench.strangers.delta.files import Tables

Drives = dict[str, Tables]


def scaled(part: str, columns: tuple[str, ...], factor: float) -> Callable[[Drives], None]:
    """Columns in another unit, or of the other sign."""

    def act(drives: Drives) -> None:
        """Multiply."""
        for tables in drives.values():
            if part in tables:
                header, data = tables[part]
                for i, name in enumerate(header):
                    if name in columns or (columns == ("r",) and i):
                        data[:, i] *= factor

    return act


def shifted(part: str, seconds: float) -> Callable[[Drives], None]:
    """A clock that is off."""

    def act(drives: Drives) -> None:
        """Shift."""
        for tables in drives.values():
            for t in range(1) if part in tables else ():
                tables[part][1][:, t] += seconds

    return act


def swapped(part: str, a: str, b: str) -> Callable[[Drives], None]:
    """Two columns in each other's place."""

    def act(drives: Drives) -> None:
        """Swap."""
        for tables in drives.values():
            if part in tables:
                header, data = tables[part]
                i, j = header.index(a), header.index(b)
                data[:, [i, j]] = data[:, [j, i]]

    return act


def changed(part: str, change: Callable[[Array], Array]) -> Callable[[Drives], None]:
    """A table whose numbers are changed as a whole."""

    def act(drives: Drives) -> None:
        """Change."""
        for tables in drives.values():
            if part in tables:
                tables[part] = (tables[part][0], change(tables[part][1]))

    return act


def of_others(drives: Drives) -> None:
    """Each drive has the poses of the next one, moved to its time."""
    names = list(drives)
    poses = [drives[n]["pose"][1].copy() for n in names]
    for i, name in enumerate(names[:-1]):
        other = poses[(i + 1) % (len(names) - 1)]
        other[:, 0] += poses[i][0, 0] - other[0, 0]
        drives[name]["pose"] = (drives[name]["pose"][0], other)


def twice(drives: Drives) -> None:
    """The second drive is the first once more, poses and all but the inputs."""
    names = list(drives)
    own = drives[names[1]]
    shift = own["pose"][1][0, 0] - drives[names[0]]["pose"][1][0, 0]
    for part in ("pose", "scan"):
        if part in own:
            data = drives[names[0]][part][1].copy()
            data[:, 0] += shift
            own[part] = (own[part][0], data)


def compass(data: Array) -> Array:
    """Headings of a compass: from north, clockwise."""
    data[:, 3] = np.mod(np.pi / 2 - data[:, 3], 2 * np.pi)
    return data


def stuck(data: Array) -> Array:
    """A tracker that repeats its last pose for half of the drive."""
    half = slice(len(data) // 3, len(data) * 4 // 5)
    data[half, 1:] = data[half.start, 1:]
    return data


def grid(data: Array) -> Array:
    """Positions written with one decimal of a metre."""
    data[:, 1:3] = np.round(data[:, 1:3] / 0.2) * 0.2
    return data


def mirrored(data: Array) -> Array:
    """Beams in the other order."""
    data[:, 1:] = data[:, :0:-1]
    return data


def options(setup: Setup) -> list[tuple[str, Callable[[Drives], None], dict[str, Any]]]:
    """What may be wrong: a sentence, the change, and what meta.yaml then says."""
    inputs = "voltage" if setup.volts else "command"
    none: dict[str, Any] = {}
    out = [
        ("positions are in millimetres", scaled("pose", ("x", "y"), 1000.0), none),
        ("positions are in centimetres", scaled("pose", ("x", "y"), 100.0), none),
        ("headings are in degrees", scaled("pose", ("theta",), 180 / np.pi), none),
        ("headings are clockwise", scaled("pose", ("theta",), -1.0), none),
        ("y of the reference has the wrong sign (a left-handed frame)", scaled("pose", ("y",), -1.0), none),
        ("x and y of the reference are swapped", swapped("pose", "x", "y"), none),
        ("headings are those of a compass", changed("pose", compass), none),
        ("the reference repeats one pose for half of each drive", changed("pose", stuck), none),
        ("positions lie on a grid of 0.2 m", changed("pose", grid), none),
        ("the reference's clock is 7 s ahead of the commands' clock", shifted("pose", 7.0), none),
        ("the reference's clock is 0.8 s behind: the chair moves before its command", shifted("pose", -0.8), none),
        ("the times of the reference are in milliseconds", scaled("pose", ("t",), 1000.0), none),
        ("the reference's stamps are of another day", shifted("pose", 86400.0 * 3), none),
        ("the drives have each other's poses", of_others, none),
        ("the second drive has the poses and scans of the first", twice, none),
    ]
    if setup.volts:
        out += [
            ("voltages are in millivolts", scaled("voltage", ("v_f", "v_s"), 1000.0), none),
            ("the two voltages are swapped", swapped("voltage", "v_f", "v_s"), none),
            (
                "voltages contain the reference of 2.5 V",
                changed("voltage", lambda d: np.add(d, [0, 2.5, 2.5, 0, 0])),
                none,
            ),
        ]
    else:
        out += [
            ("the command's yaw rate has the wrong sign", scaled(inputs, ("w",), -1.0), none),
            ("v and w of the command are swapped", swapped(inputs, "v", "w"), none),
            ("the command's yaw rate is in degrees per second", scaled(inputs, ("w",), 180 / np.pi), none),
            ("the command's speed is in km/h", scaled(inputs, ("v",), 3.6), none),
            ("the command's speed has the wrong sign", scaled(inputs, ("v",), -1.0), none),
        ]
    if setup.scans:
        fan = setup.fan
        other = {"angle_increment": fan.increment * 0.6, "angle_min": -0.6 * fan.beams * fan.increment / 2}
        out += [
            ("the fan is mirrored", changed("scan", mirrored), none),
            ("ranges are in millimetres", scaled("scan", ("r",), 1000.0), none),
            ("the scans' clock is 6 s behind", shifted("scan", -6.0), none),
            ("the laser is said to have another fan", lambda drives: None, {"laser": other}),
            (
                "the laser is said to point forward but is turned by a quarter",
                lambda drives: None,
                {"laser": {"yaw": 1.5708}},
            ),
            ("the map is that of another room", lambda drives: None, {"map": "other"}),
            ("the map is turned by half a turn", lambda drives: None, {"map": "turned"}),
            ("the map is in another scale, 1.25 times as large", lambda drives: None, {"map": "scaled"}),
        ]
    return out

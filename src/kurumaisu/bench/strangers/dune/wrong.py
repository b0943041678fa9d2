# SPDX-License-Identifier: BSD-3-Clause
"""Ways in which data are wrong, one to a function; each changes a recording that was right."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .record import Recording, wrap
from .world import make_room

Fault = Callable[[Recording, np.random.Generator], None]


def scaled(name: str, columns: tuple[str, ...], factor: float) -> Fault:
    """Another unit, or another sign."""

    def fault(r: Recording, rng: np.random.Generator) -> None:
        for tables in r.runs:
            for c in columns:
                if name in tables and c in tables[name]:
                    tables[name][c] = tables[name][c] * factor

    return fault


def both(*faults: Fault) -> Fault:
    """One fault after the other."""

    def fault(r: Recording, rng: np.random.Generator) -> None:
        for f in faults:
            f(r, rng)

    return fault


def _no_voltages(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs:
        tables.pop("voltage", None)


def swapped(name: str, a: str, b: str) -> Fault:
    """Two columns of a table changed places."""

    def fault(r: Recording, rng: np.random.Generator) -> None:
        for tables in r.runs:
            if name in tables:
                tables[name][a], tables[name][b] = tables[name][b], tables[name][a]

    return fault


def _compass(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs:
        tables["pose"]["theta"] = (np.pi / 2 - tables["pose"]["theta"]) % (2 * np.pi)


def _clock(r: Recording, rng: np.random.Generator) -> None:
    late = float(rng.choice([-1, 1])) * rng.uniform(3, 8)
    for tables in r.runs:
        tables["pose"]["t"] = np.round(tables["pose"]["t"] + late, 6)


def _another_map(r: Recording, rng: np.random.Generator) -> None:
    r.world = make_room(rng, False).stage()


def _mirrored_map(r: Recording, rng: np.random.Generator) -> None:
    lines = []
    for line in r.world.splitlines():
        w = line.split()
        k = w.index("[") + 1
        w[k], w[k + 3] = f"{-float(w[k]):.4f}", f"{-float(w[k + 3]):.4f}"
        lines.append(" ".join(w))
    r.world = "\n".join(lines) + "\n"


def _mirrored_fan(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs:
        s = tables["scan"]
        names = [c for c in s if c != "t"]
        tables["scan"] = {"t": s["t"], **{a: s[b] for a, b in zip(names, names[::-1], strict=True)}}


def _range_mm(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs:
        tables["scan"] = {c: x if c == "t" else x * 1000 for c, x in tables["scan"].items()}


def _again(r: Recording, rng: np.random.Generator) -> None:
    """The poses of run 2 are those of run 1, with new times."""
    a, b = r.runs[0]["pose"], r.runs[1]["pose"]
    start, end = b["t"][0], b["t"][-1]
    t = np.round(a["t"] - a["t"][0] + start, 6)
    keep = t <= end
    r.runs[1]["pose"] = {c: (t if c == "t" else x)[keep] for c, x in a.items()}


def _frozen(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs[:3]:
        p = tables["pose"]
        k = int(rng.uniform(0.3, 0.5) * len(p["t"]))
        for c in ("x", "y", "theta"):
            p[c][k:] = p[c][k]


def _off_travel(r: Recording, rng: np.random.Generator) -> None:
    for tables in r.runs:
        tables["pose"]["theta"] = wrap(tables["pose"]["theta"] + np.radians(40))


XY = ("x", "y")
WRONG: list[tuple[str, Fault, bool]] = [  # what, how, whether scans are needed
    ("positions in mm", scaled("pose", XY, 1000.0), False),
    ("headings in degrees", scaled("pose", ("theta",), float(np.degrees(1))), False),
    ("heading clockwise", scaled("pose", ("theta",), -1.0), False),
    ("another map", _another_map, True),
    ("clock of the poses off by seconds", _clock, False),
    ("x and y swapped", swapped("pose", "x", "y"), False),
    ("compass heading", _compass, False),
    ("the fan is mirrored", _mirrored_fan, True),
    (
        "v and w swapped",
        both(swapped("command", "v", "w"), _no_voltages),
        False,
    ),
    ("stamps of the poses in ms", scaled("pose", ("t",), 1000.0), False),
    ("a run is another run again", _again, False),
    ("ranges in mm", _range_mm, True),
    ("speeds in km/h", both(scaled("command", ("v",), 3.6), _no_voltages), False),
    ("sign of w", both(scaled("command", ("w",), -1.0), _no_voltages), False),
    ("the map is mirrored", _mirrored_map, True),
    ("poses stand still while the chair drives", _frozen, False),
    ("positions in cm", scaled("pose", XY, 100.0), False),
    ("voltages in mV", scaled("voltage", ("v_f", "v_s"), 1000.0), False),
    ("heading off the direction of travel by 40 deg", _off_travel, False),
    ("y of the wrong sign", scaled("pose", ("y",), -1.0), False),
]

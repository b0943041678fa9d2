# SPDX-License-Identifier: BSD-3-Clause
"""Wrong data: what goes wrong in a lab between the robot and the files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .room import draw_room
from .values import Array


@dataclass
class Table:
    """One file."""

    head: list[str]
    rows: Array


@dataclass
class Files:
    """All files of a recording, before they are written."""

    runs: dict[str, dict[str, Table]]
    world: str = ""
    seed: int = 0
    extra: dict[str, str] = field(default_factory=dict)


def _column(f: Files, part: str, names: str, change: Callable[[Array], Array]) -> None:
    for run in f.runs.values():
        if part in run:
            for name in names.split():
                k = run[part].head.index(name)
                run[part].rows[:, k] = change(run[part].rows[:, k])


def _command(f: Files, names: str, change: Callable[[Array], Array]) -> None:
    """Commands are all that says what was asked for: no voltages beside them."""
    for run in f.runs.values():
        run.pop("voltage", None)
    _column(f, "command", names, change)


def _swap(f: Files, part: str, a: str, b: str) -> None:
    for run in f.runs.values():
        if part in run:
            t = run[part]
            i, j = t.head.index(a), t.head.index(b)
            t.rows[:, [i, j]] = t.rows[:, [j, i]]


def _swap_command(f: Files) -> None:
    _command(f, "v", lambda c: c)
    _swap(f, "command", "v", "w")


def _repeat(f: Files) -> None:
    """The poses of run_1 lie in run_2's folder, with its stamps moved to that run."""
    a, b = f.runs["run_1"]["pose"], f.runs["run_2"]["pose"]
    rows = a.rows.copy()
    rows[:, 0] += b.rows[0, 0] - a.rows[0, 0]
    f.runs["run_2"]["pose"] = Table(list(a.head), rows)


def _mirror(f: Files) -> None:
    for run in f.runs.values():
        if "scan" in run:
            run["scan"].rows[:, 1:] = run["scan"].rows[:, :0:-1].copy()


def _millimetres(f: Files) -> None:
    for run in f.runs.values():
        if "scan" in run:
            run["scan"].rows[:, 1:] *= 1000.0


def _map(f: Files) -> None:
    from .room import world_text

    other = draw_room(np.random.default_rng([5, f.seed]), False)
    f.world = world_text(replace(other, boxes=other.boxes + np.array([0.8, 0.5, 0.0, 0.0, 0.0])))


def _volts(f: Files) -> None:
    for run in f.runs.values():
        run["voltage"].head, run["voltage"].rows = ["t", "v_f", "v_s"], run["voltage"].rows[:, :3]
        run["voltage"].rows[:, 1:] *= 1000.0
        run.pop("command", None)


def _freeze(f: Files) -> None:
    for run in f.runs.values():
        rows = run["pose"].rows
        rows[len(rows) // 4 :, 1:] = rows[len(rows) // 4, 1:]


FAULTS: dict[str, tuple[Callable[[Files], None], bool]] = {
    "positions in mm": (lambda f: _column(f, "pose", "x y", lambda c: 1000.0 * c), False),
    "positions in cm": (lambda f: _column(f, "pose", "x y", lambda c: 100.0 * c), False),
    "headings in degrees": (lambda f: _column(f, "pose", "theta", lambda c: np.degrees(c) % 360.0), False),
    "headings clockwise": (lambda f: _column(f, "pose", "theta", lambda c: -c), False),
    "compass headings": (lambda f: _column(f, "pose", "theta", lambda c: (np.pi / 2 - c) % (2 * np.pi)), False),
    "x and y swapped": (lambda f: _swap(f, "pose", "x", "y"), False),
    "y of the wrong sign": (lambda f: _column(f, "pose", "y", lambda c: -c), False),
    "speeds in mm/s": (lambda f: _command(f, "v", lambda c: 1000.0 * c), False),
    "yaw rates in degrees/s": (lambda f: _command(f, "w", np.degrees), False),
    "v of the wrong sign": (lambda f: _command(f, "v", lambda c: -c), False),
    "v and w swapped": (_swap_command, False),
    "poses stamped 3 s early": (lambda f: _column(f, "pose", "t", lambda c: c - 3.0), False),
    "poses stamped 4 s late": (lambda f: _column(f, "pose", "t", lambda c: c + 4.0), False),
    "pose stamps in ms": (lambda f: _column(f, "pose", "t", lambda c: 1000.0 * c), False),
    "run_2 has the poses of run_1": (_repeat, False),
    "fan mirrored": (_mirror, True),
    "ranges in mm": (_millimetres, True),
    "map of another room": (_map, True),
    "voltages in mV": (_volts, False),
    "poses stand still": (_freeze, False),
}

# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong as a whole."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from kurumaisu.bench.strangers.quay.things import Rng

Files = dict[str, list[str]]
Change = Callable[[float], float]
ALWAYS = ("mm", "deg", "sign_x", "sign_w", "swap", "clockwise", "ms", "clock", "other", "twice")
WITH_LASER = ("range_mm", "map_mirror", "fan", "map", "scan_clock")


def _thousandfold(x: float) -> float:
    return x * 1000


def _negative(x: float) -> float:
    return -x


COLUMNS: dict[str, tuple[str, tuple[str, ...], Change, str]] = {  # way: file, columns, change, sentence
    "mm": ("pose.csv", ("x", "y"), _thousandfold, "positions of the reference are in mm"),
    "deg": ("pose.csv", ("theta",), np.degrees, "headings of the reference are in degrees"),
    "sign_x": ("pose.csv", ("x",), _negative, "x of the reference has the wrong sign"),
    "sign_w": ("asked", ("v_s", "w"), _negative, "the yaw rates asked for have the wrong sign"),
    "clockwise": ("pose.csv", ("theta",), _negative, "headings of the reference are clockwise"),
    "ms": ("", ("t", "t0", "t1"), _thousandfold, "all stamps are in ms"),
    "range_mm": ("scan.csv", ("r",), _thousandfold, "ranges are in mm"),
}


def _rewrite(files: Files, suffix: str, row: Callable[[list[str], list[str]], list[str]]) -> None:
    """Rewrite the rows of all tables of a name, of any name if it is empty; row: by header and cells."""
    for path, rows in files.items():
        if path.endswith(suffix) and path.endswith(".csv"):
            head = rows[0].split(",")
            rows[1:] = [",".join(row(head, r.split(","))) for r in rows[1:]]


def _change(files: Files, suffix: str, columns: tuple[str, ...], f: Change) -> None:
    """Change columns; r stands for those of all beams."""

    def cell(name: str, text: str) -> str:
        if name in columns:
            return f"{f(float(text)):.6f}".rstrip("0").rstrip(".")
        return f"{f(float(text)):.4f}" if name[0] == "r" and "r" in columns else text

    _rewrite(files, suffix, lambda head, cells: [cell(n, c) for n, c in zip(head, cells, strict=True)])


def _shift_rows(files: Files, names: list[str]) -> None:
    """Give each file the rows of the next, from its own first stamp on."""
    rows = [files[name] for name in names]
    for name, own, new in zip(names, rows, rows[1:] + rows[:1], strict=True):
        t0, start = float(new[1].split(",")[0]), float(own[1].split(",")[0])
        cells = [row.split(",", 1) for row in new[1:]]
        files[name] = new[:1] + [f"{float(t) - t0 + start:.6f},{rest}" for t, rest in cells]


def _new_map(files: Files, mirrored: bool) -> None:
    def place(m: re.Match[str]) -> str:
        x, y, a = float(m[1]), float(m[2]), float(m[3])
        if mirrored:
            return f"pose [{-x} {y} 0 {-a}]"
        return f"pose [{round(0.55 * y + 0.9 * x + 0.7, 3)} {round(1.3 * y - 0.2 * x - 0.5, 3)} 0 {a + 20}]"

    text = "\n".join(files["room.world"])
    files["room.world"] = re.sub(r"pose \[(\S+) (\S+) 0 (\S+)\]", place, text).split("\n")


def spoil(rng: Rng, files: Files, runs: list[str], laser: bool) -> str:
    """Make the files wrong in one way; return the sentence that says which."""
    ways = ALWAYS + WITH_LASER if laser else ALWAYS
    way = ways[int(rng.integers(len(ways)))]
    asked = "voltage.csv" if any(k.endswith("voltage.csv") for k in files) else "command.csv"
    if way in COLUMNS:
        name, columns, change, sentence = COLUMNS[way]
        _change(files, asked if name == "asked" else name, columns, change)
        return sentence
    if way == "swap":
        _rewrite(files, "pose.csv", lambda head, cells: [cells[0], cells[2], cells[1], *cells[3:]])
        return "x and y of the reference are swapped"
    if way in ("clock", "scan_clock"):
        d = float(rng.uniform(2.5, 6)) * (1 if rng.random() < 0.5 else -1)
        name = asked if way == "clock" else "scan.csv"
        _change(files, name, ("t",), lambda x: x + d)
        return f"the clock of {name} is {d:.1f} s off"
    if way == "other":
        _shift_rows(files, [f"{run}/{asked}" for run in runs])
        return "the poses are of another drive than the commands"
    if way == "twice":
        for name in [k for k in files if k.startswith(runs[0] + "/")]:
            files[name.replace(runs[0], runs[1])] = list(files[name])
        return "a drive is given twice, under two names"
    if way == "fan":
        _rewrite(files, "scan.csv", lambda head, cells: [cells[0], *cells[:0:-1]])
        return "the fan is mirrored: beams come in the other order"
    _new_map(files, way == "map_mirror")
    return "the map is mirrored" if way == "map_mirror" else "the map is another room's"

# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong as a whole."""

import re
from collections.abc import Callable

import numpy as np

Files = dict[str, list[str]]


def _column(files: Files, suffix: str, name: str, f: Callable[[float], float]) -> None:
    """Change a column of all files of a name; names that end in * stand for all that begin so."""
    for path, rows in files.items():
        if not path.endswith("/" + suffix):
            continue
        head = rows[0].split(",")
        at = [i for i, h in enumerate(head) if h == name or (name[-1] == "*" and h.startswith(name[:-1]))]
        for k in range(1, len(rows)):
            c = rows[k].split(",")
            for i in at:
                c[i] = f"{f(float(c[i])):.6f}".rstrip("0").rstrip(".") if name != "r*" else f"{f(float(c[i])):.4f}"
            rows[k] = ",".join(c)


def _swap(files: Files, suffix: str, a: str, b: str) -> None:
    for path, rows in files.items():
        if path.endswith("/" + suffix):
            head = rows[0].split(",")
            i, j = head.index(a), head.index(b)
            for k in range(1, len(rows)):
                c = rows[k].split(",")
                c[i], c[j] = c[j], c[i]
                rows[k] = ",".join(c)


def spoil(rng: np.random.Generator, files: Files, runs: list[str], laser: bool) -> str:
    """Make the files wrong in one way; the sentence that says which."""
    volts = any(k.endswith("voltage.csv") for k in files)
    ways = ["mm", "deg", "sign_x", "sign_w", "swap", "clockwise", "ms", "clock", "other", "twice"]
    ways += ["range_mm", "map_mirror", "fan", "map", "scan_clock"] if laser else []
    way = ways[int(rng.integers(len(ways)))]
    asked = "voltage.csv" if volts else "command.csv"
    if way == "mm":
        for c in "xy":
            _column(files, "pose.csv", c, lambda x: x * 1000)
        return "positions of the reference are in mm"
    if way == "deg":
        _column(files, "pose.csv", "theta", np.degrees)
        return "headings of the reference are in degrees"
    if way == "sign_x":
        _column(files, "pose.csv", "x", lambda x: -x)
        return "x of the reference has the wrong sign"
    if way == "sign_w":
        _column(files, asked, "v_s" if volts else "w", lambda x: -x)
        if volts:
            _column(files, asked, "w", lambda x: -x)
        return "the yaw rates asked for have the wrong sign"
    if way == "swap":
        _swap(files, "pose.csv", "x", "y")
        return "x and y of the reference are swapped"
    if way == "clockwise":
        _column(files, "pose.csv", "theta", lambda x: -x)
        return "headings of the reference are clockwise"
    if way == "ms":
        for c in ("t", "t0", "t1"):
            for name in (asked, "pose.csv", "scan.csv", "covariate.csv", "query.csv"):
                _column(files, name, c, lambda x: x * 1000)
        return "all stamps are in ms"
    if way in ("clock", "scan_clock"):
        d = float(rng.uniform(2.5, 6)) * (1 if rng.random() < 0.5 else -1)
        name = asked if way == "clock" else "scan.csv"
        _column(files, name, "t", lambda x: x + d)
        return f"the clock of {name} is {d:.1f} s off"
    if way == "other":
        parts = [(r, files[f"{r}/{asked}"]) for r in runs]
        for k, (r, _) in enumerate(parts):
            rows = parts[(k + 1) % len(parts)][1]
            t0, own = float(rows[1].split(",")[0]), float(parts[k][1][1].split(",")[0])
            files[f"{r}/{asked}"] = rows[:1] + [
                f"{float(x.split(',')[0]) - t0 + own:.6f}," + x.split(",", 1)[1] for x in rows[1:]
            ]
        return "the poses are of another drive than the commands"
    if way == "twice":
        for name in [k for k in files if k.startswith(runs[0] + "/")]:
            files[name.replace(runs[0], runs[1])] = list(files[name])
        return "a drive is given twice, under two names"
    if way == "range_mm":
        _column(files, "scan.csv", "r*", lambda x: x * 1000)
        return "ranges are in mm"
    if way == "fan":
        for path, rows in files.items():
            if path.endswith("scan.csv"):
                rows[1:] = [",".join([r.split(",")[0], *r.split(",")[:0:-1]]) for r in rows[1:]]
        return "the fan is mirrored: beams come in the other order"
    text = "\n".join(files["room.world"])

    def place(m: re.Match[str]) -> str:
        x, y, a = float(m[1]), float(m[2]), float(m[3])
        if way == "map_mirror":
            return f"pose [{-x} {y} 0 {-a}]"
        return f"pose [{round(0.55 * y + 0.9 * x + 0.7, 3)} {round(1.3 * y - 0.2 * x - 0.5, 3)} 0 {a + 20}]"

    files["room.world"] = re.sub(r"pose \[(\S+) (\S+) 0 (\S+)\]", place, text).split("\n")
    return "the map is mirrored" if way == "map_mirror" else "the map is another room's"

# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong."""

from __future__ import annotations

import numpy as np

from .judge import Case
from .plant import Arr
from .rooms import furnish

Tables = list[dict[str, tuple[list[str], Arr]]]


def spoil(rng: np.random.Generator, c: Case, tabs: Tables, what: str) -> None:
    """Make data wrong, in the runs to fit and the test alike."""
    if what == "a run is another run again":
        tabs[1]["pose"] = (tabs[0]["pose"][0], tabs[0]["pose"][1].copy())
        return
    if what == "another map":
        c.room = furnish(rng)
        return
    for tab in tabs:
        for name, (cols, a) in tab.items():
            i = {k: j for j, k in enumerate(cols)}
            _pose(what, a, i) if name == "pose" else _scan(what, a) if name == "scan" else _input(what, name, a, i)
        if "command" in what or what in ("voltages in mV", "speeds in km/h"):
            for name in {"voltages in mV": ("command", "odom")}.get(what, ("voltage", "odom")):
                tab.pop(name, None)
            if what == "voltages in mV":
                tab["voltage"] = (tab["voltage"][0][:3], tab["voltage"][1][:3])


def _pose(what: str, a: Arr, i: dict[str, int]) -> None:
    x, y, th = i["x"], i["y"], i["theta"]
    if what in ("positions in mm", "positions in cm"):
        a[[x, y]] *= 1000 if "mm" in what else 100
    elif what == "headings in degrees":
        a[th] = np.degrees(a[th])
    elif what == "x and y of the poses swapped":
        a[[x, y]] = a[[y, x]]
    elif what == "compass headings":
        a[th] = np.pi / 2 - a[th]
    elif what == "clock of the poses off by seconds":
        a[0] += 4.0
    elif what == "stamps of the poses in ms":
        a[0] *= 1000
    elif what == "y of the wrong sign":
        a[y] *= -1
    elif what == "headings folded to half a turn":
        a[th] = a[th] % np.pi


def _scan(what: str, a: Arr) -> None:
    if what == "fan mirrored":
        a[1:] = a[:0:-1]
    elif what == "ranges in mm":
        a[1:] *= 1000
    elif what == "clock of the scans off by seconds":
        a[0] += 3.0


def _input(what: str, name: str, a: Arr, i: dict[str, int]) -> None:
    if name == "voltage" and what == "voltages in mV":
        a[[i["v_f"], i["v_s"]]] *= 1000
    if name != "command":
        return
    if what in ("yaw command of the wrong sign", "yaw command in degrees"):
        a[i["w"]] *= -1 if "sign" in what else 180 / np.pi
    elif what in ("speed command of the wrong sign", "speeds in km/h"):
        a[i["v"]] *= -1 if "sign" in what else 3.6
    elif what == "command columns swapped":
        a[[1, 2]] = a[[2, 1]]

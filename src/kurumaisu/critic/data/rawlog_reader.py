# SPDX-License-Identifier: BSD-3-Clause
"""Read a run from an MRPT rawlog: odometry and scans, no commands, no reference pose."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np

from kurumaisu.critic.data.clean import Faults, Table, clean
from kurumaisu.critic.data.odometry import COLUMNS, rates_between
from kurumaisu.critic.values.recording import LaserMount, Run
from kurumaisu.types import FloatArray


def is_rawlog(path: Path) -> bool:
    """Tell by its name whether a file is a rawlog, packed or not."""
    return path.is_file() and (path.suffix == ".rawlog" or path.name.endswith(".rawlog.gz"))


def rawlog_name(path: Path) -> str:
    """Return the name of a rawlog's run."""
    return path.name.split(".")[0]


def read_rawlog_run(path: Path, faults: Faults) -> tuple[Run, LaserMount]:
    """Read a rawlog: the run, and the mounting and fan of its laser. Raise Error where MRPT cannot, or is not."""
    log = import_module("kurumaisu.slam").read_rawlog(path)
    run = to_run(rawlog_name(path), log.times, log.odom, np.asarray(log.ranges, dtype=np.float64), faults)
    x, y, yaw = log.fan.base_from_laser
    return run, LaserMount(x, y, yaw, log.fan.angle_min, log.fan.angle_increment, log.ranges.shape[1])


def to_run(name: str, t: FloatArray, odom: FloatArray, ranges: FloatArray, faults: Faults) -> Run:
    """Return a run from times of scans (n,) [s], odometry poses there (n, 3) and ranges (n, beams) [m].

    The rates of a row are those of the interval that ends there; the first row's are those of the second.
    """
    rows = np.column_stack([odom, rates_between(t, odom)])
    beams = tuple(f"r{i}" for i in range(ranges.shape[1]))
    return Run(
        name=name,
        odom=clean(Table(f"{name} odometry", t, rows, COLUMNS, "entry", 1), faults),
        scan=clean(Table(f"{name} scans", t, ranges, beams, "entry", 1), faults, ranges=True),
    )

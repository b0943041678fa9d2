# SPDX-License-Identifier: BSD-3-Clause
"""Read a run from an MRPT rawlog: odometry and scans, no commands, no reference pose."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np

from kurumaisu.bounded_files import MOST_RAWLOG, check_file
from kurumaisu.critic.data.clean import Faults, Table, clean
from kurumaisu.critic.data.odometry import COLUMNS, rates_between
from kurumaisu.critic.values.recording import LaserMount, Run
from kurumaisu.errors import Error, one_line
from kurumaisu.types import FloatArray


def is_rawlog(path: Path) -> bool:
    """Tell by its name whether a file is a rawlog, packed or not."""
    return path.is_file() and (path.suffix == ".rawlog" or path.name.endswith(".rawlog.gz"))


def rawlog_name(path: Path) -> str:
    """Return the name of a rawlog's run."""
    return path.name.split(".")[0]


def read_rawlog_run(path: Path, faults: Faults) -> tuple[Run, LaserMount]:
    """Read a rawlog: the run, and the mounting and fan of its laser. Raise Error for what MRPT cannot read."""
    check_file(path, MOST_RAWLOG)
    try:
        t, odom, ranges, fan = import_module("kurumaisu._slam").read_rawlog(str(path))
    except ImportError as error:
        raise Error(f"{path}: this build cannot read rawlogs: {error}") from error
    except (OSError, RuntimeError, ValueError) as error:
        raise Error(one_line(error)) from error  # it names the file
    run = to_run(rawlog_name(path), t, odom, np.asarray(ranges, dtype=np.float64), faults)
    x, y, yaw = fan.base_from_laser
    return run, LaserMount(x, y, yaw, fan.angle_min, fan.angle_increment, ranges.shape[1])


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

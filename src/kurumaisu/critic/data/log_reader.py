# SPDX-License-Identifier: BSD-3-Clause
"""Read a run from a log of CARMEN, or an MRPT rawlog: odometry, scans, and a simulator's true pose, but no commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import numpy as np

from kurumaisu import geometry
from kurumaisu.bounded_files import MOST_TABLE, read_text
from kurumaisu.critic.data.clean import Faults, Table, clean
from kurumaisu.critic.data.odometry import COLUMNS
from kurumaisu.critic.values.recording import Fan, LaserMount, Run, Series
from kurumaisu.errors import Error, told

SUFFIXES = (".clf", ".log")
_TAIL = 3  # cells at the end of each line: when it was measured, by which computer, when it was written
_FAR = 81.0  # [m] readings above are a SICK's words for no return, where the log does not state the laser's range
_FIRST = ("# CARMEN", "PARAM ", "ODOM ", "FLASER ", "ROBOTLASER1 ", "SYNC ", "# message_name")
_HEAD = 4096  # [bytes] in which one of them must begin a line


@dataclass
class _Log:
    """Rows that begin with t [s], as they come; fan: of the scans, mount: of the laser on the robot."""

    odom: list[list[float]] = field(default_factory=list)
    beside: list[list[float]] = field(default_factory=list)  # odometry that scans carry
    pose: list[list[float]] = field(default_factory=list)
    scan: list[list[float]] = field(default_factory=list)
    fan: Fan | None = None
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    others: int = 0  # scans of another number of beams


def is_carmen(path: Path) -> bool:
    """Tell whether a file is a log of CARMEN: .clf, or a .log that begins as one."""
    if not path.is_file() or path.suffix not in SUFFIXES:
        return False
    if path.suffix == ".clf":
        return True
    with path.open("rb") as file:
        head = file.read(_HEAD).decode("utf-8", "replace")
    return any(line.startswith(_FIRST) for line in head.splitlines())


def read_carmen_run(path: Path, faults: Faults) -> tuple[Run, LaserMount | None]:
    """Return the run of a log, and how its laser is mounted. Raise Error naming file and line for what cannot be read.

    FLASER is taken to see half a turn, ROBOTLASER1 says what it sees; other lines are not read.
    """
    log = _Log()
    for number, line in enumerate(read_text(path, MOST_TABLE).splitlines(), 1):
        kind, _, rest = line.partition(" ")
        read = _KINDS.get(kind)
        if read is None:
            continue
        try:
            cells = rest.split()
            read(log, float(cells[-_TAIL]), cells[:-_TAIL])
        except (ValueError, IndexError):
            raise Error(f"{path}:{number}: is not a line of {kind}: {told(line)}") from None
    if log.others:
        faults.add(f"{path.name}: {log.others} scans dropped: they have other beams than the first")
    columns = COLUMNS if log.odom else COLUMNS[:3]
    beams = tuple(f"r{i}" for i in range(log.fan.beams if log.fan else 0))
    run = Run(
        name=path.stem,
        pose=_series(f"{path.name} TRUEPOS", log.pose, COLUMNS[:3], faults),
        odom=_series(f"{path.name} ODOM", log.odom or log.beside, columns, faults),
        scan=_series(f"{path.name} laser", log.scan, beams, faults),
        fan=log.fan,
    )
    if log.fan is None:
        return run, None
    return run, LaserMount(*log.mount, log.fan.angle_min, log.fan.angle_increment, log.fan.beams)


def _series(where: str, rows: list[list[float]], columns: tuple[str, ...], faults: Faults) -> Series | None:
    if not rows:
        return None
    table = np.array(rows, dtype=np.float64)
    return clean(Table(where, table[:, 0], table[:, 1:], columns, "line", 1), faults, ranges=columns[0] == "r0")


def _odom(log: _Log, t: float, cells: Sequence[str]) -> None:
    x, y, theta, v, w, _ = map(float, cells)
    log.odom.append([t, x, y, theta, v, w])


def _true(log: _Log, t: float, cells: Sequence[str]) -> None:
    x, y, theta, *_ = (float(cell) for cell in cells[:6])
    log.pose.append([t, x, y, theta])


def _front(log: _Log, t: float, cells: Sequence[str]) -> None:
    """FLASER: count, ranges, pose of the laser or one made better, and of the odometry."""
    count = int(cells[0])
    x, y, theta = map(float, cells[count + 4 : count + 7])
    log.beside.append([t, x, y, theta])
    # A SICK's 180 readings and its 181 are a degree apart.
    _scan(log, t, cells[1 : count + 1], Fan(-math.pi / 2, math.pi / max(count - count % 2, 1), count, 0.0, 0.0), _FAR)


def _robot_laser(log: _Log, t: float, cells: Sequence[str]) -> None:
    """ROBOTLASER1: kind, fan, count, ranges, count of remissions, remissions, poses of laser and robot, rates."""
    start, _, step, farthest = map(float, cells[1:5])
    count = int(cells[7])
    after = 9 + count + int(cells[8 + count])
    laser, robot = (np.array([float(cell) for cell in cells[i : i + 3]]) for i in (after, after + 3))
    if log.fan is None:
        x, y, theta = geometry.between(robot, laser)
        log.mount = float(x), float(y), float(geometry.wrap(theta))
    log.beside.append([t, *robot.tolist()])
    _scan(log, t, cells[8 : 8 + count], Fan(start, step, count, 0.0, 0.0), farthest)


def _scan(log: _Log, t: float, cells: Sequence[str], fan: Fan, farthest: float) -> None:
    ranges = [float(cell) for cell in cells]
    if len(ranges) != fan.beams or not ranges:
        raise ValueError
    log.fan = log.fan or fan
    if fan != log.fan:
        log.others += 1
        return
    log.scan.append([t, *(math.inf if reading >= farthest else reading for reading in ranges)])


_KINDS: dict[str, Callable[[_Log, float, Sequence[str]], None]] = {
    "ODOM": _odom,
    "TRUEPOS": _true,
    "FLASER": _front,
    "ROBOTLASER1": _robot_laser,
}


def is_rawlog(path: Path) -> bool:
    """Tell by its name whether a file is a rawlog, packed or not."""
    return path.is_file() and (path.suffix == ".rawlog" or path.name.endswith(".rawlog.gz"))


def rawlog_name(path: Path) -> str:
    """Return the name of a rawlog's run."""
    return path.name.split(".")[0]


def read_rawlog_run(path: Path, faults: Faults) -> tuple[Run, LaserMount]:
    """Read a rawlog: the run, and the mounting and fan of its laser. Raise Error where MRPT cannot, or is not."""
    log = import_module("kurumaisu.slam").read_rawlog(path)
    where, ranges = rawlog_name(path), np.asarray(log.ranges, dtype=np.float64)
    beams = tuple(f"r{i}" for i in range(ranges.shape[1]))
    run = Run(
        name=where,
        odom=clean(Table(f"{where} odometry", log.times, log.odom, COLUMNS[:3], "entry", 1), faults),
        scan=clean(Table(f"{where} scans", log.times, ranges, beams, "entry", 1), faults, ranges=True),
    )
    x, y, yaw = log.fan.base_from_laser
    return run, LaserMount(x, y, yaw, log.fan.angle_min, log.fan.angle_increment, len(beams))

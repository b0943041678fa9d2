# SPDX-License-Identifier: BSD-3-Clause
"""Mapping of a whole log at once: scans and odometry in, trajectory and map out.

Where the package was built without MRPT, importing this raises Error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kurumaisu import settings
from kurumaisu.bounded_files import MOST_RAWLOG, check_file
from kurumaisu.errors import Error, one_line
from kurumaisu.geometry import interpolate
from kurumaisu.maps import Grid
from kurumaisu.types import FloatArray

try:
    import kurumaisu._slam as _slam
    from kurumaisu._slam import Fan as Fan
except ImportError as error:
    needed = "needs MRPT, which is not in the wheel: install the ROS package (docs/without_ros.md)"
    raise Error(f"SLAM {needed}: {error}") from error

MapperSettings = dict[str, float]


@dataclass(frozen=True)
class ScanLog:
    """Scans of one drive, with the odometry that belongs to them.

    times: (n,) of the first beams, increasing [s]; ranges: (n, beams) [m], inf = no return, NaN = nothing is
    known; odom, odom_end: odom_from_base (n, 3) [m, m, rad] at the first and at the last beam of each scan.
    """

    name: str
    times: FloatArray
    ranges: NDArray[np.float32]
    odom: FloatArray
    odom_end: FloatArray
    fan: Fan


@dataclass(frozen=True)
class MappingResult:
    """What mapping gives.

    trajectory: map_from_base at every scan, (n, 4) of t [s], x, y [m], theta [rad, unwrapped]; the path of
    the likeliest particle in the light of the whole log, so fit as a reference for the drive.
    nodes: the same where the filter ran, (m, 10), with the covariance of the particles around it: xx, xy, yy, xt,
    yt, tt.
    """

    trajectory: FloatArray
    grid: Grid
    nodes: FloatArray


@dataclass(frozen=True)
class Start:
    """A simplemap to go on from, and where the chair is in it: pose (3,) [m, m, rad], with its deviations (3,)."""

    path: Path
    pose: FloatArray
    deviations: FloatArray


def load_mapping_settings(path: Path) -> MapperSettings:
    """Read the mapper's settings from a settings file of mapping_node.

    Raise Error naming file and key for anything missing, unknown or senseless.
    """
    top = settings.load(path)
    top.section("node")  # read, and checked, by mapping_node
    section = top.section("mapper")
    top.end()
    values = {name: section.number(name) for name in _slam.setting_names()}
    section.end()
    try:
        _slam.check_settings(values)
    except ValueError as error:
        raise Error(f"{path}: mapper.{error}") from error
    return values


def scan_log(
    name: str,
    times: FloatArray,
    ranges: NDArray[np.float32],
    fan: Fan,
    odom_times: FloatArray,
    odom: FloatArray,
) -> ScanLog:
    """Join scans with a series of odometry: odom_times (m,) [s], odom_from_base (m, 3), theta unwrapped.

    Scans (or parts of them) outside the odometry's time are dropped. Raise Error when none is left.
    """
    ends = times + fan.time_increment * (ranges.shape[1] - 1)
    first, last = np.minimum(times, ends), np.maximum(times, ends)
    inside = (first >= odom_times[0]) & (last <= odom_times[-1]) if len(odom_times) else times < times
    if not inside.any():
        raise Error(f"{name}: no scan lies within the time of the odometry")
    return ScanLog(
        name=name,
        times=times[inside],
        ranges=ranges[inside],
        odom=interpolate(odom_times, odom, times[inside]),
        odom_end=interpolate(odom_times, odom, ends[inside]),
        fan=fan,
    )


def read_rawlog(path: Path) -> ScanLog:
    """Read a recording of MRPT. Raise Error naming the file and what is wrong with it.

    Rawlogs say neither when a beam was taken nor how the chair moved meanwhile.
    """
    check_file(path, MOST_RAWLOG)
    try:
        times, odom, ranges, fan = _slam.read_rawlog(str(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise Error(one_line(error)) from error  # it names the file
    return ScanLog(path.name, times, ranges, odom, odom, fan)


def write_rawlog(log: ScanLog, path: Path) -> None:
    """Write a log for MRPT's own programs. Raise Error naming the file.

    Rawlogs cannot say when a beam was taken, so each scan is moved to where it would have been taken at once.
    """
    try:
        _slam.write_rawlog(str(path), log.times, log.odom, log.odom_end, log.ranges, log.fan)
    except RuntimeError as error:
        raise Error(str(error)) from error


def map_scans(
    mapper_settings: MapperSettings,
    log: ScanLog,
    seed: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
    start: Start | None = None,
    simplemap: Path | None = None,
) -> MappingResult:
    """Map a log, or go on from a map; progress is called with the number of scans done and the total.

    simplemap: MRPT's simplemap is written there. Equal arguments give equal results, bit by bit. Raise Error naming
    the log and the scan that makes no sense, the map that cannot be gone on from, or the file that cannot be written.
    """
    try:
        mapper = _slam.Mapper(mapper_settings, seed)
        if start is not None:
            mapper.resume(str(start.path), mapper_settings, start.pose.tolist(), start.deviations.tolist())
    except (RuntimeError, ValueError) as error:
        raise Error(f"mapper: {error}") from error
    total = len(log.times)
    for i in range(total):
        try:
            mapper.add(float(log.times[i]), log.ranges[i], log.fan, log.odom[i].tolist(), log.odom_end[i].tolist())
        except ValueError as error:
            raise Error(f"{log.name}: scan {i}: {error}") from error
        progress(i + 1, total)
    trajectory = mapper.trajectory()
    trajectory[:, 3] = np.unwrap(trajectory[:, 3])
    cells, resolution, (x, y) = mapper.grid()
    if simplemap is not None:
        try:
            mapper.write_simplemap(str(simplemap))
        except RuntimeError as error:
            raise Error(str(error)) from error
    return MappingResult(trajectory, Grid(cells, resolution, x, y), mapper.nodes())

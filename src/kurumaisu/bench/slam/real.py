# SPDX-License-Identifier: BSD-3-Clause
"""Real recordings through our mapper and gmapping: pictures, and how sharp the maps are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kurumaisu import slam
from kurumaisu.bench.peers import Run
from kurumaisu.bench.slam import peers
from kurumaisu.bench.slam.ours import ours
from kurumaisu.bench.slam.sharpness import sharpness
from kurumaisu.bench.table import Table
from kurumaisu.maps import Grid, picture
from kurumaisu.real import mines, sena
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

SENA = sena.FOLDER / sena.LOG
_URG_RANGE = 5.6  # [m]
_TURN = 0.1 / 1024  # [s] from beam to beam
_LATE = 0.2  # [s] that its scans come late, as scripts/real mines finds by hand


def real_logs(recordings: Path | None) -> Iterator[ScanLog]:
    """Yield SENA, which Debian has, and with the folder of the other recordings the rover of Mines."""
    if SENA.exists():
        yield slam.read_rawlog(SENA)
    if recordings is not None:
        yield _mines(recordings)


def _mines(recordings: Path) -> ScanLog:
    log = mines.load(recordings)
    fan = slam.Fan(
        angle_min=mines.ANGLE_MIN,
        angle_increment=float(mines.INCREMENT),
        time_increment=_TURN,
        range_max=_URG_RANGE,
        base_from_laser=(mines.AHEAD, 0.0, 0.0),
    )
    odom = mines.odometry(log, mines.READINGS["plain"])
    return slam.scan_log("mines", log.t - _LATE, log.ranges.astype(np.float32), fan, log.t, odom[:, 1:4])


def real(recordings: Path | None, peer: peers.Peer | None, folder: Path, pictures: Path | None) -> None:
    """Print how sharp the maps are and draw them."""
    columns = ("walls [m]", "double walls [%]", "entropy [bit]", "CPU [ms/scan]", "memory [MiB]")
    table = Table("real recordings", "log, mapper", *columns)
    for log in real_logs(recordings):
        name = log.name[-20:]
        run, poses, grid = ours(log, 1, folder)
        _row(table, f"{name}, ours", run, poses, grid, log, pictures)
        if peer is not None:
            run, poses, grid = peers.gmapping(peer, log, 1)
            _row(table, f"{name}, gmapping", run, poses, grid, log, pictures)


def _row(table: Table, name: str, run: Run, poses: FloatArray, grid: Grid, log: ScanLog, pictures: Path | None) -> None:
    sharp = sharpness(grid)
    cpu = 1000 * run.cpu / len(log.times)
    table.row(name, sharp.thickness, 100 * sharp.double, sharp.entropy, cpu, run.memory)
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        path = pictures / f"{name.replace(', ', '-').replace(' ', '_')}.png"
        write_whole({path: picture(grid, np.column_stack([log.times, poses]))})

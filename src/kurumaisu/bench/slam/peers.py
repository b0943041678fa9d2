# SPDX-License-Identifier: BSD-3-Clause
"""gmapping and AMCL, built elsewhere, as peers of a benchmark: a log in, poses, map and costs out."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.peers import DRIVERS, Run, read_run
from kurumaisu.errors import Error
from kurumaisu.geometry import between, compose, wrap
from kurumaisu.map_file import MapFile
from kurumaisu.maps import Grid
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray

_RANGE_MIN = 0.06  # [m] of a URG-04LX

# slam_gmapping's own defaults; extent: half the edge of the map it begins with [m].
GMAPPING: Mapping[str, float] = {
    "particles": 30,
    "sigma": 0.05,
    "kernelSize": 1,
    "lstep": 0.05,
    "astep": 0.05,
    "iterations": 5,
    "lsigma": 0.075,
    "ogain": 3.0,
    "lskip": 0,
    "srr": 0.1,
    "srt": 0.2,
    "str": 0.1,
    "stt": 0.2,
    "linearUpdate": 1.0,
    "angularUpdate": 0.5,
    "temporalUpdate": -1.0,
    "resampleThreshold": 0.5,
    "minimumScore": 0,
    "delta": 0.05,
    "extent": 100,
    "occ_thresh": 0.25,
    "llsamplerange": 0.01,
    "llsamplestep": 0.01,
    "lasamplerange": 0.005,
    "lasamplestep": 0.005,
}

# amcl's own defaults.
AMCL: Mapping[str, float | str] = {
    "laser_max_beams": 30,
    "laser_z_hit": 0.95,
    "laser_z_rand": 0.05,
    "laser_sigma_hit": 0.2,
    "laser_likelihood_max_dist": 2.0,
    "odom_model_type": "diff",
    "odom_alpha1": 0.2,
    "odom_alpha2": 0.2,
    "odom_alpha3": 0.2,
    "odom_alpha4": 0.2,
    "update_min_d": 0.2,
    "update_min_a": np.pi / 6,
    "resample_interval": 2,
    "min_particles": 100,
    "max_particles": 5000,
    "kld_err": 0.01,
    "kld_z": 0.99,
    "recovery_alpha_slow": 0.001,
    "recovery_alpha_fast": 0.1,
}

# As a user of this chair might set it: weighed more often, by more beams; a steady share of noise in the odometry.
AMCL_TUNED: Mapping[str, float | str] = {
    **AMCL,
    "laser_max_beams": 60,
    "laser_sigma_hit": 0.1,
    "odom_model_type": "diff-corrected",
    "odom_alpha1": 0.1,
    "odom_alpha2": 0.05,
    "odom_alpha3": 0.1,
    "odom_alpha4": 0.01,
    "update_min_d": 0.1,
    "update_min_a": 0.1,
    "resample_interval": 1,
    "kld_err": 0.05,
}


@dataclass(frozen=True)
class Peer:
    """A driver of ours, compiled against a peer's libraries; it works in a folder."""

    program: Path
    folder: Path

    @classmethod
    def compiled(cls, name: str, prefix: Path, libraries: Sequence[str], folder: Path) -> Peer:
        """Compile drivers/<name>.cpp. Raise Error with the compiler's words if that fails."""
        program = folder / name
        include, search = prefix / "include", prefix / "lib"
        command = [
            "g++",
            "-O2",
            "-w",
            "-std=c++17",
            f"-I{include}",
            f"-I{include / name}",
            str(DRIVERS / f"{name}.cpp"),
        ]
        _call(
            [
                *command,
                f"-L{search}",
                *(f"-l{library}" for library in libraries),
                f"-Wl,-rpath,{search}",
                "-o",
                str(program),
            ]
        )
        return cls(program, folder)

    def run(self, log: ScanLog, settings: Mapping[str, float | str]) -> tuple[Run, FloatArray]:
        """Run over a log. Return its costs and poses (n, 3) of base, NaN where it has none. Raise Error if it fails."""
        given, taken = self.folder / "log", self.folder / "poses"
        write_log(log, given)
        words = [word for key, value in settings.items() for word in (key, str(value))]
        text = _call([str(self.program), "log", str(given), "poses", str(taken), *words])
        return read_run(text), np.fromfile(taken).reshape(-1, 3)


def gmapping(peer: Peer, log: ScanLog, seed: int) -> tuple[Run, FloatArray, Grid]:
    """Map a log. Return costs, the best particle's poses (n, 3) at all scans, and its map."""
    taken = peer.folder / "map"
    run, nodes = peer.run(log, {**GMAPPING, "seed": seed, "map": str(taken)})
    values = np.fromfile(taken)
    width, height, resolution, x, y = values[:5]
    cells = values[5:].astype(np.int8).reshape(int(height), int(width))
    return run, _between_nodes(nodes, log.odom), _cut(Grid(cells, resolution, x, y))


def amcl(
    peer: Peer,
    log: ScanLog,
    grid: MapFile,
    settings: Mapping[str, float | str],
    start: FloatArray,
    sd: FloatArray,
    seed: int,
) -> tuple[Run, FloatArray]:
    """Localise a log from a start (3,) of deviations sd (3,). Return costs and poses (n, 3) at all scans."""
    given = peer.folder / "map"
    height, width = grid.cells.shape
    header = [width, height, grid.resolution, *grid.origin[:2]]
    np.concatenate([header, grid.cells.astype(np.float64).ravel()]).tofile(given)
    keys = ("x", "y", "a", "cov_xx", "cov_yy", "cov_aa")
    first = dict(zip(keys, [*start, *(sd**2)], strict=True))
    return peer.run(log, {**settings, **first, "map": str(given), "seed": seed})


def write_log(log: ScanLog, path: Path) -> None:
    """Write a log as the drivers read it: one with readings as they are."""
    fan = log.fan
    header = [log.ranges.shape[1], fan.angle_min, fan.angle_increment, _RANGE_MIN, fan.range_max, *fan.base_from_laser]
    rows = np.column_stack([log.times, log.odom, log.ranges.astype(np.float64)])
    with path.open("wb") as file:
        np.array(header, dtype=np.float64).tofile(file)
        rows.tofile(file)


def _between_nodes(nodes: FloatArray, odom: FloatArray) -> FloatArray:
    """Fill poses (n, 3) between those that are known: odometry, with what it misses spread over the scans."""
    known = np.flatnonzero(np.isfinite(nodes[:, 0]))
    if len(known) == 0:
        raise Error("the peer gave no pose")
    out = nodes.copy()
    for here, there in zip(known, [*known[1:], len(nodes)], strict=True):
        motion = between(np.broadcast_to(odom[here], odom[here:there].shape), odom[here:there])
        out[here:there] = compose(np.broadcast_to(nodes[here], motion.shape), motion)
        if there < len(nodes):
            gap = between(compose(nodes[here], between(odom[here], odom[there])), nodes[there])
            gap[2] = wrap(gap[2])
            share = np.arange(there - here)[:, None] / (there - here)
            out[here:there] = compose(out[here:there], share * gap)
    return out


def _cut(grid: Grid) -> Grid:
    """Return what has been seen of a map."""
    rows, columns = np.flatnonzero((grid.cells >= 0).any(axis=1)), np.flatnonzero((grid.cells >= 0).any(axis=0))
    if len(rows) == 0:
        return grid
    cells = grid.cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return Grid(cells, grid.resolution, grid.x + columns[0] * grid.resolution, grid.y + rows[0] * grid.resolution)


def _call(command: Sequence[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Error(f"{' '.join(command)}: returned {done.returncode}: {done.stderr[-1000:]}")
    return done.stdout

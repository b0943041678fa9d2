# SPDX-License-Identifier: BSD-3-Clause
"""Recordings with the truth through our mapper and localiser and those of others, next to what was asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import slam_score
from kurumaisu.bench.peers import Run
from kurumaisu.bench.slam import peers
from kurumaisu.bench.slam.models import START_SD
from kurumaisu.bench.slam.ours import ours
from kurumaisu.bench.table import Table
from kurumaisu.geometry import compose
from kurumaisu.localization import LocalizerSettings, localize_scans, make_localizer
from kurumaisu.map_file import MapFile
from kurumaisu.maps import Grid
from kurumaisu.params import load_model, shipped
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray

_WALL = 65  # [%]

Logs = Sequence[tuple[str, ScanLog, FloatArray]]
Mapping = Callable[[ScanLog, int], tuple[Run, FloatArray, Grid]]


@dataclass(frozen=True)
class Judged:
    """A row of the table of bounds: a figure, floor, aim, what peers have, and 'kept', 'reached' or 'BROKEN'."""

    name: str
    value: str
    floor: str
    aim: str
    peers: str
    state: str


@dataclass(frozen=True)
class Bound:
    """What a figure may be at most, and what is aimed at."""

    name: str
    floor: float
    aim: float

    def judged(self, value: float, peers: str = "-") -> Judged:
        """Return the row of a figure."""
        state = "reached" if value <= self.aim else ("kept" if value <= self.floor else "BROKEN")
        return Judged(self.name, f"{value:.3g}", f"{self.floor:g}", f"{self.aim:g}", peers, state)


_MEDIAN, _WORST = Bound("mapping, median [m]", 0.12, 0.08), Bound("mapping, worst [m]", 0.25, 0.12)
_CPU, _MEMORY = Bound("mapping, CPU [ms/scan]", 3.0, 1.0), Bound("mapping, peak memory [MiB]", 300, 150)
_MAPPED = ((_MEDIAN, 0, np.median), (_WORST, 0, np.max), (_CPU, 3, np.median), (_MEMORY, 4, np.max))  # columns
_FOLLOWED = (  # in the order of the logs: commands, encoders, bad odometry
    Bound("localisation by commands, median [m]", 0.06, 0.04),
    Bound("localisation by encoders, median [m]", 0.046, 0.03),
    Bound("localisation by bad odometry, median [m]", 0.08, 0.05),
)
_FOLLOWED_CPU = Bound("localisation, CPU [ms/scan]", 0.5, 0.2)


def mapping(
    logs: Logs, truth_grid: MapFile, seeds: int, peer: peers.Peer | None, peer_seeds: int, folder: Path
) -> list[Judged]:
    """Print errors and costs of all logs; return what became of the bounds, which are of the first log.

    gmapping, which takes a minute for a log, has the first one only.
    """
    table = Table(
        f"mapping, {seeds} seeds ({peer_seeds} of gmapping): median (worst)",
        "log, mapper",
        "position [m]   ",
        "heading [deg]  ",
        "map to wall [m]",
        "CPU [ms/scan]  ",
        "memory [MiB]",
        page=False,
    )
    all_figures = []
    for name, log, truth in logs:
        figures = _mapped(lambda log, seed: ours(log, seed, folder), log, truth, truth_grid, seeds)
        table.row(f"{name}, ours", *_cells(figures))
        all_figures.append(figures)
    others = None
    if peer is not None:
        theirs, (name, log, truth) = peer, logs[0]
        others = _mapped(lambda log, seed: peers.gmapping(theirs, log, seed), log, truth, truth_grid, peer_seeds)
        table.row(f"{name}, gmapping", *_cells(others))
    return [
        bound.judged(
            float(of(all_figures[0][:, column])),
            "-" if others is None else f"gmapping {of(others[:, column]):.3g}",
        )
        for bound, column, of in _MAPPED
    ]


def _mapped(mapper: Mapping, log: ScanLog, truth: FloatArray, truth_grid: MapFile, seeds: int) -> FloatArray:
    rows = []
    for seed in range(1, seeds + 1):
        run, poses, grid = mapper(log, seed)
        position, heading = slam_score.trajectory_error(poses, truth)
        wall = _to_walls(grid, slam_score.align(poses, truth), truth_grid)
        rows.append((position, np.degrees(heading), wall, 1000 * run.cpu / len(log.times), run.memory))
    return np.array(rows)


def _to_walls(grid: Grid, truth_from_map: FloatArray, truth: MapFile) -> float:
    """Return the mean distance [m] of a map's wall cells to the nearest of the truth's."""
    from scipy.spatial import cKDTree

    rows, columns = np.nonzero(truth.cells > _WALL)
    walls = np.array(truth.origin[:2]) + (np.column_stack([columns, rows]) + 0.5) * truth.resolution
    rows, columns = np.nonzero(grid.cells > _WALL)
    at = np.column_stack([columns, rows]) + 0.5
    points = np.column_stack([np.array([grid.x, grid.y]) + at * grid.resolution, np.zeros(len(at))])
    moved = compose(np.broadcast_to(truth_from_map, points.shape), points)[:, :2]
    return float(np.mean(cKDTree(walls).query(moved)[0]))


def localisation(
    logs: Logs, grid: MapFile, settings: LocalizerSettings, seeds: int, peer: peers.Peer | None
) -> list[Judged]:
    """Print errors and costs of all logs; return what became of the bounds."""
    table = Table(
        f"localisation in the true map, {seeds} seeds: median (worst)",
        "log, localiser",
        "position [m]   ",
        "largest [m]    ",
        "CPU [ms/scan]  ",
        "memory [MiB]",
        page=False,
    )
    judged: list[Judged] = []
    slowest = 0.0
    for (name, log, truth), bound in zip(logs, _FOLLOWED, strict=False):
        figures = np.array([_followed(log, truth, grid, settings, seed) for seed in range(1, seeds + 1)])
        table.row(f"{name}, ours", *_cells(figures), "-")
        slowest = max(slowest, float(np.median(figures[:, 2])))
        compared = list[str]()
        manners = (("AMCL, defaults", peers.AMCL), ("AMCL, tuned", peers.AMCL_TUNED))
        for manner, theirs in manners if peer is not None else ():
            assert peer is not None
            rows = []
            for seed in range(1, seeds + 1):
                run, poses = peers.amcl(peer, log, grid, theirs, _start(truth, seed), START_SD, seed)
                rows.append((*_off(poses, truth), 1000 * run.cpu / len(log.times), run.memory))
            table.row(f"{name}, {manner}", *_cells(np.array(rows)))
            compared.append(f"{manner} {np.median(np.array(rows)[:, 0]):.3g}")
        judged.append(bound.judged(float(np.median(figures[:, 0])), "; ".join(compared) or "-"))
    return [*judged, _FOLLOWED_CPU.judged(slowest)]


def _start(truth: FloatArray, seed: int) -> FloatArray:
    return compose(truth[0], np.random.default_rng(seed).normal(0, START_SD))


def _followed(
    log: ScanLog, truth: FloatArray, grid: MapFile, settings: LocalizerSettings, seed: int
) -> tuple[float, float, float]:
    error = load_model(shipped("launch/md100.yaml")).laser.error
    localizer = make_localizer(settings, error, grid, seed)
    localizer.set_pose(_start(truth, seed).tolist(), np.diag(START_SD**2))
    begin = time.process_time()
    found = localize_scans(localizer, log)
    cpu = 1000 * (time.process_time() - begin) / len(log.times)
    return (*_off(found.poses, truth), cpu)


def _off(poses: FloatArray, truth: FloatArray) -> tuple[float, float]:
    off = np.hypot(*(poses - truth)[:, :2].T)
    return float(np.sqrt(np.mean(off**2))), float(off.max())


def _cells(figures: FloatArray) -> tuple[str, ...]:
    """Return median (worst) of every column."""
    return tuple(f"{np.median(column):.3g} ({column.max():.3g})" for column in figures.T)

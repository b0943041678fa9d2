# SPDX-License-Identifier: BSD-3-Clause
"""Localisation in known maps: following, finding oneself from nowhere, and noticing that one was carried away."""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu import slam
from kurumaisu._core import LaserError
from kurumaisu.bench.slam.lost import carried_away, from_nowhere
from kurumaisu.bench.slam.main import drive
from kurumaisu.bench.slam.models import START_SD
from kurumaisu.bench.slam.office_bags import office_logs
from kurumaisu.bench.table import Table
from kurumaisu.geometry import compose, wrap
from kurumaisu.localization import (
    NO_PROCESS_NOISE,
    Localizer,
    LocalizerSettings,
    load_localizer_settings,
    localize_scans,
    make_localizer,
)
from kurumaisu.map_file import MapFile, read_map
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.settings import with_effects
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world


@dataclass(frozen=True)
class Drive:
    """A log with the truth (n, 3) at its scans and what is known beforehand."""

    log: slam.ScanLog
    truth: FloatArray
    grid: MapFile
    laser: LaserError
    process: tuple[float, float, float, float] = NO_PROCESS_NOISE


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; those of the office need its recordings."""
    parser = argparse.ArgumentParser(prog="scripts/bench slam_localise", description=__doc__)
    parser.add_argument("office", type=Path, nargs="?", help="folder of bags with ground_truth, and truth_map.yaml")
    parser.add_argument("--mount", type=float, nargs=3, default=[0.25, 0.0, 0.0], help="base_from_laser in the office")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--kidnaps", type=int, default=10)
    parser.add_argument("--only", choices=("building", "office", "lost"), help="one of the tables")
    options = parser.parse_args(arguments)
    if options.office is None and options.only in ("office", "lost"):
        parser.error(f"--only {options.only} needs the folder of the office")
    settings = load_localizer_settings(shipped("launch/localization_node.yaml"))
    columns = ("position [m]     ", "largest [m]     ", "heading [deg]    ", "sure and wrong", "CPU [ms/scan]   ")
    tables = []
    if options.only in (None, "building"):
        tables.append(_building(settings, options.seeds, columns))
    if options.office is not None and options.only != "building":
        error = load_model(shipped("launch/md100.yaml")).laser.error
        grid = read_map(options.office / "truth_map.yaml")
        drives = {n: Drive(log, truth, grid, error) for n, log, truth in office_logs(options.office, options.mount)}
        if options.only != "lost":
            tables.append(_office(drives, settings, options.seeds, columns))
        if options.only != "office":
            tables.append(_lost(drives, settings, options.starts, options.kidnaps))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    tables[-1].note(f"Peak memory of the process, Python and logs included: {peak:.0f} MiB.")
    return 0


def _building(settings: LocalizerSettings, seeds: int, columns: Sequence[str]) -> Table:
    world = load_world(shipped("worlds/building.world"))
    model = with_effects(load_model(shipped("launch/md100.yaml")), shipped("launch/uneven_floor.yaml"))
    grid = read_map(shipped("worlds/maps/building.yaml"))
    noise = model.effects[-1].parameters
    process = (noise["sd_v"], noise["sd_w"], noise["tau"], noise["growth"])
    error = model.laser.error
    rounds = [drive(world, seed, 240.0) for seed in range(1, seeds + 1)]
    variants: dict[str, Callable[[Drive], Drive]] = {
        "readings as they are": lambda d: d,
        "mean error taken out": _without_mean_error,
        "and the floor's noise known": lambda d: replace(_without_mean_error(d), process=process),
    }
    table = Table(f"round in {world.name}, uneven floor, {seeds} seeds: median (worst)", "what is known", *columns)
    for name, variant in variants.items():
        drives = [variant(Drive(log, truth, grid, error)) for log, truth in rounds]
        table.row(name, *_spread([_follow(each, settings, seed) for seed, each in enumerate(drives, start=1)]))
    return table


def _office(drives: dict[str, Drive], settings: LocalizerSettings, seeds: int, columns: Sequence[str]) -> Table:
    table = Table(f"office, {seeds} seeds: median (worst)", "odometry", *columns)
    for name, each in drives.items():
        table.row(name, *_spread([_follow(each, settings, seed) for seed in range(1, seeds + 1)]))
    return table


def _without_mean_error(each: Drive) -> Drive:
    ranges = each.laser.range(each.log.ranges.astype(np.float64)).astype(np.float32)
    return replace(each, log=replace(each.log, ranges=ranges))


def _follow(each: Drive, settings: LocalizerSettings, seed: int) -> tuple[float, ...]:
    """Return errors of position [m] (root mean square, largest) and heading [rad], scans sure and wrong, CPU [ms]."""
    localizer = make_localizer(settings, each.laser, each.grid, seed, each.process)
    start = compose(each.truth[0], np.random.default_rng(seed).normal(0, START_SD))
    localizer.set_pose(start.tolist(), np.diag(START_SD**2))
    begin = time.process_time()
    found = localize_scans(localizer, each.log)
    cpu = 1000 * (time.process_time() - begin) / len(each.log.times)
    off = np.hypot(*(found.poses - each.truth)[:, :2].T)
    turn = wrap((found.poses - each.truth)[:, 2])
    wrong = np.sum((found.knowledge == "tracking") & (off > 1.0))
    return (float(np.sqrt(np.mean(off**2))), float(off.max()), float(np.sqrt(np.mean(turn**2))), float(wrong), cpu)


def _lost(drives: dict[str, Drive], settings: LocalizerSettings, starts: int, kidnaps: int) -> Table:
    logs = [(each.log, each.truth) for each in drives.values()]
    any_drive = next(iter(drives.values()))

    def make(seed: int) -> Localizer:
        return make_localizer(settings, any_drive.laser, any_drive.grid, seed)

    columns = ("right at the end", "ever sure and wrong", "after [s]      ", "noticed after [s]", "slowest scan [ms]")
    table = Table("office, 120 s from anywhere: how many; median (worst)", "what", *columns)
    for name, results in (
        (f"from nowhere, {starts} times", [from_nowhere(make, logs, case) for case in range(starts)]),
        (f"carried away, {kidnaps} times", [carried_away(make, logs, case) for case in range(kidnaps)]),
    ):
        found = np.array([r.found_after for r in results])
        noticed = np.array([r.noticed_after for r in results])
        table.row(
            name,
            f"{sum(r.right for r in results)} of {len(results)}",
            f"{sum(r.wrong for r in results)}",
            f"{np.median(found):.1f} ({found.max():.1f})",
            f"{np.median(noticed):.1f} ({noticed.max():.1f})",
            f"{max(r.slowest for r in results):.0f}",
        )
    return table


def _spread(results: Sequence[tuple[float, ...]]) -> tuple[str, ...]:
    """Return median (worst) per column; headings in degrees."""
    columns = np.array(results).T
    columns[2] = np.degrees(columns[2])
    return tuple(f"{np.median(column):.3f} ({column.max():.3f})" for column in columns)

# SPDX-License-Identifier: BSD-3-Clause
"""Mapping and localisation of simulated and recorded drives, next to gmapping and AMCL where they are at hand."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

from kurumaisu import slam, slam_score
from kurumaisu._core import LaserError
from kurumaisu.bench.slam import office
from kurumaisu.bench.slam.drive import SimulatedDrive
from kurumaisu.bench.slam.models import models
from kurumaisu.bench.slam.new_drives import drives, on_new_drives
from kurumaisu.bench.slam.office import Judged
from kurumaisu.bench.slam.office_bags import office_logs
from kurumaisu.bench.slam.peers import Peer
from kurumaisu.bench.slam.real import real, real_logs
from kurumaisu.bench.slam.real_models import mapping_models
from kurumaisu.bench.table import Table
from kurumaisu.driving import RouteFollower, load_route
from kurumaisu.localization import load_localizer_settings
from kurumaisu.map_file import read_map
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.settings import with_effects
from kurumaisu.types import FloatArray
from kurumaisu.world import World, load_world

_DRIVES, _LONG = 3, 300.0  # fresh drives and their time [s]
_MODEL_SEEDS = 3  # of each variant of the models


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables that were asked for. Return 1 if a bound is broken."""
    options = _parser().parse_args(arguments)
    if options.office is None and options.only in ("mapping", "localisation"):
        _parser().error(f"--only {options.only} needs the folder of recordings with the truth")
    judged: list[Judged] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        gmapping = options.gmapping and Peer.compiled("gmapping", options.gmapping, ["gridfastslam"], folder)
        if options.only in (None, "building"):
            _building(options.seeds, options.seconds)
        if options.office is not None and options.only in (None, "mapping", "localisation"):
            judged += _office(options, gmapping, folder)
        if options.only in (None, "fresh", "models"):
            judged += _fresh(options)
        if options.only in (None, "real"):
            real(options.recordings, gmapping, folder, options.pictures)
        if options.only in (None, "real", "models"):
            _recorded_models(options)
    if judged:
        table = Table("What must be kept", "figure", "ours", "floor", "aim", "peers", "state")
        for row in judged:
            table.row(*astuple(row))
    return int(any(row.state == "BROKEN" for row in judged))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="scripts/bench slam", description=__doc__)
    parser.add_argument("office", type=Path, nargs="?", help="folder of bags with ground_truth, and truth_map.yaml")
    parser.add_argument("--mount", type=float, nargs=3, default=[0.25, 0.0, 0.0], help="base_from_laser in those bags")
    parser.add_argument("--gmapping", type=Path, metavar="PREFIX", help="where openslam_gmapping is installed")
    parser.add_argument("--amcl", type=Path, metavar="PREFIX", help="where AMCL's libraries are installed")
    parser.add_argument("--recordings", type=Path, metavar="DIR", help="of real recordings, as for scripts/real")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="draw the maps of real recordings")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--peer-seeds", type=int, default=10, help="of gmapping, a minute each")
    parser.add_argument("--seconds", type=float, default=240.0, help="of the round at most")
    parser.add_argument("--fresh-seed", type=int, default=101, help="of the fresh drives")
    parser.add_argument("--starts", type=int, default=20, help="unknown ones, on fresh drives")
    parser.add_argument("--kidnaps", type=int, default=10, help="on fresh drives")
    parser.add_argument("--only", choices=("building", "mapping", "localisation", "fresh", "models", "real"))
    return parser


def _office(options: argparse.Namespace, gmapping: Peer | None, folder: Path) -> list[Judged]:
    judged: list[Judged] = []
    grid = read_map(options.office / "truth_map.yaml")
    logs = list(office_logs(options.office, options.mount))
    if options.only != "localisation":
        judged += office.mapping(logs, grid, options.seeds, gmapping, options.peer_seeds, folder)
    if options.only != "mapping":
        amcl = options.amcl and Peer.compiled("amcl", options.amcl, ["amcl_sensors"], folder)
        settings = load_localizer_settings(shipped("launch/localization_node.yaml"))
        judged += office.localisation(logs, grid, settings, options.seeds, amcl)
    return judged


def _fresh(options: argparse.Namespace) -> list[Judged]:
    judged: list[Judged] = []
    settings = load_localizer_settings(shipped("launch/localization_node.yaml"))
    model = with_effects(load_model(shipped("launch/md100.yaml")), shipped("launch/uneven_floor.yaml"))
    noise, error = model.effects[-1].parameters, model.laser.error
    process = (noise["sd_v"], noise["sd_w"], noise["tau"], noise["growth"])
    maps = {"building": shipped("worlds/maps/building.yaml")}
    if options.office is not None:
        maps["office"] = options.office / "truth_map.yaml"
    for name, path in maps.items():
        grid = read_map(path)
        logs = drives(grid, options.fresh_seed, _DRIVES, _LONG)
        if options.only != "models":
            judged += on_new_drives(
                name, logs, grid, settings, error, options.fresh_seed, (options.starts, options.kidnaps)
            )
        if options.only != "fresh":
            models(f"{name}, {_DRIVES} fresh drives: median (worst)", logs, grid, settings, error, process)
    return judged


def _recorded_models(options: argparse.Namespace) -> None:
    seeds = min(options.seeds, _MODEL_SEEDS)
    mapping_models([(log.name[-20:], log, None) for log in real_logs(options.recordings)], seeds)
    if options.office is not None:
        mapping_models(list(office_logs(options.office, options.mount)), seeds)


def _building(seeds: int, seconds: float) -> None:
    world = load_world(shipped("worlds/building.world"))
    laser = load_model(shipped("launch/md100.yaml")).laser
    rounds = [drive(world, seed, seconds) for seed in range(1, seeds + 1)]
    title = f"round in {world.name}, uneven floor, {seeds} seeds: median (worst)"
    table = Table(
        title, "path by", "position [m]     ", "heading [deg]    ", "map to wall [m]  ", "CPU [ms/scan]", page=False
    )
    table.row("odometry", *_spread([slam_score.trajectory_error(log.odom, truth) for log, truth in rounds]), "-", "-")
    for name, error in (("filter, readings as they are", None), ("filter, mean error taken out", laser.error)):
        results = [_mapped(log, truth, error, seed, world) for seed, (log, truth) in enumerate(rounds, start=1)]
        table.row(name, *_spread(results))


def drive(world: World, seed: int, seconds: float) -> tuple[slam.ScanLog, FloatArray]:
    """Return the scans and odometry of the scripted round (or its first seconds), and the true poses (n, 3)."""
    simulated = SimulatedDrive(world, seed)
    driver = RouteFollower(load_route(shipped("launch/round.yaml")))
    v = w = 0.0
    while simulated.observation.time < seconds and not driver.done:
        if simulated.due:
            v, w = driver.command(simulated.observation.pose)
        simulated.step(v, w)
    return simulated.log()


def _mapped(
    log: slam.ScanLog, truth: FloatArray, error: LaserError | None, seed: int, world: World
) -> tuple[float, float, float, float]:
    """Return the errors of position [m] and heading [rad], the map's median distance to the walls, CPU [ms/scan]."""
    if error is not None:
        log = replace(log, ranges=error.range(log.ranges.astype(np.float64)).astype(np.float32))
    start = time.process_time()
    result = slam.map_scans(slam.load_mapping_settings(shipped("launch/mapping_node.yaml")), log, seed)
    cpu = 1000 * (time.process_time() - start) / len(log.times)
    path = result.trajectory[:, 1:]
    distance = slam_score.map_error(result.grid, slam_score.align(path, truth), world.segments)
    return (*slam_score.trajectory_error(path, truth), float(np.median(distance)), cpu)


def _spread(results: Sequence[tuple[float, ...]]) -> tuple[str, ...]:
    """Return median (worst) per column; headings in degrees."""
    columns = np.array(results).T
    columns[1] = np.degrees(columns[1])
    return tuple(f"{np.median(column):.3f} ({column.max():.3f})" for column in columns)

# SPDX-License-Identifier: BSD-3-Clause
"""Mapping of a simulated round: path and map against the truth, with the laser's mean error left in or taken out."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import slam, slam_score
from kurumaisu._core import LaserError, integrate
from kurumaisu.bench.table import Table
from kurumaisu.driving import Driver, load_route
from kurumaisu.params import Laser, load_model, shipped
from kurumaisu.sim.chair import ChairSimulator, Command
from kurumaisu.sim.scanner import Scan
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.types import FloatArray
from kurumaisu.world import World, load_world

_COMMAND_EVERY = 10  # simulator steps


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per variant: median and worst over the seeds."""
    parser = argparse.ArgumentParser(prog="bench slam")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=240.0, help="of the round at most")
    options = parser.parse_args(arguments)
    world = load_world(shipped("worlds/building.world"))
    laser = load_model(shipped("launch/md100.yaml")).laser
    rounds = [drive(world, seed, options.seconds) for seed in range(1, options.seeds + 1)]
    title = f"round in {world.name}, uneven floor, {options.seeds} seeds: median (worst)"
    table = Table(title, "path by", "position [m]     ", "heading [deg]    ", "map to wall [m]  ", "CPU [ms/scan]")
    table.row("odometry", *_spread([slam_score.trajectory_error(log.odom, truth) for log, truth in rounds]), "-", "-")
    for name, error in (("filter, readings as they are", None), ("filter, mean error taken out", laser.error)):
        results = [_mapped(log, truth, error, seed, world) for seed, (log, truth) in enumerate(rounds, start=1)]
        table.row(name, *_spread(results))
    return 0


def drive(world: World, seed: int, seconds: float) -> tuple[slam.ScanLog, FloatArray]:
    """Return the scans and odometry of the scripted round (or its first seconds), and the true poses (n, 3)."""
    model = with_effects(load_model(shipped("launch/md100.yaml")), shipped("launch/uneven_floor.yaml"))
    simulator = ChairSimulator(model, world, load_dynamics(shipped("launch/physical.yaml")))
    driver = Driver(load_route(shipped("launch/round.yaml")))
    observation = simulator.reset(seed)
    commands: list[tuple[float, float]] = []
    scans: list[Scan] = []
    while observation.time < seconds and not driver.done:
        if len(commands) % _COMMAND_EVERY == 0:
            v, w = driver.command(observation.pose)
        commands.append((v, w))
        volts = float(model.translation.volts(v)), float(model.steering.volts(w))
        observation = simulator.step(Command(*volts, float(np.sign(v)), float(np.sign(w))))
        if observation.scan is not None:
            scans.append(observation.scan)
    return _log(model.laser, np.array(commands), simulator.step_time, scans), np.array([scan.pose for scan in scans])


def _log(laser: Laser, commands: FloatArray, step: float, scans: Sequence[Scan]) -> slam.ScanLog:
    """Return scans with the odometry that integrates the commands (n, 2), each held for a step."""
    odom = integrate(commands[:, 0], commands[:, 1], np.full(len(commands), step))
    at = step * np.arange(len(odom))
    fan = slam.Fan(
        angle_min=laser.angle_min,
        angle_increment=laser.angle_increment,
        time_increment=laser.time_increment,
        range_max=laser.range_max,
        base_from_laser=(laser.mount.x, laser.mount.y, laser.mount.yaw),
    )
    times = np.array([scan.time for scan in scans])
    ranges = np.array([scan.ranges for scan in scans], dtype=np.float32)
    return slam.scan_log("round", times, ranges, fan, at, odom)


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

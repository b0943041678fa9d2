# SPDX-License-Identifier: BSD-3-Clause
"""What a ray of the simulated laser costs and how exact it is, and how fast simulated time runs."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.sim.chair import ChairSimulator, Command
from kurumaisu.sim.pymunk_rays import PymunkRays
from kurumaisu.sim.settings import load_physics, with_effects
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import Start, World, load_world

_EXACT = 1e-9  # [m] between ways to compute one range; rounding over 15 m is far less
_CIRCLE = (0.2, 0.5)  # v [m/s], w [rad/s]: a radius of 0.4 m
_START = np.array([2.9, 6.95, 0.0])  # in the first room, where the whole circle is free
_Cast = Callable[[FloatArray], FloatArray]  # pose (3,) -> ranges (n,) [m]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables. Return 1 if the ranges of two ways differ by more than rounding."""
    parser = argparse.ArgumentParser(prog="bench sim")
    parser.add_argument("--repeats", type=int, default=5, help="of everything that is timed; the median counts")
    parser.add_argument("--poses", type=int, default=2000, help="free poses, a fan of beams from each")
    parser.add_argument("--seconds", type=float, default=60.0, help="of simulated time")
    options = parser.parse_args(arguments)
    model, world = load_model(shipped("launch/md100.yaml")), load_world(shipped("worlds/building.world"))
    difference = _rays(model, world, options.poses, options.repeats)
    _simulated_time(model, world, options.seconds, options.repeats)
    print(f"\nlargest difference of ranges {difference:.1e} m, at most {_EXACT:.0e} m")
    return 0 if difference <= _EXACT else 1


def _rays(model: Model, world: World, count: int, repeats: int) -> float:
    """Print the cost of a ray three ways; return the largest difference [m] from the simulator's own way."""
    bearings = model.laser.bearings
    poses = free_poses(world, count, np.random.default_rng(1))
    table = Table(
        f"{count} poses x {len(bearings)} beams among {len(world.segments)} segments of {world.name}, one core",
        *("rays by", "rays/s", "CPU [us/ray]", "times ours", "largest difference [m]"),
    )
    ways = _ways(world, bearings)
    ranges = {name: _cast_all(cast, poses) for name, cast in ways.items()}
    costs = _in_turn({name: partial(_cast_all, cast, poses) for name, cast in ways.items()}, repeats)
    ours = next(iter(ways))
    differences = {name: float(np.max(np.abs(ranges[name] - ranges[ours]))) for name in ways}
    for name, cost in costs.items():
        difference = differences[name] if name != ours else "-"
        table.row(name, ranges[ours].size / cost, 1e6 * cost / ranges[ours].size, cost / costs[ours], difference)
    return max(differences.values())


def _ways(world: World, bearings: FloatArray) -> dict[str, _Cast]:
    """Return the ways to cast a fan, the simulator's own first; all find a wall from inside the building."""
    scene, pymunk_rays = Scene(world.segments), PymunkRays(world.segments)
    x0, y0, x1, y1 = world.bounds
    reach = math.hypot(x1 - x0, y1 - y0)  # no wall is farther away
    return {
        "Scene.cast": lambda pose: scene.cast(pose, bearings, math.inf),
        "pymunk, a call for each ray": lambda pose: pymunk_rays.cast(pose, bearings, reach),
        "numpy, every segment": lambda pose: brute_force(world.segments, pose, bearings),
    }


def _cast_all(cast: _Cast, poses: FloatArray) -> FloatArray:
    return np.array([cast(pose) for pose in poses])


def free_poses(world: World, count: int, rng: np.random.Generator) -> FloatArray:
    """Return random poses (count, 3) in the bounds that are in no solid: an even number of walls lie east of them."""
    x0, y0, x1, y1 = world.bounds
    free = np.empty((0, 3))
    while len(free) < count:
        poses = rng.uniform([x0, y0, -math.pi], [x1, y1, math.pi], (count, 3))
        eastward = np.zeros(1)
        inside = np.array(
            [np.sum(_hits(world.segments, np.array([x, y, 0.0]), eastward)[1]) % 2 == 1 for x, y, _ in poses]
        )
        free = np.concatenate([free, poses[~inside]])
    return free[:count]


def brute_force(segments: FloatArray, pose: FloatArray, bearings: FloatArray) -> FloatArray:
    """Return ranges (n,) [m] of every ray against every segment (m, 4); inf for a miss."""
    along, met = _hits(segments, pose, bearings)
    ranges: FloatArray = np.where(met, along, np.inf).min(axis=1)
    return ranges


def _hits(segments: FloatArray, pose: FloatArray, bearings: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (n, m): how far along each ray the line of each segment is crossed, and if it is in the segment."""
    angles = pose[2] + bearings[:, None]
    dx, dy = np.cos(angles), np.sin(angles)
    ax, ay = segments[:, 0] - pose[0], segments[:, 1] - pose[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    cross = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel: inf or NaN, both of which are no hit
        along = (ax * ey - ay * ex) / cross
        share = (ax * dy - ay * dx) / cross
    return along, (along >= 0) & (share >= 0) & (share <= 1) & np.isfinite(along)


def _simulated_time(model: Model, world: World, seconds: float, repeats: int) -> None:
    """Print how much faster than real time the simulator drives a circle; reset and first scan count."""
    v, w = _CIRCLE
    table = Table(
        f"{seconds:g} s on a circle of {v / w:g} m in {world.name}, {model.laser.beams} beams at "
        f"{1 / model.laser.scan_time:g} Hz, one core",
        *("floor", "simulated s per CPU s", "CPU [ms per simulated s]", "scans"),
    )
    uneven = with_effects(model, shipped("launch/uneven_floor.yaml"))
    simulators = {name: _on_circle(chair, world) for name, chair in (("even", model), ("uneven", uneven))}
    actions = {name: partial(_drive, simulator, model, seconds) for name, simulator in simulators.items()}
    scans = {name: action() for name, action in actions.items()}
    costs = _in_turn(actions, repeats)
    for name, cost in costs.items():
        table.row(name, seconds / cost, 1e3 * cost / seconds, str(scans[name]))


def _on_circle(model: Model, world: World) -> ChairSimulator:
    return ChairSimulator(
        model, replace(world, starts=(Start("circle", _START),)), load_physics(shipped("launch/sim_node.yaml"))
    )


def _drive(simulator: ChairSimulator, model: Model, seconds: float) -> int:
    """Drive the circle; return the number of scans. Raise Error if it is not free."""
    v, w = _CIRCLE
    command = Command(
        float(model.translation.volts(np.array(v))), float(model.steering.volts(np.array(w))), np.sign(v), np.sign(w)
    )
    scans = int(simulator.reset(1).scan is not None)
    for _ in range(round(seconds / simulator.step_time)):
        observation = simulator.step(command)
        scans += observation.scan is not None
        if observation.contact:
            raise Error(f"the circle is not free: contact at {observation.time:.2f} s, pose {observation.pose}")
    return scans


def _in_turn(actions: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Return each action's median CPU time [s]; they take turns, so that a busy machine is busy for all."""
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats):
        for name, action in actions.items():
            start = time.process_time()
            action()
            times[name].append(time.process_time() - start)
    return {name: float(np.median(values)) for name, values in times.items()}

# SPDX-License-Identifier: BSD-3-Clause
"""Three ways to cast a ray that share no code: what each costs, and whether they agree."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.bench.speed.turns import in_turn
from kurumaisu.bench.table import Table
from kurumaisu.params import Model
from kurumaisu.sim.rangers.pymunk_rays import PymunkRays
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import World

EXACT = 1e-9  # [m] between ways to compute one range; rounding over 15 m is far less

_Cast = Callable[[FloatArray], FloatArray]  # pose (3,) -> ranges (n,) [m]


def compare(model: Model, world: World, count: int, repeats: int) -> float:
    """Print the cost of a ray three ways; return the largest difference [m] from the simulator's own way."""
    bearings = model.laser.bearings
    poses = free_poses(world, count, np.random.default_rng(1))
    table = Table(
        f"{count} poses x {len(bearings)} beams among {len(world.segments)} segments of {world.name}, one core",
        *("rays by", "rays/s", "CPU [us/ray]", "times ours", "largest difference [m]"),
    )
    ways = _ways(world, bearings)
    ranges = {name: _cast_all(cast, poses) for name, cast in ways.items()}
    costs = in_turn({name: partial(_cast_all, cast, poses) for name, cast in ways.items()}, repeats)
    ours = next(iter(ways))
    differences = {name: float(np.max(np.abs(ranges[name] - ranges[ours]))) for name in ways}
    for name, cost in costs.items():
        difference = differences[name] if name != ours else "-"
        table.row(name, ranges[ours].size / cost, 1e6 * cost / ranges[ours].size, cost / costs[ours], difference)
    worst = max(differences.values())
    table.note(f"Largest difference of ranges: {worst:.1e} m; the limit is {EXACT:.0e} m.")
    return worst


def _ways(world: World, bearings: FloatArray) -> dict[str, _Cast]:
    """Return the ways to cast a fan, the simulator's own first; all find a wall from inside the building."""
    scene, pymunk_rays = Scene(world.segments), PymunkRays(world.segments)
    x0, y0, x1, y1 = world.bounds
    reach = math.hypot(x1 - x0, y1 - y0)  # no wall is farther away
    first, increment = float(bearings[0]), float(bearings[1] - bearings[0])
    return {
        "Scene.cast_fan": lambda pose: scene.cast_fan(pose, first, increment, len(bearings), math.inf)[0],
        "Scene.cast, a ray for each": lambda pose: scene.cast(pose, bearings, math.inf),
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

# SPDX-License-Identifier: BSD-3-Clause
"""Whether robots come to the same places in ours and in Stage, after a minute of the same commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import SPARSE, free_poses, maps, walls, write_world
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim import Simulator, load_options
from kurumaisu.sim.motion.partition import is_robot
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import World, load_world

_WORLDS = ("simple", "benchmark/cave", "mbicp", "uoa_robotics_lab", "fasr", "fasr2", "lsp_test", "roomba", "autolab")
_DURATION = 60.0  # [s]
_HOLD = 2.0  # [s] of one command
_LOWEST, _HIGHEST = (0.2, -0.2, -0.3), (0.9, 0.2, 0.3)  # commands [m/s, m/s, rad/s]
_REST, _STRAIGHT = 0.1, 0.5  # shares of commands that are zero, and that do not turn
_ROBOTS = {"cave": 40, "hospital": 100}  # of our own worlds of Stage's maps
_ROOMS = 9  # a side
_SAME = 1e-6  # [m]


@dataclass(frozen=True)
class Trace:
    """Poses (steps, robots, 4) after each step and who stalled in it (steps, robots)."""

    poses: FloatArray
    stalled: BoolArray


def table(stage_tree: Path, prefix: Path, folder: Path, others: Sequence[Path]) -> bool:
    """Print a row for each world. Return whether all robots are within a cell of Stage's with cells_stale."""
    out = Table(
        f"robots within a cell of Stage's after {_DURATION:g} s of random commands, by what they met: "
        "nothing, walls only, robots",
        *("world", "cells_stale", "cells", "exact", "largest distance at any time [m]", ""),
    )
    out.note("Columns: the option `collision`; the distance is that with `cells_stale`. Bodies move in Stage's order.")
    stage = Stage(prefix, folder, "stage_drive")
    worlds = [stage_tree / "worlds" / f"{name}.world" for name in _WORLDS]
    worlds += [*_solid_worlds(stage_tree, folder), _rooms(folder / "rooms.world"), *others]
    good = [_row(out, path, stage) for path in worlds]
    return all(good)


def _row(out: Table, path: Path, stage: Stage) -> bool:
    world = load_world(path)
    commands = _commands(world)
    poses, stalled, order = stage.drive(path, commands)
    if len(order) != poses.shape[1]:
        raise Error(f"{path}: Stage has {len(order)} robots, we {poses.shape[1]}")
    world, commands = reordered(world, order), commands[:, order]
    theirs = Trace(poses[:, order], stalled[:, order])
    ours = {collision: _run(world, commands, collision) for collision in ("cells_stale", "cells", "exact")}
    letter = ours["cells_stale"]
    lonely = (_apart(letter, _run(_intangible(world), commands, "cells")) < _SAME).all(axis=0)
    free = lonely & ~letter.stalled.any(axis=0)
    near = {collision: _apart(trace, theirs)[-1] <= world.resolution for collision, trace in ours.items()}
    counts = [
        ", ".join(f"{within[those].sum()}/{those.sum()}" for those in (free, lonely & ~free, ~lonely))
        for within in near.values()
    ]
    good = bool(near["cells_stale"].all())
    largest = float(_apart(letter, theirs).max())
    out.row(path.stem, *counts, largest, "" if good else "beyond")
    return good


def reordered(world: World, order: IntArray) -> World:
    """Return a world whose robots are in an order (robots,) of their old numbers; what has none comes first."""
    robots = [model.root for model in world.models if is_robot(model)]
    rank: dict[int, int] = {}
    for place, number in enumerate(order.tolist()):
        rank.setdefault(robots[number], place)
    old = sorted(range(len(world.models)), key=lambda i: (rank.get(world.models[i].root, -1), i))
    new = {-1: -1} | {index: place for place, index in enumerate(old)}
    models = tuple(
        replace(model, index=new[model.index], parent=new[model.parent], root=new[model.root])
        for model in (world.models[index] for index in old)
    )
    return replace(world, models=models, poses=world.poses[old])


def _intangible(world: World) -> World:
    """Return a world whose robots do not meet each other: they are of one tree."""
    trees = {model.root for model in world.models if is_robot(model)}
    models = tuple(replace(m, root=min(trees)) if m.root in trees else m for m in world.models)
    return replace(world, models=models)


def _run(world: World, commands: FloatArray, collision: str) -> Trace:
    options = load_options(shipped("launch/simulator.yaml"))
    options = replace(options, semantics="stage", timing="stage", collision=collision, threads=1)
    # without sensors, which move nobody and cost time
    models = tuple(m if is_robot(m) else replace(m, device=None) for m in world.models)
    simulator = Simulator(replace(world, models=models), options)
    seen = [simulator.step(command) for command in commands]
    return Trace(np.array([s.poses for s in seen]), np.array([s.stalled for s in seen]))


def _apart(one: Trace, other: Trace) -> FloatArray:
    """Return distances (steps, robots) [m]."""
    difference = one.poses[..., :2] - other.poses[..., :2]
    return np.asarray(np.hypot(difference[..., 0], difference[..., 1]))


def _commands(world: World) -> FloatArray:
    """Return commands (steps, robots, 3), each held for a while."""
    rng = np.random.default_rng(7)
    robots = sum(is_robot(model) for model in world.models)
    count = math.ceil(_DURATION / _HOLD)
    commands = rng.uniform(_LOWEST, _HIGHEST, (count, robots, 3))
    commands[..., 2] *= rng.random((count, robots)) >= _STRAIGHT
    commands *= rng.random((count, robots, 1)) >= _REST
    steps = round(_DURATION / world.interval)
    return np.asarray(commands[np.arange(steps) * count // steps])


def _solid_worlds(stage_tree: Path, folder: Path) -> list[Path]:
    """Write worlds of Stage's maps whose walls stop robots, unlike those of its own worlds (map.inc)."""
    paths = []
    for place in maps(stage_tree):
        poses = free_poses(walls(place, folder), _ROBOTS[place.name], np.random.default_rng(3))
        paths.append(write_world(folder / f"{place.name}_solid.world", place, SPARSE, poses))
    return paths


def _rooms(path: Path) -> Path:
    """Write a world of robots, each in a room of its own, rooms and robots at all angles; return its path."""
    corners = "point[0] [0 0] point[1] [3 0] point[2] [3 3] point[3] [0 3]"
    lines = ["resolution 0.02", "interval_sim 100"]
    lines.append(f"define room model ( size [3 3 1] block ( points 4 {corners} z [0 1] ) )")
    for i in range(_ROOMS**2):
        x, y = 5 * (i % _ROOMS) - 20, 5 * (i // _ROOMS) - 20
        turn, heading = (90 * i if i % 4 == 0 else 7.3 * i), (90 * i if i % 3 == 0 else 4.1 * i)
        shelf = "model ( pose [0.1 0 0 20] size [0.3 0.1 0.2] )" if i % 4 == 1 else ""
        body = f'size [0.4 0.3 0.4] origin [{0.05 * (i % 3):g} 0 0 0] drive "{("diff", "omni")[i % 2]}" {shelf}'
        lines += [f"room ( pose [{x} {y} 0 {turn:g}] )", f"position ( pose [{x} {y} 0 {heading:g}] {body} )"]
    write_whole({path: "\n".join(lines) + "\n"})
    return path

# SPDX-License-Identifier: BSD-3-Clause
"""Whether the first robot of Stage's worlds sees in ours what it sees in Stage."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import free_poses
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.sim import fans, partition
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import World, load_world

_STAGE_WORLDS = ("simple", "benchmark/cave", "benchmark/hospital", "mbicp", "uoa_robotics_lab", "fasr", "lsp_test")
_STAGE_ROS_WORLDS = ("willow-erratic", "intense")
_LIMITS = (0.5, 1.5, 0.005)  # median and p95 of the differences [cells], share of beams that meet another model
_BEYOND, _FEW = 2.0, 100  # [m] around a world of so few walls, which is not closed
_CLEFT = 3.0  # [cells] a change of range over one cell across the beam by more than this much of its slope is an edge


@dataclass(frozen=True)
class Seen:
    """Ranges [m] and the numbers of the models met, 0 also for none: (poses, beams)."""

    ranges: FloatArray
    models: FloatArray


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each world. Return 1 if one of them is beyond a limit."""
    parser = argparse.ArgumentParser(prog="bench agreement")
    parser.add_argument("--stage", type=Path, metavar="PREFIX", required=True, help="where a Stage 4.3 is installed")
    parser.add_argument("--stage-tree", type=Path, metavar="DIR", required=True, help="Stage's sources")
    parser.add_argument("--stage-ros-tree", type=Path, metavar="DIR", help="stage_ros' sources")
    parser.add_argument("--poses", type=int, default=200)
    parser.add_argument("--world", type=Path, nargs="*", default=[], help="others to compare as well")
    options = parser.parse_args(arguments)
    paths = [options.stage_tree / "worlds" / f"{name}.world" for name in _STAGE_WORLDS]
    if options.stage_ros_tree:
        paths += [options.stage_ros_tree / "world" / f"{name}.world" for name in _STAGE_ROS_WORLDS]
    table = Table(
        f"{options.poses} free poses of the first robot in each world; beams within a cell of an edge left out",
        *("world", "cell [m]", "beams", "edges [%]", "median [cells]", "p95 [cells]", "other model [%]", ""),
    )
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(options.stage, Path(folder))
        good = [_row(table, path, stage, options.poses) for path in [*paths, *options.world]]
    return 0 if all(good) else 1


def _row(table: Table, path: Path, stage: Stage, count: int) -> bool:
    world = load_world(path)
    poses = free_poses(
        world, count, np.random.default_rng(5), room=0.5, beyond=_BEYOND if len(world.segments) < _FEW else 0.0
    )
    ranges, models, run = stage.scan(path, poses)
    if run.models != len(world.models):
        raise Error(f"{path}: Stage has {run.models} models, we {len(world.models)}")
    ours, edges, nearby = _ours(world, poses)
    if ranges.shape != ours.ranges.shape:
        raise Error(f"{path}: Stage has {ranges.shape[1]} beams, we {ours.ranges.shape[1]}")
    other = (models != ours.models) & ~(models == nearby).any(axis=0) & ~edges
    differences = np.abs(ranges - ours.ranges)[~edges & (models == ours.models)] / world.resolution
    median, p95 = np.percentile(differences, [50, 95])
    found = (float(median), float(p95), float(other.mean()))
    good = all(value <= limit for value, limit in zip(found, _LIMITS, strict=True))
    table.row(
        *(path.stem, world.resolution, str(ranges.size), 100 * float(edges.mean())),
        *(found[0], found[1], 100 * found[2], "" if good else "beyond"),
    )
    return good


def _ours(world: World, poses: FloatArray) -> tuple[Seen, BoolArray, FloatArray]:
    """Return what the first robot sees; where an edge is within a cell; the models met within a cell (4, ...)."""
    robot = next(model for model in world.models if partition.is_robot(model))
    # Rangers then report which model they meet.
    models = tuple(replace(m, ranger_return=float(m.index)) if m.ranger_return >= 0 else m for m in world.models)
    bodies = partition.sort(models, [partition.is_robot(model) for model in models])
    arena, numbers, _ = partition.build_arena(models, world.poses, bodies, 1)
    body = int(bodies.body_of[robot.index])
    found = [fan for fan in fans.find(models, world.poses, bodies, [body]) if fan.body == body]
    z = world.poses[robot.index, 2]
    frames = np.insert(poses, 2, z, axis=1)
    rays, limits = [], []
    for fan in found:
        origins = partition.attached(frames, fan.mount)[:, np.newaxis].repeat(fan.fan.samples, axis=1)
        origins[..., 3] += fan.bearings
        rays.append(origins)
        limits.append(np.full(fan.fan.samples, fan.fan.range_max))
    eyes, reach = np.concatenate(rays, axis=1), np.concatenate(limits)
    trees = np.full(eyes[..., 0].size, robot.root)

    def look(at: FloatArray) -> Seen:
        ranges, met = arena.cast(np.ascontiguousarray(at.reshape(-1, 4)), trees, float(reach.max()))
        ranges, met = ranges.reshape(at.shape[:2]), met.reshape(at.shape[:2])
        beyond = ranges > reach
        return Seen(np.where(beyond, reach, ranges), np.where(beyond, 0.0, met))

    arena.set_poses(numbers[body : body + 1], frames[:1])
    seen = look(eyes)
    beside = [look(_shifted(eyes, seen.ranges, side * world.resolution)) for side in (-2, -1, 1, 2)]
    return seen, _edges(seen, beside, world.resolution), np.array([b.models for b in beside])


def _shifted(eyes: FloatArray, ranges: FloatArray, distance: float) -> FloatArray:
    """Return rays that pass the places met by others at a distance [m] to the left, and leave as far beside."""
    shifted = eyes.copy()
    shifted[..., 0] -= distance * np.sin(eyes[..., 3])
    shifted[..., 1] += distance * np.cos(eyes[..., 3])
    return shifted


def _edges(seen: Seen, beside: Sequence[Seen], cell: float) -> BoolArray:
    """Return where the range jumps within a cell: it bends by more than any straight wall does."""
    left2, left, right, right2 = (b.ranges for b in beside)
    bend = np.maximum(np.abs(left - 2 * seen.ranges + right), np.abs(left2 - 2 * left + seen.ranges) + 0 * right2)
    bend = np.maximum(bend, np.abs(right2 - 2 * right + seen.ranges))
    return np.asarray(bend > _CLEFT * cell)

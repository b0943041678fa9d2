# SPDX-License-Identifier: BSD-3-Clause
"""Whether robots of Stage's worlds see in ours what they see in Stage, and come to the same places."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.bench import agreement_poses
from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import free_poses
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.sim import fans, partition
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import World, load_world

_STAGE_WORLDS = ("simple", "benchmark/cave", "benchmark/hospital", "mbicp", "uoa_robotics_lab", "fasr", "lsp_test")
_STAGE_ROS_WORLDS = ("willow-erratic", "intense")
_LIMITS = (0.5, 1.5, 0.5)  # median and p95 across the wall [cells], share of beams that meet another model [%]
_BEND = 3.0  # [cells] of a beam's range between its neighbours': no wall does that within a cell, but at its ends
_BEYOND, _FEW = 2.0, 100  # [m] around a world of so few segments, which is not closed
_SHIFT = 4096  # [cells] brings all coordinates above 0


@dataclass(frozen=True)
class Seen:
    """What beams see, (poses, beams).

    ranges [m]; models (5, poses, beams): the number of the model met by the beam and by four within two cells beside
    it, 0 also for none; edges: the range jumps within a cell; across: sine of the angle between beam and wall.
    """

    ranges: FloatArray
    models: FloatArray
    edges: BoolArray
    across: FloatArray


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
        *("world", "beams", "edges [%]", "along beams [cells]", "across walls [cells]", "above 0 [cells]"),
        *("other model, all, above 0 [%]", ""),
    )
    print("median and 95th percentile; across walls: times the sine of the angle between beam and wall;")
    print("above 0: the same with Stage's world moved to where it does not round towards 0")
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(options.stage, Path(folder))
        good = [_row(table, path, stage, options.poses) for path in [*paths, *options.world]]
        good.append(agreement_poses.table(options.stage_tree, options.stage, Path(folder), options.world))
    return 0 if all(good) else 1


def _row(table: Table, path: Path, stage: Stage, count: int) -> bool:
    world = load_world(path)
    cell = world.resolution
    closed = len(world.segments) >= _FEW
    poses = free_poses(world, count, np.random.default_rng(5), room=0.5, beyond=0.0 if closed else _BEYOND)
    ours = _ours(world, poses)
    found = []
    for shift in (0.0, _SHIFT * cell):
        ranges, models, run = stage.scan(path, poses, shift)
        if run.models != len(world.models):
            raise Error(f"{path}: Stage has {run.models} models, we {len(world.models)}")
        if ranges.shape != ours.ranges.shape:
            raise Error(f"{path}: Stage has {ranges.shape[1]} beams, we {ours.ranges.shape[1]}")
        other = ~ours.edges & ~(models == ours.models).any(axis=0)
        same = ~ours.edges & (models == ours.models[0])
        along = np.abs(ranges - ours.ranges)[same] / cell
        found += [*np.percentile(along, [50, 95]), *np.percentile(along * ours.across[same], [50, 95])]
        found.append(100 * other.mean())
    judged = [float(value) for value in found[-3:]]
    good = all(value <= limit for value, limit in zip(judged, _LIMITS, strict=True))
    pairs = [f"{found[i]:.2f} {found[i + 1]:.2f}" for i in (0, 2, 7)]
    pairs.append(f"{found[4]:.2f} {found[9]:.2f}")
    table.row(path.stem, str(ours.ranges.size), 100 * float(ours.edges.mean()), *pairs, "" if good else "beyond")
    return good


def _ours(world: World, poses: FloatArray) -> Seen:
    """Return what the first robot sees from poses (n, 3)."""
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

    def look(sideways: float) -> tuple[FloatArray, FloatArray]:
        ranges, met = arena.cast(_shifted(eyes, sideways).reshape(-1, 4), trees, float(reach.max()))
        ranges, met = ranges.reshape(eyes.shape[:2]), met.reshape(eyes.shape[:2])
        beyond = ranges > reach
        return np.where(beyond, reach, ranges), np.where(beyond, 0.0, met)

    arena.set_poses(numbers[body : body + 1], frames[:1])
    cell = world.resolution
    looks = [look(side * cell) for side in (0, -2, -1, 1, 2)]
    ranges = [ranges for ranges, _ in looks]
    across = 1 / np.hypot(1, (ranges[3] - ranges[2]) / (2 * cell))
    return Seen(ranges[0], np.array([met for _, met in looks]), _edges(ranges, cell), across)


def _shifted(eyes: FloatArray, distance: float) -> FloatArray:
    """Return rays (..., 4) that leave at a distance [m] to the left of others."""
    shifted = eyes.copy()
    shifted[..., 0] -= distance * np.sin(eyes[..., 3])
    shifted[..., 1] += distance * np.cos(eyes[..., 3])
    return shifted


def _edges(ranges: Sequence[FloatArray], cell: float) -> BoolArray:
    """Return where the range jumps within a cell: it bends more than a wall does.

    ranges: of a beam, and of those that leave two cells and one to its right, one and two to its left [m].
    """
    here, right2, right, left, left2 = ranges
    bends = (right - 2 * here + left, right2 - 2 * right + here, left2 - 2 * left + here)
    return np.asarray(np.max(np.abs(bends), axis=0) > _BEND * cell)

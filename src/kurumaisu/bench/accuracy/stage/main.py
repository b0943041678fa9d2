# SPDX-License-Identifier: BSD-3-Clause
"""Whether robots of Stage's worlds see in ours what they see in Stage, and come to the same places."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu.bench.accuracy.stage import poses
from kurumaisu.bench.accuracy.stage.beams import Observer
from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import free_poses
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import load_world

_STAGE_WORLDS = (
    *("simple", "benchmark/cave", "benchmark/hospital", "mbicp", "uoa_robotics_lab", "fasr", "fasr2", "lsp_test"),
    *("autolab", "pioneer_walle", "pioneer_flocking"),
)
_STAGE_ROS_WORLDS = ("willow-erratic", "willow-four-erratics", "intense")
_LIMITS = (0.5, 1.5, 0.5)  # median and p95 of differences [cells], share of beams that meet another model [%]
_SAME = 1e-6  # [cells]
_BEYOND, _FEW = 2.0, 100  # [m] around a world of so few segments, which is not closed


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each world. Return 1 if one of them is beyond a limit."""
    parser = argparse.ArgumentParser(prog="scripts/bench agreement", description=__doc__)
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
        f"{options.poses} free poses of the first robot in each world, next to Stage",
        *("world", "ray_casting", "beams", "left out [%]", "median, p95 [cells]", "other model [%]", "same [%]", ""),
    )
    table.note("Differences of ranges; same: of all beams, those with the same range and model.")
    table.note("`exact` leaves out beams within a cell of an edge: what Stage's rounding makes of true ranges.")
    median, high, other = _LIMITS
    table.note(f"Limits, of `cells` alone: median {median:g} and p95 {high:g} cells, other model {other:g} %.")
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(options.stage, Path(folder))
        good = [_row(table, path, stage, options.poses) for path in [*paths, *options.world]]
        good.append(poses.table(options.stage_tree, options.stage, Path(folder), options.world))
    return 0 if all(good) else 1


def _row(table: Table, path: Path, stage: Stage, count: int) -> bool:
    world = load_world(path)
    closed = len(world.segments) >= _FEW
    poses = free_poses(world, count, np.random.default_rng(5), room=0.5, beyond=0.0 if closed else _BEYOND)
    observer = Observer(world)
    exact = observer.exact(poses)
    ranges, models, run = stage.scan(path, poses)
    if run.models != len(world.models):
        raise Error(f"{path}: Stage has {run.models} models, we {len(world.models)}")
    if ranges.shape != exact.ranges.shape:
        raise Error(f"{path}: Stage has {ranges.shape[1]} beams, we {exact.ranges.shape[1]}")
    walls = ~exact.edges
    met = (models == exact.models).any(axis=0)
    _figures(table, (path.stem, "exact"), np.abs(ranges - exact.ranges) / world.resolution, walls, met)
    ours, those = observer.cells(poses)
    every = np.ones_like(walls)
    return _figures(table, (path.stem, "cells"), np.abs(ranges - ours) / world.resolution, every, models == those)


def _figures(table: Table, names: tuple[str, str], apart: FloatArray, counted: BoolArray, met: BoolArray) -> bool:
    """Print how far ranges are apart [cells] where they count and meet the same model; return if within the limits."""
    median, high = np.percentile(apart[counted & met], [50, 95])
    other = 100 * float((counted & ~met).sum() / counted.sum())
    same = 100 * float(((apart < _SAME) & met).mean())
    good = all(value <= limit for value, limit in zip((median, high, other), _LIMITS, strict=True))
    left_out = 100 * float(1 - counted.mean())
    table.row(*names, str(apart.size), left_out, f"{median:.2f} {high:.2f}", other, same, "" if good else "beyond")
    return good

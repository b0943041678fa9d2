# SPDX-License-Identifier: BSD-3-Clause
"""Rays per second and core of the ray caster and of Stage, from the same poses."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import URG, Fan, Map, free_poses, walls, write_world
from kurumaisu.bench.table import Table
from kurumaisu.types import FloatArray

_UNLIMITED = 200.0  # [m] farther than any wall of these maps; Stage has no infinite range


def table(places: Sequence[Map], stage: Stage | None, folder: Path, poses: int, repeats: int) -> None:
    """Print rays per second of fans and single rays, and what a scene takes to build."""
    out = Table(
        f"{poses} free poses x {URG.beams} beams over {math.degrees(URG.fov):g} deg, one core",
        *("map, greatest range", "segments", "built [ms]", "fans [Mrays/s]", "each ray [Mrays/s]"),
        *("Stage [Mrays/s]", "fans / Stage", "median, p95 apart [m]"),
    )
    for place in places:
        world = walls(place, folder)
        free = free_poses(world, poses, np.random.default_rng(1), room=0.0)
        built = np.median([_cpu(partial(Scene, world.segments)) for _ in range(repeats)])
        for fan in (URG, replace(URG, range_max=_UNLIMITED)):
            path = write_world(folder / f"{place.name}.world", place, fan, free[:1])
            fans, each, other, apart = _measure(Scene(world.segments), fan, free, stage, path, repeats)
            out.row(
                *(f"{place.name}, {fan.range_max:g} m", f"{len(world.segments)}", 1e3 * float(built), fans, each),
                *((other, fans / other, apart) if other else ("-", "-", "-")),
            )


def _measure(
    scene: Scene, fan: Fan, poses: FloatArray, stage: Stage | None, world: Path, repeats: int
) -> tuple[float, float, float, str]:
    """Return Mrays/s of fans, single rays and Stage (0: not there), and how far apart Stage's ranges are."""
    increment = fan.fov / (fan.beams - 1)
    bearings = -fan.fov / 2 + increment * np.arange(fan.beams)
    ranges = np.empty((len(poses), fan.beams))
    times: dict[str, list[float]] = {"fans": [], "each": [], "stage": []}
    apart = "-"

    def fans() -> None:
        for i, pose in enumerate(poses):
            ranges[i] = scene.cast_fan(pose, -fan.fov / 2, increment, fan.beams, fan.range_max)[0]

    def each() -> None:
        for pose in poses:
            scene.cast(pose, bearings, fan.range_max)

    for _ in range(repeats):
        times["fans"].append(_cpu(fans))
        times["each"].append(_cpu(each))
        if stage:
            theirs, _, run = stage.scan(world, poses)
            times["stage"].append(run.cpu)
            difference = np.abs(theirs - np.minimum(ranges, fan.range_max))
            apart = "{:.3f} {:.3f}".format(*np.percentile(difference, [50, 95]))
    speeds = [1e-6 * ranges.size / float(np.median(taken)) if taken else 0.0 for taken in times.values()]
    return speeds[0], speeds[1], speeds[2], apart


def _cpu(action: object) -> float:
    assert callable(action)
    start = time.process_time()
    action()
    return time.process_time() - start

# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of the simulator's benchmark: worlds that this package and Stage both read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import World, load_world

_ROBOT = 0.1  # edge of a robot [m]
_TRIES = 200  # for each free pose
_ROOM = 0.3  # [m] between a robot's centre and the nearest wall


@dataclass(frozen=True)
class Map:
    """What stands still: the line of a world file that says it."""

    name: str
    line: str


@dataclass(frozen=True)
class Fan:
    """A laser: beams, field of view [rad], greatest range [m]."""

    beams: int
    fov: float
    range_max: float


URG = Fan(682, math.radians(240), 5.6)
SPARSE = Fan(16, math.radians(240), 5.6)


def maps(stage_tree: Path) -> tuple[Map, Map]:
    """Return Stage's own cave and hospital, at the sizes of its own worlds."""
    bitmaps = stage_tree / "worlds" / "bitmaps"
    line = 'model ( name "map" size [{} {} 0.8] bitmap "{}" boundary 1 )'
    return (
        Map("cave", line.format(16, 16, bitmaps / "cave.png")),
        Map("hospital", line.format(140, 60, bitmaps / "hospital.png")),
    )


def shipped_map() -> Map:
    """Return a map of this package, for want of Stage's."""
    return Map("building", f'include "{shipped("worlds/building.world")}"')


def write_world(path: Path, place: Map, fan: Fan, poses: FloatArray) -> Path:
    """Write a world file with a robot at each of the poses (n, 3); return its path."""
    lines = [
        "resolution 0.02",
        "interval_sim 100",
        place.line,
        f"define laser ranger ( sensor ( range [0 {fan.range_max:g}] "
        f"fov {math.degrees(fan.fov):.9f} samples {fan.beams} ) )",
        f"define robot position ( size [{_ROBOT} {_ROBOT} 0.1] laser() )",
    ]
    lines += [
        f'robot ( name "r{i}" pose [{x:.4f} {y:.4f} 0 {math.degrees(heading):.4f}] )'
        for i, (x, y, heading) in enumerate(poses)
    ]
    write_whole({path: "\n".join(lines) + "\n"})
    return path


def walls(place: Map, folder: Path) -> World:
    """Return a world of the map alone."""
    return load_world(write_world(folder / f"{place.name}-walls.world", place, URG, np.empty((0, 3))))


def free_poses(
    world: World, count: int, rng: np.random.Generator, room: float = _ROOM, beyond: float = 0.0
) -> FloatArray:
    """Return random poses (count, 3), at most so far [m] beyond the walls, in no solid, with so much room [m]."""
    scene = Scene(world.segments)
    x0, y0, x1, y1 = world.bounds
    free: list[FloatArray] = []
    for _ in range(_TRIES * count):
        if len(free) == count:
            break
        pose = rng.uniform([x0 - beyond, y0 - beyond, -math.pi], [x1 + beyond, y1 + beyond, math.pi])
        around, _ = scene.cast_fan(pose, 0.0, math.tau / 36, 36, math.inf)
        if around.min() > room and not inside(world.segments, pose):
            free.append(pose)
    else:
        raise Error(f"{world.path}: has hardly a pose with {room:g} m around it that is in no solid")
    return np.array(free).reshape(-1, 3)


def inside(segments: FloatArray, pose: FloatArray) -> bool:
    """Return whether a pose is in a solid: an odd number of outlines lie east of it."""
    ax, ay, bx, by = segments.T
    with np.errstate(divide="ignore", invalid="ignore"):
        x = ax + (pose[1] - ay) / (by - ay) * (bx - ax)
    return bool(np.sum(((ay > pose[1]) != (by > pose[1])) & (x > pose[0])) % 2)

# SPDX-License-Identifier: BSD-3-Clause
"""What scans and steps of many robots cost, among the walls of a hospital-like floor made here."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.bench.table import Table
from kurumaisu.types import FloatArray

_FLOOR = (140.0, 60.0)  # [m], as Stage's hospital
_ROOM = (3.5, 5.0)  # [m]
_CORRIDOR = 2.5  # [m]
_DOOR = 0.9  # [m]
_PIECE = 0.5  # [m] longest piece of a wall: maps made of pixels have short ones
_ROBOT = 0.1  # edge [m]
_HEIGHT = 0.3  # of a robot [m]
_STEP = 0.03  # [m] in 0.1 s
_EXACT = 1e-9  # [m]


@dataclass(frozen=True)
class _Scene:
    """Robots (n, 4) among walls (m, 6), each with a fan."""

    arena: Arena
    walls: FloatArray
    robots: FloatArray
    fans: FloatArray


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if ranges among the walls differ from those by every wall in numpy."""
    parser = argparse.ArgumentParser(prog="scripts/bench arena", description=__doc__)
    parser.add_argument("--repeats", type=int, default=15, help="of everything that is timed; the median counts")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args(arguments)
    walls = hospital()
    table = Table(
        f"240 deg, 5.6 m, {len(walls)} walls, {options.threads} threads, Python's call included",
        *("robots x beams", "scan CPU [ms]", "scan wall [ms]", "ns/beam", "set + move CPU [ms]", "stalled"),
    )
    worst = 0.0
    for robots, beams in ((1, 16), (1, 682), (10, 682), (100, 682), (100, 16), (1000, 16), (1000, 682)):
        scene = _scene(walls, robots, beams, options.threads)
        scan, wall = _median(partial(_scan, scene), options.repeats)
        step, _ = _median(partial(_step, scene), options.repeats)
        stalled = int(_step(scene))
        table.row(f"{robots} x {beams}", 1e3 * scan, 1e3 * wall, 1e9 * scan / robots / beams, 1e3 * step, stalled)
        worst = max(worst, _difference(scene))
    table.note(f"Largest difference of ranges: {worst:.1e} m; the limit is {_EXACT:.0e} m.")
    return 0 if worst <= _EXACT else 1


def hospital() -> FloatArray:
    """Return walls (m, 6) of rooms along corridors, each with a door, in short pieces."""
    width, height = _FLOOR
    lines = [(0, 0, width, 0), (width, 0, width, height), (width, height, 0, height), (0, height, 0, 0)]
    pitch = 2 * _ROOM[1] + _CORRIDOR
    for y in np.arange(_CORRIDOR, height - pitch, pitch):
        for x in np.arange(_CORRIDOR, width - _ROOM[0] - _CORRIDOR, _ROOM[0]):
            door = x + 0.5 + _DOOR
            for face in (y, y + 2 * _ROOM[1]):  # both rows of rooms open to a corridor
                lines += [(x, face, x + 0.5, face), (door, face, x + _ROOM[0], face)]
            lines += [(x, y, x, y + 2 * _ROOM[1]), (x, y + _ROOM[1], x + _ROOM[0], y + _ROOM[1])]
    return np.array([[*piece, 0.0, 2.0] for line in lines for piece in _pieces(line)])


def _pieces(line: tuple[float, ...]) -> FloatArray:
    ends = np.array(line, dtype=float).reshape(2, 2)
    count = math.ceil(float(np.hypot(*(ends[1] - ends[0]))) / _PIECE)
    points = np.linspace(ends[0], ends[1], count + 1)
    return np.concatenate([points[:-1], points[1:]], axis=1)


def _scene(walls: FloatArray, robots: int, beams: int, threads: int) -> _Scene:
    m = len(walls)
    arena = Arena(walls, np.ones(m), np.ones(m, bool), np.zeros(m, int), threads)
    x = _ROBOT / 2
    corners = [(-x, -x), (x, -x), (x, x), (-x, x), (-x, -x)]
    outline = np.array([[*a, *b, 0.0, _HEIGHT] for a, b in pairwise(corners)])
    for tree in range(1, robots + 1):
        arena.add_body(outline, np.ones(4), np.ones(4, bool), tree)
    rng = np.random.default_rng(1)
    poses = rng.uniform([1, 1, 0, -math.pi], [_FLOOR[0] - 1, _FLOOR[1] - 1, 0, math.pi], (robots, 4))
    fov = math.radians(240)
    fans = np.tile([-fov / 2, fov / (beams - 1), beams, 5.6], (robots, 1))
    return _Scene(arena, walls, poses, fans)


def _scan(scene: _Scene) -> FloatArray:
    origins = scene.robots + np.array([0, 0, _HEIGHT / 2, 0])
    return scene.arena.scan(origins, np.arange(1, len(origins) + 1), scene.fans)[0]


def _step(scene: _Scene) -> int:
    """Put the robots to their places and move them; return how many stalled."""
    bodies, heading = np.arange(len(scene.robots)), scene.robots[:, 3]
    scene.arena.set_poses(bodies, scene.robots)
    ahead = np.stack([_STEP * np.cos(heading), _STEP * np.sin(heading), 0 * heading, 0 * heading], axis=1)
    return int(scene.arena.move(bodies, scene.robots + ahead).sum())


def _median(action: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return the medians of CPU and wall time [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time(), time.perf_counter()
        action()
        times.append((time.process_time() - start[0], time.perf_counter() - start[1]))
    cpu, wall = np.median(np.array(times), axis=0)
    return float(cpu), float(wall)


def _difference(scene: _Scene) -> float:
    """Return the largest difference [m] of a few robots' ranges from those of an oracle, all bodies far away."""
    n, few = len(scene.robots), min(len(scene.robots), 5)
    scene.arena.set_poses(np.arange(n), np.tile([1e5, 0.0, 0.0, 0.0], (n, 1)))
    samples = int(scene.fans[0, 2])
    ranges = _scan(scene)[: few * samples]
    bearings = np.tile(scene.fans[0, 0] + scene.fans[0, 1] * np.arange(samples), few)
    poses = np.repeat(scene.robots[:few], samples, axis=0)
    angles = poses[:, 3] + bearings
    d = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    e, to_a = scene.walls[:, 2:4] - scene.walls[:, :2], scene.walls[None, :, :2] - poses[:, None, :2]
    cross = d[..., 0] * e[:, 1] - d[..., 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_a[..., 0] * e[:, 1] - to_a[..., 1] * e[:, 0]) / cross
        f = (to_a[..., 0] * d[..., 1] - to_a[..., 1] * d[..., 0]) / cross
    hits = np.where((t >= 0) & (t <= 5.6) & (f >= 0) & (f <= 1) & (cross != 0), t, np.inf).min(axis=1)
    both = np.isfinite(hits) & np.isfinite(ranges)
    if (np.isfinite(hits) != np.isfinite(ranges)).any():
        return math.inf
    return float(np.abs(hits[both] - ranges[both]).max(initial=0.0))

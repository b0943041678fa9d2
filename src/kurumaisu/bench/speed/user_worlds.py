# SPDX-License-Identifier: BSD-3-Clause
"""Worlds of the kinds that users of stage_ros have, for stageros and its peer; made here but for willow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.whole_files import write_whole

_MODELS = """
resolution 0.02
interval_sim {interval:g}
define box model ( size [0.5 0.5 1] )
define laser ranger ( size [0.05 0.05 0.1] sensor ( range [0 {reach:g}] fov {fov:g} samples {beams} ) )
define robot position ( size [{size:g} {size:g} 0.1] drive "diff" laser ( pose [0 0 0 0] ) )
"""
_SIDE = 16.0  # [m] of the room or the map, as of Stage's cave
_CELLS = 8  # of the maze, each way
_CELL, _WALL = 1.2, 0.1  # [m]


@dataclass(frozen=True)
class Case:
    """A world in a file, the number of its robots, each with a laser, and the length of its steps [s]."""

    name: str
    path: Path
    robots: int
    interval: float


@dataclass(frozen=True)
class _Robots:
    """Robots of an edge [m] at places (x, y [m], heading [deg]); beams over fov [deg] as far as reach [m]."""

    places: list[tuple[float, float, float]]
    size: float
    beams: int
    fov: float
    reach: float


def cave(folder: Path, robots: int, bitmap: Path | None) -> Case:
    """Return a lattice of robots in a room of boxes, or around the middle of a map."""
    columns = math.ceil(math.sqrt(robots))
    pace, middle = 1.5, (columns - 1) / 2
    lattice = [(pace * (i % columns - middle), pace * (i // columns - middle), 0.0) for i in range(robots)]
    fleet = _Robots(lattice, 0.1, 682, 240, 5.6)
    return _written(folder, f"{bitmap.stem if bitmap else 'boxes'}, {robots} x 682", fleet, 0.1, _room(_SIDE, bitmap))


def cases(folder: Path, stage_ros_tree: Path | None) -> Iterator[Case]:
    """Give the worlds, written into a folder; willow only from stage_ros' sources."""
    corner = _CELL / 2
    yield _written(folder, "maze, 1 x 360, 20 ms", _Robots([(corner, corner, 45.0)], 0.3, 360, 360, 8), 0.02, _maze())
    if stage_ros_tree:
        yield Case("willow, 1 x 1081", (stage_ros_tree / "world" / "willow-erratic.world").resolve(), 1, 0.1)
    pair = _Robots([(-1, 0, 0), (1, 0, 180)], 0.4, 1440, 360, 10)
    yield _written(folder, "room, 2 x 1440, 20 ms", pair, 0.02, _room(5.0, None))
    turns = [math.tau * i / 24 for i in range(24)]
    ring = _Robots([(3 * math.cos(a), 3 * math.sin(a), math.degrees(a)) for a in turns], 0.2, 512, 180, 6)
    yield _written(folder, "room, 24 x 512, 20 ms", ring, 0.02, _room(10.0, None))
    yield _written(folder, "no walls, 1 x 10, 20 ms", _Robots([(0, 0, 0)], 0.3, 10, 180, 5), 0.02, "")


def _written(folder: Path, name: str, robots: _Robots, interval: float, still: str) -> Case:
    text = _MODELS.format(
        interval=1000 * interval, beams=robots.beams, fov=robots.fov, reach=robots.reach, size=robots.size
    )
    text += still + "".join(f"robot ( pose [{x:.4f} {y:.4f} 0 {a:.4f}] )\n" for x, y, a in robots.places)
    path = folder / f"{name.replace(', ', '_').replace(' ', '_')}.world"
    write_whole({path: text})
    return Case(name, path, len(robots.places), interval)


def _room(side: float, bitmap: Path | None) -> str:
    """Return a square room [m] with a map, or with a ring of boxes."""
    walls = f"model ( pose [0 0 0 0] size [{side} {side} 1] boundary 1 "
    if bitmap:
        return walls + f'bitmap "{bitmap.resolve()}" )\n'
    rim, r = np.linspace(0, math.tau, 24, endpoint=False), 0.375 * side
    boxes = "".join(f"box ( pose [{r * math.cos(a):.3f} {r * math.sin(a):.3f} 0 20] )\n" for a in rim)
    return f"{walls})\n{boxes}"


def _maze() -> str:
    """Return the walls of a maze with one way between any two of its cells, each a model."""
    cells = list(np.ndindex(_CELLS + 1, _CELLS + 1))  # one more on the left and below: their walls are the rim's
    walls = {((x, y), upright) for x, y in cells for upright in (True, False) if (y if upright else x)}
    return "".join(_wall(cell, upright=upright) for cell, upright in sorted(walls - _openings()))


def _openings() -> set[tuple[tuple[int, ...], bool]]:
    """Return the walls that are left out, each by the cell on its left or below it: a random walk that turns back."""
    rng = np.random.default_rng(1)
    way, seen = [(1, 1)], {(1, 1)}
    openings: set[tuple[tuple[int, ...], bool]] = set()
    while way:
        x, y = way[-1]
        around = ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1))
        free = [cell for cell in around if cell not in seen and min(cell) >= 1 and max(cell) <= _CELLS]
        if not free:
            way.pop()
            continue
        way.append(free[rng.integers(len(free))])
        seen.add(way[-1])
        openings.add((min(way[-1], (x, y)), way[-1][1] == y))
    return openings


def _wall(cell: tuple[int, ...], *, upright: bool) -> str:
    """Return the wall on the right of a cell, or above it; cell (1, 1) begins at the origin."""
    x, y = ((c - 0.5 + 0.5 * on) * _CELL for c, on in zip(cell, (upright, not upright), strict=True))
    long = _CELL + _WALL
    size = (_WALL, long) if upright else (long, _WALL)
    return f"model ( pose [{x:.3f} {y:.3f} 0 0] size [{size[0]:g} {size[1]:g} 1] )\n"

# SPDX-License-Identifier: BSD-3-Clause
"""Arenas to look at, and an oracle in numpy that looks at every face."""

import math
from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.types import BoolArray, FloatArray, IntArray

FREE = -1  # the tree of a sensor that stands on nothing
EVERYWHERE = (0.0, 1.0)  # z of faces where heights do not matter
ROOM = [(0, 0, 6, 0), (6, 0, 6, 5), (6, 5, 0, 5), (0, 5, 0, 0)]


def faces(lines: list[tuple[float, ...]], z: tuple[float, float] = EVERYWHERE) -> FloatArray:
    return np.array([(*line, *z) for line in lines], dtype=float).reshape(-1, 6)


def box(length: float, width: float, z: tuple[float, float] = EVERYWHERE) -> FloatArray:
    x, y = length / 2, width / 2
    return faces([(-x, -y, x, -y), (x, -y, x, y), (x, y, -x, y), (-x, y, -x, -y)], z)


def arena(walls: FloatArray, returns: FloatArray | None = None, tree: int = 0, threads: int = 1) -> Arena:
    m = len(walls)
    return Arena(walls, np.ones(m) if returns is None else returns, np.ones(m, bool), np.full(m, tree), threads)


def add(place: Arena, outline: FloatArray, tree: int, returns: float = 1.0, solid: bool = True) -> int:
    return place.add_body(outline, np.full(len(outline), returns), np.full(len(outline), solid), tree)


def one(place: Arena, origin: tuple[float, ...], tree: int = FREE, range_max: float = 20.0) -> tuple[float, float]:
    """Cast one ray both ways, which must agree."""
    at, own = np.array([origin]), np.array([tree])
    ranges, returns = place.scan(at, own, np.array([[0.0, 0.0, 1, range_max]]))
    again = place.cast(at, own, range_max)
    assert (ranges[0], returns[0]) == (again[0][0], again[1][0])
    return float(ranges[0]), float(returns[0])


# The oracle


@dataclass(frozen=True)
class Everything:
    """All faces (m, 6) in the map with returns (m,), solid (m,), trees (m,) and bodies (m,), -1: a wall.

    outlines: of each body, in its own frame.
    """

    faces: FloatArray
    returns: FloatArray
    solid: BoolArray
    tree: IntArray
    body: IntArray
    outlines: list[FloatArray]


def in_map(outline: FloatArray, pose: FloatArray) -> FloatArray:
    x, y, z, heading = pose
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    ends = outline[:, :4].reshape(-1, 2, 2) @ turn.T + (x, y)
    return np.concatenate([ends.reshape(-1, 4), outline[:, 4:] + z], axis=1)


def brute_force(
    everything: Everything, origin: FloatArray, tree: int, angles: FloatArray, range_max: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Every ray against every visible face; return ranges, returns, and where rounding may decide otherwise."""
    z = origin[2]
    seen = (everything.returns >= 0) & (everything.faces[:, 4] <= z) & (z <= everything.faces[:, 5])
    seen &= (everything.tree != tree) | (tree < 0)
    segments, returns = everything.faces[seen, :4], everything.returns[seen]
    if not len(segments):
        return np.full(len(angles), np.inf), np.zeros(len(angles)), np.zeros(len(angles), bool)
    d = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
    e, to_a = segments[:, 2:] - segments[:, :2], segments[:, :2] - origin[:2]
    cross = d[..., 0] * e[:, 1] - d[..., 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_a[:, 0] * e[:, 1] - to_a[:, 1] * e[:, 0]) / cross
        f = (to_a[:, 0] * d[..., 1] - to_a[:, 1] * d[..., 0]) / cross
    t = np.where((t >= 0) & (t <= range_max) & (f >= 0) & (f <= 1) & (cross != 0), t, np.inf)
    nearest = t.argmin(axis=1)
    ranges = t[np.arange(len(angles)), nearest]
    ends = segments.reshape(-1, 2) - origin[:2]
    grazing = np.abs(d[..., 0] * ends[:, 1] - d[..., 1] * ends[:, 0]).min(axis=1) < 1e-9
    close = np.sort(np.concatenate([t, np.full((len(angles), 1), np.inf)], axis=1), axis=1)
    with np.errstate(invalid="ignore"):
        grazing |= (close[:, 1] - close[:, 0] < 1e-9) | (np.abs(close[:, 0] - range_max) < 1e-9)
    return ranges, np.where(np.isinf(ranges), 0.0, returns[nearest]), grazing | (close[:, 0] < 1e-9)


def random_arena(rng: np.random.Generator, bodies: int, threads: int = 1) -> tuple[Arena, Everything]:
    """Return walls and bodies of every kind at several heights, some invisible, some in trees of several."""

    def some(m: int, size: float) -> tuple[FloatArray, FloatArray, BoolArray]:
        middle = rng.uniform(-8, 8, (m, 2)) if size > 1 else np.zeros((m, 2))
        ends = np.concatenate([middle + rng.normal(0, size, (m, 2)), middle + rng.normal(0, size, (m, 2))], axis=1)
        low = rng.choice([0.0, 0.2, 0.5], m)
        heights = np.stack([low, low + rng.choice([0.0, 0.3, 1.0], m)], axis=1)
        return np.concatenate([ends, heights], axis=1), rng.choice([-1.0, 0.0, 0.5, 2.0], m), rng.random(m) < 0.7

    walls, returns, solid = some(30, 2.0)
    tree = rng.integers(0, 4, 30)
    place = Arena(walls, returns, solid, tree, threads)
    parts, outlines = [(walls, returns, solid, tree, np.full(30, -1))], []
    for number in range(bodies):
        outline, returns, solid = some(int(rng.integers(1, 20)), float(rng.choice([0.1, 0.3, 2.5])))
        own = int(rng.integers(2, 12))
        assert place.add_body(outline, returns, solid, own) == number
        pose = rng.uniform([-9, -9, 0, -4], [9, 9, 0.3, 4]) if rng.random() < 0.5 else rng.uniform(-2, 2, 4)
        place.set_poses(np.array([number]), pose[None])
        m = len(outline)
        parts.append((in_map(outline, pose), returns, solid, np.full(m, own), np.full(m, number)))
        outlines.append(outline)
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return place, Everything(*columns, outlines)

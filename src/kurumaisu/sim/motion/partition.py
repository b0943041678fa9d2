# SPDX-License-Identifier: BSD-3-Clause
"""Which models of a world move as one, and what each of those bodies looks like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.geometry import relative
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.layout import outline as placed_outline
from kurumaisu.world.model import Model, Position

Distort = Callable[[FloatArray], FloatArray]  # both ends of walls (m, 4) [m] -> the same, changed


@dataclass(frozen=True)
class Bodies:
    """Models sorted by what they move with; the ground is body -1.

    heads (b,): the model whose pose is the body's, in the order of the models; body_of (models,): body of each model;
    carrier (b,): the body a body stands on; level (b,): how many bodies stand below it.
    """

    heads: IntArray
    body_of: IntArray
    carrier: IntArray
    level: IntArray

    def __len__(self) -> int:
        return len(self.heads)


@dataclass(frozen=True)
class Outline:
    """What rangers and collisions meet: faces (k, 6) of both ends and z range [m]; returns, solid, trees (k,)."""

    faces: FloatArray
    returns: FloatArray
    solid: BoolArray
    trees: IntArray


def is_robot(model: Model) -> bool:
    """Return whether it is of type position."""
    return isinstance(model.device, Position)


def sort(models: Sequence[Model], moves: Sequence[bool]) -> Bodies:
    """Group models by bodies; moves (models,): has a pose of its own to move."""
    heads: list[int] = []
    body_of: list[int] = []
    carrier: list[int] = []
    level: list[int] = []
    for model, own in zip(models, moves, strict=True):
        below = body_of[model.parent] if model.parent >= 0 else -1
        if own:
            body_of.append(len(heads))
            heads.append(model.index)
            carrier.append(below)
            level.append(level[below] + 1 if below >= 0 else 0)
        else:
            body_of.append(below)
    as_ints = [np.array(numbers, dtype=np.int64) for numbers in (heads, body_of, carrier, level)]
    return Bodies(*as_ints)


def outline(models: Sequence[Model], poses: FloatArray, members: IntArray, frame: FloatArray) -> Outline:
    """Return the faces of some models in a frame (4,) of the map; poses (models, 4) are those of all models."""
    faces, returns, solid, trees = [np.empty((0, 6))], [], [], []
    for model in (models[i] for i in members):
        count = len(model.shape.segments)
        if not count or (model.ranger_return < 0 and not model.obstacle_return):
            continue
        faces.append(placed_outline(model, relative(frame, poses[model.index])))
        returns.append(np.full(count, model.ranger_return))
        solid.append(np.full(count, model.obstacle_return))
        trees.append(np.full(count, model.root, dtype=np.int64))
    return Outline(
        faces=np.concatenate(faces),
        returns=np.concatenate([np.empty(0), *returns]),
        solid=np.concatenate([np.empty(0, dtype=np.bool_), *solid]),
        trees=np.concatenate([np.empty(0, dtype=np.int64), *trees]),
    )


def build_arena(
    models: Sequence[Model],
    poses: FloatArray,
    bodies: Bodies,
    threads: int,
    see_solids: bool = False,
    distort: Distort | None = None,
) -> tuple[Arena, IntArray, Outline]:
    """Return an arena of models at poses (models, 4), its numbers (b,) of the bodies, and the walls.

    see_solids: rays see what is solid instead of what rangers see; distort: says where the walls are in truth.
    """
    if see_solids:
        models = [replace(m, ranger_return=1.0 if m.obstacle_return else -1.0) for m in models]
    walls = outline(models, poses, np.flatnonzero(bodies.body_of < 0), np.zeros(4))
    if distort is not None:
        walls.faces[:, :4] = distort(walls.faces[:, :4])
    arena = Arena(walls.faces, walls.returns, walls.solid, walls.trees, threads)
    numbers = np.array([_add(arena, models, poses, bodies, i) for i in range(len(bodies))], dtype=np.int64)
    arena.set_poses(numbers, np.ascontiguousarray(poses[bodies.heads]))
    return arena, numbers, walls


def _add(arena: Arena, models: Sequence[Model], poses: FloatArray, bodies: Bodies, body: int) -> int:
    head = int(bodies.heads[body])
    shape = outline(models, poses, np.flatnonzero(bodies.body_of == body), poses[head])
    return arena.add_body(shape.faces, shape.returns, shape.solid, models[head].root)

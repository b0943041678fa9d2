# SPDX-License-Identifier: BSD-3-Clause
"""Outlines as cells, for Stage's collisions and ranges to the letter."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu._core import CellRays, Cells
from kurumaisu.errors import Error
from kurumaisu.sim.motion.partition import Bodies
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Model

Wanted = Callable[[Model], bool]
Arrays = tuple[IntArray, FloatArray, FloatArray, IntArray]


def build_cells(
    models: Sequence[Model], poses: FloatArray, bodies: Bodies, resolution: float, layers: int
) -> tuple[Cells, IntArray]:
    """Return cells of a size [m] with models at poses (models, 4), and their numbers (b,) of the bodies.

    Raise Error if there would be too many cells.
    """
    try:
        cells = Cells(resolution, layers)
        for model in _still(models, bodies, _solid):
            cells.add_walls(*_wall(model, poses), model.root)
        numbers = []
        for members in _members(models, bodies):
            outline, _ = _body(models, members, _solid)
            numbers.append(cells.add_body(*outline, members[0].root))
    except ValueError as error:
        raise Error(f"collision: cells of {resolution:g} m: {error}; collision: exact needs none") from error
    found = np.array(numbers, dtype=np.int64)
    cells.set_poses(found, np.ascontiguousarray(poses[bodies.heads]))
    return cells, found


def build_cell_rays(
    models: Sequence[Model], poses: FloatArray, bodies: Bodies, resolution: float, threads: int
) -> tuple[CellRays, IntArray]:
    """Return what rangers see in cells of a size [m], and the bodies' numbers (b,), models being at poses (models, 4).

    Raise Error if there would be too many cells.
    """
    try:
        rays = CellRays(resolution, threads)
        for model in _still(models, bodies, _drawn):
            rays.add(*_wall(model, poses), np.array([model.ranger_return]), model.root)
        numbers = []
        for members in _members(models, bodies):
            outline, kept = _body(models, members, _drawn)
            returns = np.array([model.ranger_return for model in kept], dtype=np.float64)
            numbers.append(rays.add(*outline, returns, members[0].root))
        found = np.array(numbers, dtype=np.int64)
        rays.set_poses(found, np.ascontiguousarray(poses[bodies.heads]))
    except ValueError as error:
        raise Error(f"ray_casting: cells of {resolution:g} m: {error}; ray_casting: exact needs none") from error
    return rays, found


def _solid(model: Model) -> bool:
    return model.obstacle_return


def _drawn(_model: Model) -> bool:
    return True  # what no ray meets is drawn too: rays do not jump over it


def _still(models: Sequence[Model], bodies: Bodies, wanted: Wanted) -> list[Model]:
    """Return the models that never move."""
    return [model for model in models if bodies.body_of[model.index] < 0 and wanted(model)]


def _members(models: Sequence[Model], bodies: Bodies) -> list[list[Model]]:
    """Return the models of each body."""
    members: list[list[Model]] = [[] for _ in bodies.heads]
    for model in models:
        if bodies.body_of[model.index] >= 0:
            members[bodies.body_of[model.index]].append(model)
    return members


def _wall(model: Model, poses: FloatArray) -> Arrays:
    return np.array([-1]), np.array([[*poses[model.index], 0.0, *_origin(model)]]), *_edges([model], _drawn)


def _body(models: Sequence[Model], members: Sequence[Model], wanted: Wanted) -> tuple[Arrays, list[Model]]:
    """Return a body, whose pose is that of the first of its models, as those wanted and what carries them."""
    carrying = {members[0].index}
    for model in reversed(members):
        if model.index in carrying or (wanted(model) and len(model.shape.segments)):
            carrying |= {model.index, model.parent}
    members = [model for model in members if model.index in carrying]
    number = {model.index: i for i, model in enumerate(members)}
    parents, places = [-1], [np.array([0.0, 0.0, 0.0, 0.0, 0.0, *_origin(members[0])])]
    for model in members[1:]:
        below = models[model.parent]
        parents.append(number[below.index])
        places.append(np.array([*model.pose, below.size[2] if below.stack_children else 0.0, *_origin(model)]))
    return (np.array(parents, dtype=np.int64), np.array(places), *_edges(members, wanted)), members


def _edges(models: Sequence[Model], wanted: Wanted) -> tuple[FloatArray, IntArray]:
    """Return the edges (k, 6) of those wanted, and the place of each one's model among all of them (k,)."""
    edges, parts = [np.empty((0, 6))], [np.empty(0, dtype=np.int64)]
    for i, model in enumerate(models):
        if wanted(model):
            shape = model.shape
            edges.append(np.hstack([shape.segments, shape.heights]) if shape.edges is None else shape.edges)
            parts.append(np.full(len(edges[-1]), i, dtype=np.int64))
    return np.concatenate(edges), np.concatenate(parts)


def _origin(model: Model) -> FloatArray:
    return np.zeros(4) if model.shape.edges is None else model.origin

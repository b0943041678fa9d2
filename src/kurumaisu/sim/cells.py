# SPDX-License-Identifier: BSD-3-Clause
"""Outlines as cells, for Stage's collisions to the letter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu._core import Cells
from kurumaisu.errors import Error
from kurumaisu.sim.partition import Bodies
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Model

Arrays = tuple[IntArray, FloatArray, FloatArray, IntArray]


def build_cells(
    models: Sequence[Model], poses: FloatArray, bodies: Bodies, resolution: float, layers: int
) -> tuple[Cells, IntArray]:
    """Return cells of a size [m] with models at poses (models, 4), and their numbers (b,) of the bodies.

    Raise Error if there would be too many cells.
    """
    try:
        cells = Cells(resolution, layers)
        for model in models:
            if bodies.body_of[model.index] < 0 and model.obstacle_return:
                place = np.array([[*poses[model.index], 0.0, *_origin(model)]])
                cells.add_walls(np.array([-1]), place, *_edges([model]), model.root)
        members: list[list[Model]] = [[] for _ in bodies.heads]
        for model in models:
            if bodies.body_of[model.index] >= 0:
                members[bodies.body_of[model.index]].append(model)
        numbers = [cells.add_body(*_body(models, those), those[0].root) for those in members]
    except ValueError as error:
        raise Error(f"collision: cells of {resolution:g} m: {error}; collision: exact does without them") from error
    found = np.array(numbers, dtype=np.int64)
    cells.set_poses(found, np.ascontiguousarray(poses[bodies.heads]))
    return cells, found


def _body(models: Sequence[Model], members: Sequence[Model]) -> Arrays:
    """Return a body, whose pose is that of the first of its models, as one chain of models, parents first."""
    number = {model.index: i for i, model in enumerate(members)}
    parents, places = [-1], [np.array([0.0, 0.0, 0.0, 0.0, 0.0, *_origin(members[0])])]
    for model in members[1:]:
        below = models[model.parent]
        parents.append(number[below.index])
        places.append(np.array([*model.pose, below.size[2] if below.stack_children else 0.0, *_origin(model)]))
    return np.array(parents, dtype=np.int64), np.array(places), *_edges(members)


def _edges(models: Sequence[Model]) -> tuple[FloatArray, IntArray]:
    """Return the solid edges (k, 6) of models, and the place of each one's model among them (k,)."""
    edges, parts = [np.empty((0, 6))], [np.empty(0, dtype=np.int64)]
    for i, model in enumerate(models):
        if model.obstacle_return:
            shape = model.shape
            edges.append(np.hstack([shape.segments, shape.heights]) if shape.edges is None else shape.edges)
            parts.append(np.full(len(edges[-1]), i, dtype=np.int64))
    return np.concatenate(edges), np.concatenate(parts)


def _origin(model: Model) -> FloatArray:
    return np.zeros(4) if model.shape.edges is None else model.origin

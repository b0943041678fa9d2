# SPDX-License-Identifier: BSD-3-Clause
"""Models that come, go, or are moved by hand: new machinery that takes over what is still there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import attached, relative
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.population import Population
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Model
from kurumaisu.world.tree import global_poses

_FARTHEST = 1e6  # [m, rad] a pose may be from the map's origin


def checked_pose(pose: FloatArray | Sequence[float]) -> FloatArray:
    """Return a pose (4,) as an array. Raise Error unless it is four finite numbers within reach."""
    try:
        array = np.array(pose, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise Error(f"pose: must be x, y, z [m], heading [rad]: {pose!r}") from error
    if array.shape != (4,) or not (np.abs(array) <= _FARTHEST).all():
        raise Error(f"pose: must be x, y, z [m], heading [rad], each within {_FARTHEST:g}: {array.tolist()}")
    return array


def with_newcomers(population: Population, models: Sequence[Model], pose: FloatArray, step: int) -> Population:
    """Return a population with one more tree of models, parents first, whose first is at a pose (4,) in the map."""
    if [model.index for model in models] != list(range(len(models))):
        raise Error("spawn: models must be numbered from 0, parents before children")
    places = global_poses(models)
    return population.joined(models, attached(pose, relative(places[0], places)), step)


def without(old: Machinery, index: int) -> Machinery:
    """Return machinery without a model and all that stand on it, which may come back."""
    bodies, now = old.bodies, old.model_poses()
    if index not in bodies.heads:  # a part of a body, of which only where it is in that body counts
        parts = bodies.body_of == bodies.body_of[index]
        now[parts] = old.population.poses[parts]
    return rebuilt(old, old.population.without(index, now))


def moved(old: Machinery, index: int, pose: FloatArray) -> Machinery:
    """Return the machinery, new or not, in which a model, with all that stands on it, is at a pose (4,) in the map."""
    now = old.model_poses()
    family = old.population.with_descendants(index)
    then = attached(pose, relative(now[index], now[family]))
    heads = old.bodies.heads
    rows = np.flatnonzero(np.isin(heads, family))
    if index in heads:
        machinery = old
    else:  # its body, or the ground, changes its shape
        body = int(old.bodies.body_of[index])
        begun = pose
        if body >= 0:
            begun = attached(old.population.poses[heads[body]], relative(old.frames[body], pose))
        machinery = rebuilt(old, old.population.moved(index, begun))
    machinery.put(rows, then[np.searchsorted(family, heads[rows])])
    return machinery


def rebuilt(old: Machinery, population: Population) -> Machinery:
    """Return machinery of another population, in which all that both have goes on; rangers have yet to start."""
    new = old.of(population)
    into, out = _common(new, old, new.bodies.heads, old.bodies.heads)
    state, known = new.motion.state(), old.motion.state()
    new.frames[into], new.before[into] = old.frames[out], old.before[out]
    new.motion.place(new.frames[:-1])
    for name, values in state.items():
        values[into] = known[name][out]
    new.motion.restore(state)
    new.stalled[into] = old.stalled[out]
    into, out = _common(new, old, _numbers(new.robots), _numbers(old.robots))
    new.drive.velocities[into] = old.drive.velocities[out]
    new.localization.estimates[into] = old.localization.estimates[out]
    new.localization.shares[into] = old.localization.shares[out]
    return new


def same_fans(new: Machinery, old: Machinery) -> list[tuple[int, int]]:
    """Return the places of the fans that both have, in the new and in the old."""

    def key(machinery: Machinery, i: int) -> tuple[int, int]:
        fan = machinery.fans[i]
        return int(machinery.population.keys[fan.model.index]), fan.number

    known = {key(old, i): i for i in range(len(old.fans))}
    return [(i, known[key(new, i)]) for i in range(len(new.fans)) if key(new, i) in known]


def stuck(machinery: Machinery) -> list[str]:
    """Say which robots cannot move from where they are."""
    return [
        f"{robot.place}: {robot.name or robot.type} touches something at its start; it stalls until it is free"
        for robot, touches in zip(machinery.robots, machinery.touching(), strict=True)
        if touches
    ]


def _numbers(models: Sequence[Model]) -> IntArray:
    return np.array([model.index for model in models], dtype=np.int64)


def _common(new: Machinery, old: Machinery, these: IntArray, those: IntArray) -> tuple[IntArray, IntArray]:
    """Return the rows of models that are in both, in the new and in the old."""
    keys = new.population.keys[these], old.population.keys[those]
    _, into, out = np.intersect1d(*keys, assume_unique=True, return_indices=True)
    return into, out

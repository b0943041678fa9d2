# SPDX-License-Identifier: BSD-3-Clause
"""Entities to the tree of models, and the models' global poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.catalogue import MODELS
from kurumaisu.world.colors import color
from kurumaisu.world.devices import device
from kurumaisu.world.model import Hinge, Model
from kurumaisu.world.notes import Notes
from kurumaisu.world.shapes import Shaper
from kurumaisu.world.syntax import Entity
from kurumaisu.world.values import Units, Values
from kurumaisu.world.walks import walk
from kurumaisu.world.writing import model_words

_MOST_MODELS = 100_000  # of a world
_MOST_ENTITIES = 2_000_000  # models, blocks and sensors of a world
_DEEPEST = 100  # levels of models on models
_SIZE = (0.4, 0.4, 1.0)  # [m], as in Stage
_SIZES = {  # [m], of types with another size if the file gives none
    "ranger": (0.15, 0.15, 0.2),
    "camera": (0.1, 0.07, 0.05),
    "fiducial": (0.0, 0.0, 0.0),
    "gripper": (0.2, 0.3, 0.2),
    "blinkenlight": (0.02, 0.02, 0.02),
}
_MANY = 1.0e4  # [rad] of a heading, more than any file says
_STEEPEST = 1.0  # rise per metre: 45 degrees; nothing on wheels climbs it
_INTERVAL = 100  # [ms] between updates of a model


@dataclass
class Builder:
    """Makes models of entities, in depth-first file order."""

    units: Units
    notes: Notes
    shaper: Shaper
    models: list[Model] = field(default_factory=list)
    _visited: int = 0
    _known: dict[int, dict[str, Any]] = field(default_factory=dict)  # of an entity: what all its models have in common

    def build(self, world: Entity) -> tuple[Model, ...]:
        """Return the models of a world. Raise Error with the place."""
        self._children(world, parent=-1, root=-1, depth=0)
        return tuple(self.models)

    def _children(self, entity: Entity, parent: int, root: int, depth: int) -> None:
        if depth > _DEEPEST:
            raise entity.name.error(f"more than {_DEEPEST} levels of models")
        self._visited += len(entity.children)
        if self._visited > _MOST_ENTITIES:
            raise entity.name.error(f"the macros come to more than {_MOST_ENTITIES} entities")
        for child in entity.children:
            if child.type in MODELS:
                self._add(child, parent, root, depth)
            elif child.children:  # as in Stage, what is in no model stands on the ground
                self._children(child, parent=-1, root=-1, depth=depth + 1)

    def _add(self, entity: Entity, parent: int, root: int, depth: int) -> None:
        index = len(self.models)
        if index == _MOST_MODELS:
            raise entity.name.error(f"more than {_MOST_MODELS} models")
        common = self._known.get(id(entity))
        if common is None:
            common = self._known[id(entity)] = self._common(entity, index)
        root = index if parent < 0 else root
        self.models.append(Model(index=index, parent=parent, root=root, **common))
        self._children(entity, index, root, depth + 1)

    def _common(self, entity: Entity, order: int) -> dict[str, Any]:
        """Return the fields of a model that do not depend on where in the tree it is."""
        values = Values(entity, self.units, self.notes)
        origin = np.array(values.several("origin", "llla", (0.0,) * 4))
        tint = color(values, order)
        shape, size = self.shaper.shape(values, self._size(values), origin, tint)
        mass = values.number("mass", 0.0)
        if mass < 0:
            raise values.error("mass", f"mass must not be below 0, not {mass:g}")
        return {
            "type": entity.type,
            "name": values.text("name", "") or None,
            "place": entity.name.place,
            "pose": np.array(values.several("pose", "llla", (0.0,) * 4)),
            "origin": origin,
            "size": size,
            "color": tint,
            "shape": shape,
            "stack_children": values.whole("stack_children", 1) != 0,
            "ranger_return": values.number("ranger_return", 1.0),
            "obstacle_return": values.whole("obstacle_return", 1) != 0,
            "fiducial_return": values.whole("fiducial_return", 0),
            "fiducial_key": values.whole("fiducial_key", 0),
            "gripper_return": values.whole("gripper_return", 0) != 0,
            "mass": mass,
            "friction": values.number("friction", 0.0) if values.has("friction") else None,
            "update_interval": _interval(values),
            "hinge": _hinge(values),
            "device": device(values),
            "walk": walk(values),
            "slope": _slope(values),
            "source": model_words(entity, self.units, self.shaper.top),
        }

    def _size(self, values: Values) -> FloatArray:
        size = np.array(values.several("size", "lll", _SIZES.get(values.entity.type, _SIZE)))
        if (size < 0).any():
            raise values.error("size", f"size must not be below 0: {size[0]:g}, {size[1]:g}, {size[2]:g}")
        if values.has("size") and not size.all() and values.entity.type not in ("fiducial", "blobfinder", "ranger"):
            name = values.entity.properties["size"].name
            self.notes.add(name, f"a size of 0: {size[0]:g}, {size[1]:g}, {size[2]:g}")
        return size


def _interval(values: Values) -> float:
    interval = values.whole("update_interval", _INTERVAL)
    if interval < 0:
        raise values.error("update_interval", f"update_interval must not be below 0, not {interval}")
    return interval / 1000


def _hinge(values: Values) -> Hinge | None:
    """Read `hinge [x y lowest highest]`, lengths and angles, an addition to Stage's language."""
    if not values.has("hinge"):
        return None
    x, y, lowest, highest = values.several("hinge", "llaa", ())
    if lowest > highest:
        raise values.error("hinge", "hinge must be [X Y LOWEST HIGHEST], the angles ascending")
    return Hinge(np.array([x, y]), lowest, highest)


def _slope(values: Values) -> FloatArray | None:
    """Read `slope [gx gy]`, rise per metre, an addition to Stage's language."""
    if not values.has("slope"):
        return None
    if values.entity.type != "model":
        raise values.error("slope", f"a slope belongs to a model, not to a {values.entity.type}")
    rise = np.array(values.several("slope", "ff", ()))
    if np.hypot(*rise) > _STEEPEST:
        raise values.error("slope", f"slope must be of at most {_STEEPEST:g} m per metre, not {np.hypot(*rise):g}")
    return rise


def global_poses(models: Sequence[Model]) -> FloatArray:
    """Return the models' poses (n, 4) in the map, each on top of its parent if that stacks its children."""
    poses = np.empty((len(models), 4))
    for model in models:
        if model.parent < 0:
            poses[model.index] = (*model.pose[:3], _normal(float(model.pose[3])))
            continue
        parent = models[model.parent]
        x, y, z, heading = poses[model.parent].tolist()
        c, s = math.cos(heading), math.sin(heading)
        dx, dy, dz, turn = model.pose.tolist()
        top = parent.size[2] if parent.stack_children else 0.0
        poses[model.index] = (x + c * dx - s * dy, y + s * dx + c * dy, z + dz + top, _normal(heading + turn))
    return poses


def _normal(heading: float) -> float:
    """Return a heading within half a turn; one that is there already keeps its last bit, as in Stage."""
    if abs(heading) > _MANY:
        heading = math.remainder(heading, math.tau)
    while heading < -math.pi:
        heading += math.tau
    while heading > math.pi:
        heading -= math.tau
    return heading

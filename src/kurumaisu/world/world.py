# SPDX-License-Identifier: BSD-3-Clause
"""The world as the simulator and the critic need it: walls and start poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.types import FloatArray
from kurumaisu.world import known, shapes
from kurumaisu.world.syntax import Entity, parse

_DEFAULT_SIZE = (0.4, 0.4)  # [m] of a model whose file gives none, as in Stage


@dataclass(frozen=True)
class Start:
    """Where a `position` model of the file stands: pose (3,) [m, m, rad]."""

    name: str
    pose: FloatArray


@dataclass(frozen=True)
class World:
    """What a world file says.

    segments: (m, 4), x and y of both ends of all that a laser sees [m]; obstacles: (n, 4), all that a chair
    bumps into; starts: in file order; bounds: smallest x, smallest y, largest x, largest y [m];
    warnings: what the file says and this reader does not heed, in words.
    """

    name: str
    path: Path
    segments: FloatArray
    obstacles: FloatArray
    starts: tuple[Start, ...]
    bounds: tuple[float, float, float, float]
    warnings: tuple[str, ...]

    @property
    def start(self) -> FloatArray:
        """Pose (3,) of the first position model. Raise Error if there is none."""
        if not self.starts:
            raise Error(f"{self.path}: has no position model, so the chair has no start pose")
        return self.starts[0].pose


def load_world(path: Path) -> World:
    """Read a Stage world file. Raise Error naming file, line and column."""
    top = parse(path)
    warnings = known.check(top)
    collector = _Collector(path.parent)
    for child in top.children:
        collector.add(child, np.zeros(3))
    segments = np.concatenate([np.empty((0, 4)), *collector.seen])
    obstacles = np.concatenate([np.empty((0, 4)), *collector.solid])
    both = np.concatenate([segments, obstacles]).reshape(-1, 2)
    if not len(both):
        raise Error(f"{path}: has no walls")
    return World(
        name=top.properties["name"].text() if "name" in top.properties else path.stem,
        path=path,
        segments=segments,
        obstacles=obstacles,
        starts=tuple(collector.starts),
        bounds=(*both.min(axis=0).tolist(), *both.max(axis=0).tolist()),
        warnings=warnings,
    )


@dataclass
class _Collector:
    """Walks the models and keeps what they are made of."""

    folder: Path  # of the world file; bitmaps are relative to it, as in Stage
    seen: list[FloatArray] = field(default_factory=list)
    solid: list[FloatArray] = field(default_factory=list)
    starts: list[Start] = field(default_factory=list)

    def add(self, entity: Entity, parent: FloatArray) -> None:
        """Add a model and its children; parent: pose (3,) that its own is relative to."""
        if entity.type not in known.BODIES:
            return
        pose = compose(parent, _pose(entity, "pose"))
        if entity.type == "position":  # the chair's body and laser are in the model file
            name = entity.properties["name"].text() if "name" in entity.properties else "chair"
            self.starts.append(Start(name, pose))
            return
        self._add_body(entity, compose(pose, _pose(entity, "origin")))
        for child in entity.children:
            self.add(child, pose)

    def _add_body(self, entity: Entity, pose: FloatArray) -> None:
        size = np.array(_DEFAULT_SIZE)
        if "size" in entity.properties:
            size = np.array(entity.properties["size"].numbers(2, 3)[:2])
            if (size <= 0).any():
                raise entity.properties["size"].name.error("size must be positive")
        segments = shapes.transform(shapes.outline(entity, size, self.folder), pose)
        if _number(entity, "ranger_return", 1.0) >= 0:
            self.seen.append(segments)
        if _number(entity, "obstacle_return", 1.0):
            self.solid.append(segments)


def _number(entity: Entity, name: str, absent: float) -> float:
    return entity.properties[name].numbers(1, 1)[0] if name in entity.properties else absent


def _pose(entity: Entity, name: str) -> FloatArray:
    """Return x, y [m] and heading [rad] of a property [x y z degrees]; all 0 if absent, as in Stage."""
    if name not in entity.properties:
        return np.zeros(3)
    x, y, _, degrees = entity.properties[name].numbers(4, 4)
    return np.array([x, y, np.deg2rad(degrees)])

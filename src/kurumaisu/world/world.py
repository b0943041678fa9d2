# SPDX-License-Identifier: BSD-3-Clause
"""A world file as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import PLANAR
from kurumaisu.types import FloatArray
from kurumaisu.world import catalogue
from kurumaisu.world.bitmaps import is_map
from kurumaisu.world.layout import placed, travels
from kurumaisu.world.model import Model
from kurumaisu.world.notes import Notes
from kurumaisu.world.shapes import Shaper
from kurumaisu.world.snippet import Vocabulary
from kurumaisu.world.syntax import NO_MACROS, Entity, Property, parse
from kurumaisu.world.tokens import Kind, SourceText, Token
from kurumaisu.world.tree import Builder, global_poses
from kurumaisu.world.values import Units, Values, units_of
from kurumaisu.world.writing import Setting, world_words

_RESOLUTION = 0.02  # [m], as in Stage
_INTERVAL = 100.0  # [ms], as in Stage
_FARTHEST = 1e7  # [m] or [rad] as src/raycast/arena.cpp has it
_FINEST = 1e-5  # [m]
_SHORTEST = 1e-3  # [ms]
_WALL_HEIGHT = 2.5  # [m] of a map's walls if nothing says how high they are: that of a room
_SEMANTICS = ("stage", "physical")


@dataclass(frozen=True)
class Start:
    """Where a `position` model of the file stands: pose (3,) [m, m, rad]."""

    name: str
    pose: FloatArray


@dataclass(frozen=True)
class World:
    """What a world file says.

    models: in depth-first file order; poses: (n, 4), their global start poses x, y, z [m], heading [rad];
    resolution: edge of Stage's cells [m]; interval: of a step [s]; quit_time [s], 0: never; speedup: of the clock,
    0 or less: as fast as possible; semantics: how the file wants to be simulated, stage or physical, an addition to
    Stage's language; vocabulary: what more text can be read with; setting: what a file of the same world
    says first.
    For a chair alone: segments: (m, 4), x and y of both ends of all that a laser sees [m]; obstacles: (n, 4), all
    that a chair bumps into, at any height, in both without what drives or walks; starts: those, in file order;
    bounds: smallest x, smallest y, largest x, largest y [m] of the walls.
    warnings: what the file says and this reader does not heed, in words; routine: those of them that most files give
    rise to.
    """

    name: str
    path: Path
    models: tuple[Model, ...]
    poses: FloatArray
    resolution: float
    interval: float
    quit_time: float
    speedup: float
    semantics: str
    vocabulary: Vocabulary
    setting: Setting
    segments: FloatArray
    obstacles: FloatArray
    starts: tuple[Start, ...]
    warnings: tuple[str, ...]
    routine: frozenset[str]

    @property
    def start(self) -> FloatArray:
        """Pose (3,) of the first position model. Raise Error if there is none."""
        if not self.starts:
            raise Error(f"{self.path}: has no position model, so the chair has no start pose")
        return self.starts[0].pose

    @property
    def has_walls(self) -> bool:
        """Whether there is anything solid that stands still."""
        return bool(len(self.segments) + len(self.obstacles))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Smallest x, smallest y, largest x, largest y [m] of the walls. Raise Error if there are none."""
        if not self.has_walls:
            raise Error(f"{self.path}: has no walls")
        both = np.concatenate([self.segments, self.obstacles]).reshape(-1, 2)
        (x0, y0), (x1, y1) = both.min(axis=0).tolist(), both.max(axis=0).tolist()
        return x0, y0, x1, y1


def load_world(path: Path, *, image_extents: bool = False, values: Mapping[str, str] | None = None) -> World:
    """Read a Stage world file, or the YAML file of a ROS map as a world of its walls.

    image_extents: a bitmap's size is that of the whole image, not of its walls as in Stage, and a ROS map is at its
    own place and scale; values: of the parameters `${name}` in the file.
    Raise Error naming file, line and column.
    """
    notes = Notes()
    if is_map(path):
        if values:
            raise Error(f"{path}: a map has no parameters, as {next(iter(values))}")
        top, macros, image_extents = _map_alone(path), NO_MACROS, True
    else:
        top, macros = parse(path, values or {}, notes)
    said = Values(top, units_of(top, notes, Units()), notes)
    catalogue.check(top, notes)
    models = Builder(said.units, notes, Shaper(path, image_extents)).build(top)
    return _world(path, models, said, Vocabulary(path, macros, said.units, image_extents))


def _map_alone(path: Path) -> Entity:
    """Return a world of one model that has a map for its bitmap."""
    source = SourceText(path, "")

    def given(name: str, kind: Kind, *texts: str) -> Property:
        return Property(Token(Kind.WORD, name, source, 0), tuple(Token(kind, text, source, 0) for text in texts))

    model = Entity("model", Token(Kind.WORD, "model", source, 0))
    for name, kind, texts in (
        ("name", Kind.STRING, (f'"{path.stem}"',)),
        ("bitmap", Kind.STRING, (f'"{path.name}"',)),
        ("size", Kind.NUMBER, ("1", "1", f"{_WALL_HEIGHT}")),
    ):
        model.properties[name] = given(name, kind, *texts)
    return Entity("world", Token(Kind.WORD, "world", source, 0), children=[model])


def _world(path: Path, models: tuple[Model, ...], said: Values, vocabulary: Vocabulary) -> World:
    resolution = said.number("resolution", _RESOLUTION)
    if resolution < _FINEST:
        raise said.error("resolution", f"resolution must be at least {_FINEST:g} m, not {resolution:g}")
    interval = said.number("interval_sim", _INTERVAL)
    if interval < _SHORTEST:
        raise said.error("interval_sim", f"interval_sim must be at least {_SHORTEST:g} ms, not {interval:g}")
    poses = global_poses(models)
    _check_reach(models, poses)
    walls = [model for model in models if not travels(model, models)]
    starts = (model for model in models if model.type == "position")
    return World(
        name=said.text("name", path.stem),
        path=path,
        models=models,
        poses=poses,
        resolution=resolution,
        interval=interval / 1000,
        quit_time=max(said.number("quit_time", 0.0), 0.0),
        speedup=said.number("speedup", 1.0),
        semantics=_semantics(said),
        vocabulary=vocabulary,
        setting=Setting(world_words(said.entity, path), vocabulary.image_extents),
        segments=_outlines([model for model in walls if model.ranger_return >= 0], poses),
        obstacles=_outlines([model for model in walls if model.obstacle_return], poses),
        starts=tuple(Start(m.name or "chair", poses[m.index, PLANAR]) for m in starts),
        warnings=tuple(said.notes.texts),
        routine=frozenset(said.notes.routine),
    )


def _check_reach(models: tuple[Model, ...], poses: FloatArray) -> None:
    """Raise Error for a model so far from the map's origin that its place is not known well any more."""
    for model, pose in zip(models, poses, strict=True):
        reach = float(np.abs(pose).max() + np.abs(model.shape.segments).max(initial=0.0))
        if not reach < _FARTHEST:
            words = (
                f"reaches {reach:g} m (or rad) from the map's origin; the simulator knows no more than {_FARTHEST:g}"
            )
            raise Error(f"{model.place}: the model {words}")


def _semantics(said: Values) -> str:
    word = said.text("semantics", _SEMANTICS[0])
    if word not in _SEMANTICS:
        raise said.error("semantics", f"semantics must be one of {', '.join(_SEMANTICS)}, not {word!r}")
    return word


def _outlines(models: list[Model], poses: FloatArray) -> FloatArray:
    """Return the outlines (m, 4) of models in the map."""
    return np.concatenate([np.empty((0, 4)), *(placed(m.shape.segments, poses[m.index]) for m in models)])

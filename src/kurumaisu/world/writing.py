# SPDX-License-Identifier: BSD-3-Clause
"""A world as a file: macros, includes and parameters filled in, in metres and degrees, models where they are now."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.geometry import relative, wrap
from kurumaisu.types import FloatArray
from kurumaisu.world.catalogue import MODELS
from kurumaisu.world.files import find
from kurumaisu.world.model import Model
from kurumaisu.world.notes import Notes
from kurumaisu.world.syntax import Entity, Property
from kurumaisu.world.values import UNITS, Units, Values

_HEAD = "# A world as it was in a simulation. Lengths in metres, angles in degrees.\n"
_EXTENTS = "# Its bitmaps are as large as their images: load it with image_extents, as it was loaded before.\n"
_PLACED = ("name", "pose")  # of a model: they are said elsewhere
_INDEX = re.compile(r"\[\d+\]$")
# Which numbers are lengths (l) and angles (a), and not to be scaled (f).
_FORMS = {
    **dict.fromkeys(("pose", "origin", "bpose", "localization_origin", "odom_error", "velocity"), "llla"),
    **dict.fromkeys(("size", "paddle_size"), "lll"),
    **dict.fromkeys(("point", "z", "waypoint", "range"), "ll"),
    **dict.fromkeys(("blength", "walk_speed", "wheelbase", "range_min", "range_max", "range_max_id"), "l"),
    **dict.fromkeys(("velocity_bounds", "acceleration_bounds"), "llllllaa"),
    **{"hinge": "llaa", "noise": "lfa", "fov": "a"},
}
_AS_IT_IS = ("camera", "fov")  # in degrees always


@dataclass(frozen=True)
class Setting:
    """What the file says of a world as a whole, as words; image_extents: how it was loaded."""

    words: str
    image_extents: bool


def written(setting: Setting, models: Sequence[Model], poses: FloatArray) -> str:
    """Return the text of a world file with models, parents before children, at poses (n, 4) in the map."""
    inside: list[list[str]] = [[] for _ in models]
    top: list[str] = []
    for model in reversed(models):  # children are ready before their parents
        text = _written(model, models, poses, inside[model.index][::-1])
        (top if model.parent < 0 else inside[model.parent]).append(text)
    return _HEAD + (_EXTENTS if setting.image_extents else "") + setting.words + "\n" + "\n".join(top[::-1]) + "\n"


def _written(model: Model, models: Sequence[Model], poses: FloatArray, inside: Sequence[str]) -> str:
    pose = poses[model.index]
    if model.parent >= 0:
        parent = models[model.parent]
        top = parent.size[2] if parent.stack_children else 0.0
        pose = relative(poses[parent.index], pose) - np.array([0.0, 0.0, top, 0.0])
    x, y, z, heading = pose
    name = [] if model.name is None else [f'name "{model.name}"']
    numbers = " ".join(_number(value) for value in (x, y, z, math.degrees(wrap(np.array(heading)))))
    lines = [model.source or f"{model.type} (", *name, f"pose [{numbers}]", *inside]
    return "\n  ".join("\n".join(lines).split("\n")) + "\n)"


def model_words(entity: Entity, units: Units, top: Path) -> str:
    """Return what is said of a model, its bracket left open: all but its name, its pose, and the models on it.

    top: the world's first file, which bitmaps are relative to.
    """
    return "\n".join([f"{entity.type} (", *_properties(entity, units, top, _PLACED), *_parts(entity, units, top)])


def world_words(world: Entity, top: Path) -> str:
    """Return what is said of a world as a whole, but its units."""
    return "\n".join(_properties(world, Units(), top, (*UNITS, "test")))


def _parts(entity: Entity, units: Units, top: Path) -> Iterable[str]:
    """Yield the blocks or sensors of a model."""
    for child in entity.children:
        if child.type not in MODELS:
            yield f"{child.type} ( {' '.join(_properties(child, units, top, ()))} )"


def _properties(entity: Entity, units: Units, top: Path, but: tuple[str, ...]) -> list[str]:
    return [_property(entity, given, units, top) for name, given in entity.properties.items() if name not in but]


def _property(entity: Entity, given: Property, units: Units, top: Path) -> str:
    name, values = given.name.text, given.values
    form = _FORMS.get(_INDEX.sub("", name), "")
    if name == "bitmap" and values:
        words = [f'"{find(values[0], top, search_path=False).absolute()}"']
    elif form and units != Units() and len(values) >= len(form) and (entity.type, name) != _AS_IT_IS:
        numbers = Values(entity, units, Notes()).several(name, form, ())
        scaled = (math.degrees(v) if letter == "a" else v for v, letter in zip(numbers, form, strict=True))
        words = [_number(value) for value in scaled]
    else:
        words = [token.text for token in values]
    return f"{name} {words[0]}" if len(words) == 1 else f"{name} [{' '.join(words)}]"


def _number(value: float) -> str:
    """Return a number to its last digit, without an exponent, as the language has none."""
    return np.format_float_positional(value, trim="-")

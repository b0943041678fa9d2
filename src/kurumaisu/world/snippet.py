# SPDX-License-Identifier: BSD-3-Clause
"""More models for a world that is there: a text in the words of its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kurumaisu.errors import Error
from kurumaisu.world import catalogue
from kurumaisu.world.model import Model
from kurumaisu.world.notes import Notes
from kurumaisu.world.shapes import Shaper
from kurumaisu.world.syntax import Macros, parse_more
from kurumaisu.world.tokens import SourceText
from kurumaisu.world.tree import Builder
from kurumaisu.world.values import UNITS, Units, units_of

_MOST_CHARACTERS = 2**20


@dataclass(frozen=True)
class Vocabulary:
    """What a text needs to be read as the file at `top` was: its macros, units, and how it takes bitmaps."""

    top: Path
    macros: Macros
    units: Units
    image_extents: bool


@dataclass(frozen=True)
class Snippet:
    """Models, numbered from 0 in depth-first order, and warnings as of a World."""

    models: tuple[Model, ...]
    warnings: tuple[str, ...]


def read_snippet(text: str, vocabulary: Vocabulary) -> Snippet:
    """Read entities of Stage's language, as `pioneer ( name "guest" )`, with the macros of a world.

    Its units hold unless the text says unit_length or unit_angle. Includes and bitmaps are looked for as from the
    world's own file. Raise Error naming line and column.
    """
    if len(text) > _MOST_CHARACTERS:
        raise Error(f"text: is longer than {_MOST_CHARACTERS} characters")
    top, notes = vocabulary.top, Notes()
    source = SourceText(top.with_name("text"), text)
    world = parse_more(source, top, vocabulary.macros, notes)
    for given in world.properties.values():
        if given.name.text in UNITS:
            continue
        raise given.name.error(f"{given.name.text} would be of the whole world; only models can be added to it")
    catalogue.check(world, notes)
    units = units_of(world, notes, vocabulary.units)
    models = Builder(units, notes, Shaper(top, vocabulary.image_extents)).build(world)
    if not models:
        raise source.error(0, "there is no model in the text")
    return Snippet(models, tuple(notes.texts))

# SPDX-License-Identifier: BSD-3-Clause
"""Models that come to a world that runs: copies of what is there, or what a text describes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from kurumaisu.errors import Error
from kurumaisu.world import read_snippet
from kurumaisu.world.layout import family
from kurumaisu.world.model import Model
from kurumaisu.world.snippet import Vocabulary


@dataclass(frozen=True)
class Newcomers:
    """One tree of models, numbered from 0, parents before children; warnings: what a text says and is not heeded."""

    models: tuple[Model, ...]
    warnings: tuple[str, ...]


def newcomers(
    like: str, name: str, there: Sequence[Model], find: Callable[[str], int], vocabulary: Vocabulary
) -> Newcomers:
    """Return a copy of a model with all that stands on it, or what a text in the world's words describes.

    find: returns the place of a model by its name. Raise Error for an unknown model, a text that makes no sense, or a
    name that is taken.
    """
    models: Sequence[Model]
    if "(" in like:
        snippet = read_snippet(like, vocabulary)
        models, warnings = snippet.models, snippet.warnings
        name = name or models[0].name or ""
    else:
        models, warnings = [there[index] for index in family(there, find(like))], ()
    if name and any(model.name == name for model in there):
        raise Error(f"name {name!r}: there is a model of this name")
    return Newcomers(tuple(renumbered(models, name or None)), warnings)


def renumbered(models: Sequence[Model], name: str | None) -> list[Model]:
    """Return models, the first of them under another name, numbered from 0."""
    places = {model.index: i for i, model in enumerate(models)}
    return [
        replace(model, index=i, parent=places.get(model.parent, -1), root=0, name=model.name if i else name)
        for i, model in enumerate(models)
    ]

# SPDX-License-Identifier: BSD-3-Clause
"""Models that come to a world that runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kurumaisu.world.model import Model


def is_text(like: str) -> bool:
    """Return whether this describes a model instead of naming one."""
    return "(" in like


def renumbered(models: Sequence[Model], name: str | None) -> list[Model]:
    """Return models, the first of them under another name, numbered from 0."""
    places = {model.index: i for i, model in enumerate(models)}
    return [
        replace(model, index=i, parent=places.get(model.parent, -1), root=0, name=model.name if i else name)
        for i, model in enumerate(models)
    ]

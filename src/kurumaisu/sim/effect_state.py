# SPDX-License-Identifier: BSD-3-Clause
"""What effects remember, as plain values, so that a saved state has it; effects themselves know nothing of this."""

from __future__ import annotations

from typing import Any

import numpy as np

_PLAIN = (bool, int, float, str, type(None), np.generic)
_OURS = "kurumaisu.effects"


def memory(thing: Any) -> Any:
    """Return what an effect, a chain of them, or a part of one holds: copies. Of foreign objects: None."""
    if isinstance(thing, np.random.Generator):
        return thing.bit_generator.state
    if isinstance(thing, np.ndarray):
        return thing.copy()
    if isinstance(thing, (tuple, list)):
        return [memory(item) for item in thing]
    if isinstance(thing, dict):
        return {name: memory(value) for name, value in thing.items()}
    if _is_ours(thing):
        return {name: memory(value) for name, value in vars(thing).items()}
    return thing if isinstance(thing, _PLAIN) else None


def remember(thing: Any, known: Any) -> Any:
    """Return the thing as it was when memory returned what is known; what has parts of its own is changed in place."""
    if isinstance(thing, np.random.Generator):
        thing.bit_generator.state = known
        return thing
    if isinstance(thing, (tuple, list)):
        return type(thing)(remember(item, part) for item, part in zip(thing, known, strict=True))
    if _is_ours(thing):
        for name in set(vars(thing)) - set(known):  # came later
            object.__delattr__(thing, name)
        for name, part in known.items():
            object.__setattr__(thing, name, remember(getattr(thing, name), part))  # some are frozen
        return thing
    if isinstance(thing, (*_PLAIN, np.ndarray)):
        return known.copy() if isinstance(known, np.ndarray) else known
    return thing


def _is_ours(thing: Any) -> bool:
    return type(thing).__module__.startswith(_OURS) and hasattr(thing, "__dict__")

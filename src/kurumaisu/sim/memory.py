# SPDX-License-Identifier: BSD-3-Clause
"""What plants, effects and sensors remember, as plain values: saved and read back without a method in each of them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from kurumaisu._core import AxisInverse

_PLAIN = (bool, int, float, str, np.ndarray, np.generic, type(None))
_OURS = ("kurumaisu.effects", "kurumaisu.sim.plant", "kurumaisu.sim.sensors")


def remember(value: Any) -> Any:
    """Return the plain values that an object of ours, and all of ours that it is made of, holds."""
    match value:
        case np.random.Generator():
            return value.bit_generator.state
        case AxisInverse():
            return value.state
        case dict():
            return {key: remember(item) for key, item in value.items()}
        case tuple() | list():
            return [remember(item) for item in value]
        case _ if isinstance(value, _PLAIN):
            return copy.copy(value)
        case _ if _is_ours(value):
            return {name: remember(item) for name, item in vars(value).items()}
    return None  # what never changes


def recall(value: Any, known: Any) -> Any:
    """Return what was remembered of a value: itself, changed, unless it is plain.

    An object of ours must be as new: it keeps what it has and what was remembered has not.
    """
    match value:
        case np.random.Generator():
            value.bit_generator.state = known
        case AxisInverse():
            value.state = known
        case tuple() | list() if len(value) == len(known):
            return type(value)(recall(item, old) for item, old in zip(value, known, strict=True))
        case _ if _is_ours(value):
            for name, old in known.items():
                object.__setattr__(value, name, recall(getattr(value, name), old))  # as some are frozen
        case _ if isinstance(value, (*_PLAIN, dict)):
            return copy.copy(known)
    return value


def _is_ours(value: Any) -> bool:
    return type(value).__module__.startswith(_OURS) and hasattr(value, "__dict__")

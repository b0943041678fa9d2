# SPDX-License-Identifier: BSD-3-Clause
"""What a page can add to a world, as text in the words of a world file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kurumaisu.errors import Error

_SMALLEST, _LARGEST = 0.02, 100.0  # [m] of length and width
_CORNERS = 12  # of a person's outline
_UNITS = 'unit_length "m" unit_angle "degrees"'


@dataclass(frozen=True)
class _Kind:
    """What all of a kind have in common: height [m], and further words."""

    height: float
    words: str


_KINDS: Mapping[str, _Kind] = {
    "box": _Kind(0.8, 'color "burlywood4" mass 8'),  # light enough to be pushed
    "wall": _Kind(1.5, 'color "gray30"'),
    "person": _Kind(1.7, 'color "tomato" mass 75'),
}
_SPEED = 1.0  # [m/s] of a person who walks


@dataclass(frozen=True)
class Walk:
    """From where a person walks, and to where, to and fro: x, y [m] in the map."""

    start: tuple[float, float]
    end: tuple[float, float]


def described(kind: str, name: str, length: float, width: float, walk: Walk | None) -> str:
    """Return a model of a kind, length [m] along its heading. Raise Error for what there is not."""
    if kind not in _KINDS:
        raise Error(f"add: kind must be one of {', '.join(_KINDS)}: {kind!r}")
    for what, value in (("length", length), ("width", width)):
        if not _SMALLEST <= value <= _LARGEST:
            raise Error(f"add: {what} must be from {_SMALLEST:g} m to {_LARGEST:g} m: {value:g} m")
    if walk is not None and kind != "person":
        raise Error(f"add: only a person walks, not a {kind}")
    one = _KINDS[kind]
    words = [f'name "{name}"', f"size [{_number(length)} {_number(width)} {_number(one.height)}]", one.words]
    if kind == "person":
        words.append(_round())
    if walk is not None:
        points = (walk.end, walk.start)
        words += [f"waypoint[{i}] [{_number(x)} {_number(y)}]" for i, (x, y) in enumerate(points)]
        words.append(f'walk_speed {_number(_SPEED)} walk_mode "yoyo" social 1')
    return f"{_UNITS} model ( {' '.join(words)} )"


def _round() -> str:
    angles = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
    points = " ".join(f"point[{i}] [{_number(np.cos(a))} {_number(np.sin(a))}]" for i, a in enumerate(angles))
    return f"block ( points {_CORNERS} {points} z [0 1] )"


def _number(value: float) -> str:
    """Return a number without an exponent, as the language has none."""
    return f"{value:.6f}"

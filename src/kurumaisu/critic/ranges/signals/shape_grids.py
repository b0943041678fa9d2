# SPDX-License-Identifier: BSD-3-Clause
"""Values of parameters that only shape an effect, tried in turn."""

from __future__ import annotations

from itertools import product

import numpy as np

from kurumaisu.effects import Parameter

# Times the usual value, the longest time that is tried: longer ones have no source, and every offset would be a set
# with one. The shortest that is tried, as a share of the usual value or of a short recording.
_LONG, _SHORT = 2.0**1.5, 1 / 16
_HALF_TURN = 8  # directions in half a turn of two parameters that act by their squares


def directions(count: int) -> list[tuple[float, ...]]:
    """Return sizes of parameters that act by their squares; of two, directions over half a turn."""
    if count == 2:
        return [
            (round(float(np.cos(a)), 12), round(float(np.sin(a)), 12))
            for a in np.pi / _HALF_TURN * np.arange(_HALF_TURN)
        ]
    every = product((-1.0, 0.0, 1.0), repeat=count)
    return [signs for signs in every if next((sign for sign in signs if sign), 0.0) > 0]


def grid_of(parameter: Parameter, span: float) -> list[float]:
    """Return values of a parameter that only shapes an effect; span [s]: of the scans, for a parameter in seconds.

    The longest time comes first: of shapes that are alike the first is kept, and that one is most like a constant.
    Where none is usual, none comes before it.
    """
    if parameter.unit == "s":
        usual = parameter.null or parameter.scale
        longest, shortest = _LONG * usual, _SHORT * min(span, usual)
        values = longest * 2.0 ** -np.arange(0, np.log2(longest / shortest) + 0.1, 0.5)
        if not parameter.null:
            values = np.r_[0.0, values]
    elif parameter.lower > 0:
        values = parameter.null * 2.0 ** np.arange(-3, 1.6, 0.25)
    else:
        values = parameter.null + parameter.scale * np.arange(0, 3.1, 0.5)
    return [float(value) for value in values if parameter.lower <= value <= parameter.upper] or [parameter.null]


def geometric(parameter: Parameter) -> bool:
    """Return whether a parameter's grid is of factors."""
    return parameter.unit == "s" or parameter.lower > 0

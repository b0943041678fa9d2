# SPDX-License-Identifier: BSD-3-Clause
"""What is wrong with recordings that were handed in wrongly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kurumaisu.types import FloatArray

Change = Callable[[FloatArray], FloatArray]
WRONG = (
    *("poses in mm", "ranges in mm", "headings in degrees", "the sign of w", "the sign of x", "axes swapped"),
    *("headings clockwise", "stamps of poses in ms", "the clock of poses some seconds off", "poses of another drive"),
    *("map mirrored", "fan mirrored", "another map", "a drive given twice", "the sign of v", "channels swapped"),
)
POSES: dict[str, Change] = {  # rows of t, x, y, theta
    "poses in mm": lambda p: p * [1, 1000, 1000, 1],
    "headings in degrees": lambda p: np.column_stack([p[:, :3], np.degrees(p[:, 3])]),
    "the sign of x": lambda p: p * [1, -1, 1, 1],
    "axes swapped": lambda p: p[:, [0, 2, 1, 3]],
    "headings clockwise": lambda p: p * [1, 1, 1, -1],
    "stamps of poses in ms": lambda p: p * [1000, 1, 1, 1],
}
COMMANDS: dict[str, Change] = {  # rows of t, v, w
    "the sign of w": lambda r: r * [1, 1, -1],
    "the sign of v": lambda r: r * [1, -1, 1],
    "channels swapped": lambda r: r[:, [0, 2, 1]],
}
RANGES: dict[str, Change] = {"ranges in mm": lambda z: z * 1000, "fan mirrored": lambda z: z[:, ::-1]}


def same(x: FloatArray) -> FloatArray:
    """Return what is not wrong."""
    return x

# SPDX-License-Identifier: BSD-3-Clause
"""Where the beams of a tilted laser point: geometry, which leaves no author a choice."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def tilted(bearing: Array, pitch: float, roll: float) -> tuple[Array, Array]:
    """Return bearings seen from above, and how far down [rad] beams point; pitch: front down, roll: left side down."""
    ahead, left = np.cos(bearing), np.sin(bearing) * np.cos(roll)
    side = np.sin(bearing) * np.sin(roll)
    ahead, down = ahead * np.cos(pitch) - side * np.sin(pitch), ahead * np.sin(pitch) + side * np.cos(pitch)
    return bearing + np.angle((ahead + 1j * left) * np.exp(-1j * bearing)), np.arcsin(down)

# SPDX-License-Identifier: BSD-3-Clause
"""Ranges of height as sets of bits, so that pymunk lets pass what goes over or under each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.sim.motion.rigid import Rigid
from kurumaisu.types import FloatArray

_BITS = 32  # of a pymunk category


class Layers:
    """The bodies' heights cut z into layers, a bit each; two ranges overlap where they share a bit.

    Where bodies have more than 33 different heights, the layers above share the last bit: such bodies may then touch
    though they do not overlap.
    """

    def __init__(self, rigids: Sequence[Rigid], poses: FloatArray) -> None:
        """Cut by the heights of bodies at poses (k, 4); parts: for each body, the bits of each of its parts."""
        ranges = [[part.heights + z for part in rigid.parts] for rigid, z in zip(rigids, poses[:, 2], strict=True)]
        self._cuts = np.unique(np.concatenate([np.empty(0), *(h for part in ranges for h in part)]))
        self.parts = [[self.of(float(low), float(high)) for low, high in part] for part in ranges]

    def of(self, low: float, high: float) -> int:
        """Return the bits of a range of heights [m]; 0 if it overlaps none of the bodies'."""
        bits = 0
        for layer in np.flatnonzero((self._cuts[:-1] < high) & (self._cuts[1:] > low)).tolist():
            bits |= 1 << min(layer, _BITS - 1)
        return bits

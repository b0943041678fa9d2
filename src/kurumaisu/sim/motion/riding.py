# SPDX-License-Identifier: BSD-3-Clause
"""Robots that stand on others: they go along, and drive on what they stand on."""

from __future__ import annotations

import numpy as np

from kurumaisu._core import arcs
from kurumaisu.geometry import attached, relative
from kurumaisu.sim.motion.slip import turned
from kurumaisu.types import BoolArray, FloatArray, IntArray


class Riding:
    """Who rides on whom among bodies (b,), carriers before their riders."""

    def __init__(self, carrier: IntArray, driven: BoolArray) -> None:
        """Let driven ones ride on carrier (b,), -1: the ground; what hangs on a hinge keeps its place in the map."""
        self._pairs = [(row, int(carrier[row])) for row in np.flatnonzero(driven & (carrier >= 0)).tolist()]
        self.rows = np.array([row for row, _ in self._pairs], dtype=np.int64)

    def along(self, velocities: FloatArray, poses: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return velocities (b, 3) that include the carriers', and the poses (b, 4) to which they lead in dt [s].

        A carrier's arc is an arc for all points of it. A rider's is that to where it gets by both motions at once.
        """
        total, ends = velocities.copy(), arcs(poses, velocities, dt)
        for row, below in self._pairs:
            ends[row] = attached(ends[below], relative(poses[below], ends[row]))
            total[row, 2] += total[below, 2]
            half = 0.5 * total[row : row + 1, 2] * dt
            chord = np.append(relative(poses[row], ends[row])[:2], 0.0)[None]
            total[row, :2] = turned(chord, -half)[0, :2] / (np.sinc(half[0] / np.pi) * dt)
        return total, ends

    def held_back(self, expected: FloatArray, poses: FloatArray) -> FloatArray:
        """Return where riders (k, 4) are if their carriers got to poses (b, 4), not to those expected (b, 4)."""
        after = poses.copy()
        for row, below in self._pairs:
            if not np.allclose(expected[below], after[below], rtol=0.0, atol=1e-12):
                after[row] = attached(after[below], relative(expected[below], after[row]))
        return after[self.rows]

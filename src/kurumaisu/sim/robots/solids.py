# SPDX-License-Identifier: BSD-3-Clause
"""What is solid, for rays that feel: another arena of the same bodies, which follows them."""

from __future__ import annotations

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.sim.motion.partition import build_arena
from kurumaisu.sim.robots.machinery import Machinery


class Solids:
    """The solid outlines of a simulator's models."""

    def __init__(self, machinery: Machinery) -> None:
        """Build the arena."""
        start, threads = machinery.population, machinery.options.threads
        self._machinery = machinery
        self._arena, self._numbers, _ = build_arena(start.models, start.poses, machinery.bodies, threads, True)

    def now(self) -> Arena:
        """Return the arena with all bodies where they are."""
        self._arena.set_poses(self._numbers, np.ascontiguousarray(self._machinery.frames[:-1]))
        return self._arena

# SPDX-License-Identifier: BSD-3-Clause
"""Bodies that a step left where they were: the same step again need not be computed."""

from __future__ import annotations

from collections.abc import Callable

from kurumaisu.sim.motion.island import Island, Moving
from kurumaisu.types import BoolArray, IntArray


class Resting:
    """Remembers what islands make of what they are given, where that is nothing; an island is a pure function."""

    def __init__(self, most: int) -> None:
        """Remember so many islands at most."""
        self._most = most
        self._known: dict[bytes, tuple[bytes, BoolArray]] = {}

    def forget(self) -> None:
        """Start anew, because the bodies' shapes have changed."""
        self._known.clear()

    def run(self, rows: IntArray, gather: Callable[[], Island], moving: Moving, seconds: float) -> BoolArray:
        """Do what the run of the island does that gather makes of the bodies in rows."""
        key, given = rows.tobytes(), _content(moving, seconds)
        known = self._known.get(key)
        if known is not None and known[0] == given:
            return known[1]
        stalled = gather().run(moving, seconds)
        self._known.pop(key, None)
        if _content(moving, seconds) == given:
            if len(self._known) >= self._most:
                self._known.clear()
            self._known[key] = given, stalled
        return stalled


def _content(moving: Moving, seconds: float) -> bytes:
    arrays = moving.poses, moving.velocities, moving.commands, moving.hindered
    return b"".join(array.tobytes() for array in arrays) + seconds.hex().encode()

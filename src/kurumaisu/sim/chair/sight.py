# SPDX-License-Identifier: BSD-3-Clause
"""What the chair's laser sees of a world in motion, beam by beam at its own time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from kurumaisu.geometry import between, interpolate
from kurumaisu.sim.chair.world import ChairWorld
from kurumaisu.types import FloatArray, IntArray

# Parts of a step in which others count as standing, at where they are in its middle: what moves at 1.5 m/s is off by
# at most 2 mm for steps of 10 ms.
_PARTS = 4


class Sight:
    """Remembers where the chair and all others were, for beams that are fired before the scan is made."""

    def __init__(self, world: ChairWorld) -> None:
        self._world = world
        self._times: list[float] = []
        self._chair: list[FloatArray] = []
        self._frames: list[FloatArray] = []  # of all bodies, if there are others; the chair's, which is unseen, are 0

    def note(self, time: float, pose: FloatArray) -> None:
        """Note where all are now, times increasing [s]; pose (3,): the chair's."""
        self._times.append(time)
        self._chair.append(pose)
        if not self._world.alone:
            self._frames.append(self._others())

    def forget(self, before: float) -> None:
        """Drop what no beam from a time on needs: all but the last pose that is not after it."""
        keep = max(0, int(np.searchsorted(self._times, before, side="right")) - 1)
        del self._times[:keep], self._chair[:keep], self._frames[:keep]

    def enter(self, world: ChairWorld) -> None:
        """Look at another world with the same bodies, all of which are where they were."""
        self._world = world

    def restart(self) -> None:
        """Forget where the others were, as some have come or been put elsewhere; the chair's way stays."""
        self._frames = [] if self._world.alone else [self._others()] * len(self._times)

    def poses(self, times: FloatArray) -> FloatArray:
        """Return where the chair was (n, 3), at times (n,)."""
        return interpolate(np.array(self._times), np.array(self._chair), times)

    def rates(self) -> dict[str, float]:
        """Return how the chair has moved in the time that is remembered, v [m/s] and w [rad/s]; none of a moment."""
        span = self._times[-1] - self._times[0]
        if span <= 0:
            return {}
        ahead, _, turned = (between(self._chair[0], self._chair[-1]) / span).tolist()
        return {"v": ahead, "w": turned}

    def look(self, times: FloatArray, height: float) -> Look:
        """Return what is to be seen at times (n,) from so far above the chair's base [m]."""
        return Look(self._world, height, [] if self._standing() else list(self._moments(times)))

    def state(self) -> dict[str, Any]:
        """Return all that is remembered."""
        return {"times": list(self._times), "chair": list(self._chair), "frames": list(self._frames)}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self._times, self._chair, self._frames = (list(state[name]) for name in ("times", "chair", "frames"))

    def _moments(self, times: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield rows of times, and where the bodies (b, 4) then were."""
        known, width = np.array(self._times), self._world.step / _PARTS
        parts = np.floor((times - known[0]) / width)
        order = np.argsort(parts, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(parts[order])) + 1):
            yield rows, self._then(known, float(known[0] + (parts[rows[0]] + 0.5) * width))

    def _standing(self) -> bool:
        """Return whether all but the chair are still where they were."""
        return all((frames == self._frames[-1]).all() for frames in self._frames[:-1])

    def _others(self) -> FloatArray:
        frames: FloatArray = self._world.machinery.frames[:-1].copy()
        frames[self._world.body] = 0.0
        return frames

    def _then(self, known: FloatArray, time: float) -> FloatArray:
        """Return where the bodies (b, 4) were."""
        after = min(max(int(np.searchsorted(known, time)), 1), len(known) - 1)
        old, new = self._frames[after - 1], self._frames[after]
        share = min(max((time - known[after - 1]) / (known[after] - known[after - 1]), 0.0), 1.0)
        way = new - old
        way[:, 3] -= math.tau * np.rint(way[:, 3] / math.tau)
        return np.asarray(old + share * way)


class Look:
    """Rays of one scan; the chair is invisible to them."""

    def __init__(self, world: ChairWorld, height: float, moments: list[tuple[IntArray, FloatArray]]) -> None:
        """Look from so far above the chair's base [m]; moments: rows of beams and where the bodies (b, 4) then were.

        Without moments all are where they are now.
        """
        self._world = world
        self._z = float(world.machinery.frames[world.body, 2]) + height
        self._moments = moments

    def ranges(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return ranges (n,) [m] of level beams from poses (n, 3) along bearings (n,) [rad]; +inf: nothing there."""
        return self.cast(poses, bearings)[0]

    def cast(self, poses: FloatArray, bearings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges as above, and the reflectance (n,) of what is met; 0 where that is nothing."""
        machinery = self._world.machinery
        arena, count = machinery.arena, len(bearings)
        origins = np.empty((count, 4))
        origins[:, :2] = poses[:, :2]
        origins[:, 2] = self._z
        np.add(poses[:, 2], bearings, out=origins[:, 3])
        trees = np.full(count, self._world.tree)
        if not self._moments:
            return arena.cast(origins, trees, math.inf)
        ranges, returns = np.empty(count), np.empty(count)
        for rows, frames in self._moments:
            arena.set_poses(machinery.numbers, frames)
            ranges[rows], returns[rows] = arena.cast(origins[rows], trees[rows], math.inf)
        arena.set_poses(machinery.numbers, np.ascontiguousarray(machinery.frames[:-1]))
        return ranges, returns

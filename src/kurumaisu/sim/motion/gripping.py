# SPDX-License-Identifier: BSD-3-Clause
"""Grippers: what is between the paddles when they close becomes a part of its holder until they open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu._core import Clearance
from kurumaisu.geometry import PLANAR, compose, relative
from kurumaisu.sim.motion.rigid import Part, Rigid, joined, moved
from kurumaisu.types import BoolArray, FloatArray, IntArray

NOBODY = -1


class Grips:
    """Who holds whom, among the pieces of a world.

    rigids: the pieces as they now are: holders with what they hold, held ones without parts of their own;
    holders (b,): who holds each piece, or NOBODY; offsets (b, 4): its centre as seen from the holder's centre.
    """

    def __init__(self, rigids: Sequence[Rigid], clearance: Clearance, numbers: IntArray) -> None:
        """Hold nothing; clearance knows the pieces by numbers (b,)."""
        self._free = tuple(rigids)
        self._clearance = clearance
        self._numbers = numbers
        self.rigids = list(rigids)
        self.holders = np.full(len(rigids), NOBODY, dtype=np.int64)
        self.offsets = np.zeros((len(rigids), 4))

    @property
    def held(self) -> BoolArray:
        """Which pieces (b,) somebody holds."""
        return np.asarray(self.holders != NOBODY)

    def close(self, holder: int, poses: FloatArray) -> bool:
        """Take what is between the paddles, the nearest if there are many; return whether anything is held.

        Only pieces whose world file gives them a gripper_return can be taken, and by one holder at a time.
        """
        jaws = self._free[holder].jaws
        if jaws is None or (self.holders == holder).any():
            return bool((self.holders == holder).any())
        found = [row for row in range(len(poses)) if row != holder and self._can_take(row, jaws, poses, holder)]
        if not found:
            return False
        middle = moved(jaws.corners.mean(axis=0)[None], poses[holder])[0]
        row = min(found, key=lambda row: float(np.hypot(*(poses[row, :2] - middle))))
        offset = relative(poses[holder], poses[row])
        self._set(row, holder, offset)
        return True

    def open(self, holder: int) -> IntArray:
        """Let go; return the rows of what was held."""
        rows = np.flatnonzero(self.holders == holder)
        for row in rows.tolist():
            self._set(row, NOBODY, np.zeros(4))
        return rows

    def carry(self, poses: FloatArray) -> None:
        """Put what is held where its holder has taken it, in place."""
        rows = np.flatnonzero(self.held)
        carriers = poses[self.holders[rows]]
        x, y, heading = compose(carriers[:, PLANAR], self.offsets[rows][:, PLANAR]).T
        poses[rows, 0], poses[rows, 1], poses[rows, 3] = x, y, heading
        poses[rows, 2] = carriers[:, 2] + self.offsets[rows, 2]

    def restore(self, holders: IntArray, offsets: FloatArray) -> None:
        """Go back to who held what."""
        for row in range(len(self.holders)):
            if self.holders[row] != holders[row] or (self.offsets[row] != offsets[row]).any():
                former = int(self.holders[row])
                self._set(row, int(holders[row]), offsets[row])
                if former != NOBODY:
                    self._rebuild(former)

    def _can_take(self, row: int, jaws: Part, poses: FloatArray, holder: int) -> bool:
        piece = self._free[row]
        if not piece.grippable or piece.driven or piece.pivot is not None or self.holders[row] != NOBODY:
            return False
        seen = relative(poses[holder], poses[row])
        return any(_overlap(Part(moved(p.corners, seen), p.heights + seen[2]), jaws) for p in piece.parts)

    def _set(self, row: int, holder: int, offset: FloatArray) -> None:
        former = int(self.holders[row])
        self.holders[row], self.offsets[row] = holder, offset
        for changed in {row, holder, former} - {NOBODY}:
            self._rebuild(changed)

    def _rebuild(self, row: int) -> None:
        piece = self._free[row]
        if self.holders[row] != NOBODY:
            piece = piece.without_body()
        else:
            held = [(self._free[i], self.offsets[i]) for i in np.flatnonzero(self.holders == row).tolist()]
            piece = joined(piece, held) if held else piece
        self.rigids[row] = piece
        self._clearance.replace_body(int(self._numbers[row]), piece.edges)


def _overlap(a: Part, b: Part) -> bool:
    """Return whether two convex prisms overlap: no edge's normal separates them."""
    if a.heights[0] >= b.heights[1] or b.heights[0] >= a.heights[1]:
        return False
    edges = np.concatenate([np.roll(part.corners, -1, axis=0) - part.corners for part in (a, b)])
    normals = np.stack([edges[:, 1], -edges[:, 0]])
    along_a, along_b = a.corners @ normals, b.corners @ normals
    return bool(((along_a.max(0) > along_b.min(0)) & (along_b.max(0) > along_a.min(0))).all())

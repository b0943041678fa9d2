# SPDX-License-Identifier: BSD-3-Clause
"""What follows nothing: a rate that is off by as much wherever, whenever and however the chair moves.

Without it, some curve or other over what hardly matters would be taken for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.unknown.bases import FINER, Basis
from kurumaisu.types import FloatArray

OFFSET_CHANNELS = (
    "v",
    "lateral",
    "w",
)  # a share of a rate that is off by as much everywhere is a gain of the catalogue


@dataclass(frozen=True)
class Offset(Basis):
    """One number. What it is pictured over is the time, between low and high."""

    @property
    def size(self) -> int:
        """Return the number of coefficients."""
        return 1

    def samples(self, motion: effects.Motion) -> FloatArray:
        """Return the time since the start (n,) [s]."""
        return effects.Follower("time", 0.0).values(motion)

    def matrix(self, at: FloatArray) -> FloatArray:
        """Return ones, (n, 1)."""
        return np.ones((len(at), 1))

    def finer(self, times: int = FINER) -> Basis:
        """Return the same: a number has no knots between its knots."""
        return self

    def parameters(self, coefficients: FloatArray) -> dict[str, float]:
        """Return the parameters as a model file has them."""
        return {"knot_0": 0.0, "value_0": float(coefficients[0])}


def constant_offset(seconds: float) -> Offset:
    """Return the number, as known of drives of so many seconds."""
    return Offset(effects.MOVING, np.empty(0), {}, (np.eye(1),), 0.0, seconds)

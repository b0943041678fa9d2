# SPDX-License-Identifier: BSD-3-Clause
"""A person at the joystick who shows what the chair does: speeds, turns, reversals, rests."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

_REST, _REVERSE, _STRAIGHT = 0.15, 0.15, 0.25  # shares of the time


def joystick(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands (n, 3) of t [s], v [m/s], w [rad/s], each held for 0.8 to 3 s; the last one is rest."""
    rows, t = [], 0.0
    while t < seconds:
        kind = rng.random()
        v = 0.0 if kind < _REST else rng.uniform(0.15, 0.7) * (-1 if kind > 1 - _REVERSE else 1)
        w = 0.0 if rng.random() < _STRAIGHT else rng.uniform(0.1, 0.7) * rng.choice([-1, 1])
        rows.append((t, v, w))
        t += rng.uniform(0.8, 3.0)
    rows.append((seconds, 0.0, 0.0))
    return np.array(rows)

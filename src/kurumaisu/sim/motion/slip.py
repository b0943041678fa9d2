# SPDX-License-Identifier: BSD-3-Clause
"""Wheel slip: wheels spin or slide where a command asks for more acceleration than the floor gives."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray


def hold(before: FloatArray, wanted: FloatArray, most: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return the mean rates over a step of dt [s] and those at its end, each (n, 3): forward, leftward, turn.

    From the rates before towards those wanted, with at most so much acceleration, (n, 2) [m/s^2, rad/s^2]: evenly
    until they are reached. A wheel's odometer shows those wanted all the time.
    """
    mean, after = np.empty_like(before), np.empty_like(before)
    for columns, limit in ((slice(0, 2), most[:, :1]), (slice(2, 3), most[:, 1:])):
        change = wanted[:, columns] - before[:, columns]
        size = np.hypot.reduce(change, axis=1, keepdims=True)
        needed = np.divide(size, limit, out=np.full_like(size, np.inf), where=limit > 0)
        needed[size == 0] = 0.0
        share = np.divide(dt, needed, out=np.ones_like(needed), where=needed > dt)
        end = np.where(share < 1, before[:, columns] + share * change, wanted[:, columns])
        after[:, columns] = end
        mean[:, columns] = end - (end - before[:, columns]) * np.minimum(needed, dt) / (2 * dt)
    return mean, after


def turned(rates: FloatArray, headings: FloatArray) -> FloatArray:
    """Return rates (n, 3) of frames with these headings [rad] in the frame that the headings are in."""
    c, s = np.cos(headings), np.sin(headings)
    x, y = rates[:, 0], rates[:, 1]
    return np.stack([c * x - s * y, s * x + c * y, rates[:, 2]], axis=1)

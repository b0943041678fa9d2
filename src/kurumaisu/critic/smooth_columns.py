# SPDX-License-Identifier: BSD-3-Clause
"""How the increments of a drive change when a rate changes by a curve: the derivative of equation (3)."""

from __future__ import annotations

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.drive import GRID, Drive
from kurumaisu.sim import plant
from kurumaisu.types import FloatArray


class Sensitivity:
    """The derivative of a drive's body increments by rates that are added to its motion while the chair moves."""

    def __init__(self, drive: Drive, motion: effects.Motion) -> None:
        poses = plant.path(motion, np.array([0.0, 0.0, motion.heading or 0.0]))
        edges = drive.start + GRID * np.arange(len(poses))
        self._moving = ((motion.v != 0) | (motion.w != 0)).astype(float)[:, None]
        self._rates = {"v_gain": motion.v[:, None], "w_gain": motion.w[:, None]}
        self._heading = 0.5 * (poses[:-1, 2] + poses[1:, 2])
        self._steps = np.diff(poses[:, :2], axis=0)
        # Interpolation of anything summed over the grid at the reference's times: two weights each.
        place = np.clip((drive.times - edges[0]) / GRID, 0, len(poses) - 1)
        self._below = np.minimum(place.astype(int), len(poses) - 2)
        self._share = (place - self._below)[:, None]
        self._positions = self._at(poses[:, :2])
        self._headings = self._at(poses[:, 2:])[:, 0]

    def increments(self, channel: str, rates: FloatArray) -> FloatArray:
        """Return the change of the increments by rates (n, k) added to a channel, or by factors less 1; (3 m, k)."""
        rates = rates * self._moving * GRID * self._rates.get(channel, 1.0)
        if channel.startswith("w"):
            return self._turned(rates)
        heading = (self._heading + (np.pi / 2 if channel == "lateral" else 0.0))[:, None]
        x, y = (self._differences(_sum(rates * side(heading))) for side in (np.cos, np.sin))
        return self._in_body(x, y, np.zeros_like(x))

    def _turned(self, turns: FloatArray) -> FloatArray:
        """Return the change by turns (n, k) [rad]: what lies ahead of a turn swings round it."""
        total = _sum(turns)
        middle = 0.5 * (total[:-1] + total[1:])
        at = self._at(total)
        way = np.diff(self._positions, axis=0)
        x = self._differences(_sum(-middle * self._steps[:, 1:])) + at[:-1] * way[:, 1:]
        y = self._differences(_sum(middle * self._steps[:, :1])) - at[:-1] * way[:, :1]
        return self._in_body(x, y, np.diff(at, axis=0))

    def _in_body(self, x: FloatArray, y: FloatArray, turn: FloatArray) -> FloatArray:
        cos, sin = np.cos(self._headings[:-1, None]), np.sin(self._headings[:-1, None])
        stacked = np.stack([cos * x + sin * y, -sin * x + cos * y, turn], axis=1)
        return np.asarray(stacked.reshape(-1, x.shape[1]))

    def _at(self, values: FloatArray) -> FloatArray:
        low, high = values[self._below], values[self._below + 1]
        return np.asarray(low + self._share * (high - low))

    def _differences(self, sums: FloatArray) -> FloatArray:
        return np.asarray(np.diff(self._at(sums), axis=0))


def _sum(steps: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])

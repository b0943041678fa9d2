# SPDX-License-Identifier: BSD-3-Clause
"""Where robots believe they are: Stage's gps and odom localization, quirks included, all robots at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.geometry import PLANAR, between, compose, wrap
from kurumaisu.sim.options import OdometryWalk
from kurumaisu.sim.robots.drive import Rows
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Position

# Largest shares of x, y and heading that Stage draws where the world file gives no odom_error; drawn within +-half.
_DEFAULT_ERROR = np.array([0.03, 0.03, 0.05])


class StageLocalization:
    """Estimates poses (n, 3).

    gps: the true pose in the map at the robot's last update; before the first one, relative to localization_origin.
    odom: integrates wanted velocities, whether or not the robot got anywhere, along the heading after the turn, whereas
    Stage moves robots along the heading before it.
    """

    def __init__(
        self, robots: Sequence[Position], starts: FloatArray, interval: float, walk: OdometryWalk, exact: bool
    ) -> None:
        """Start robots that are at poses (n, 4); interval [s] of a step.

        exact: integrate arcs, and gps is in the map from the start.
        """
        self._interval = interval
        self._advance = advance_on_arc if exact else advance
        origins = starts[:, PLANAR].copy()
        for i, robot in enumerate(robots):
            if robot.localization_origin is not None:
                origins[i] = robot.localization_origin[PLANAR]
        self.estimates = between(origins, starts[:, PLANAR])
        self.estimates[:, 2] = wrap(self.estimates[:, 2])
        self.shares = np.zeros((len(robots), 3))
        self._given = np.array([robot.odom_error is not None for robot in robots], dtype=np.bool_)
        for i, robot in enumerate(robots):
            if robot.odom_error is not None:
                self.shares[i] = robot.odom_error[PLANAR]
        self._odom = np.array([robot.localization == "odom" for robot in robots], dtype=np.bool_)
        if exact:
            self.estimates[~self._odom] = starts[~self._odom][:, PLANAR]
        self.all_gps = bool(not self._odom.any())
        self._walk = walk

    def draw_errors(self, rng: np.random.Generator, whose: BoolArray | None = None) -> None:
        """Draw the shares of error of those (n,) whose world file gives none."""
        drawn = rng.uniform(-_DEFAULT_ERROR / 2, _DEFAULT_ERROR / 2, (len(self._given), 3))
        chosen = ~self._given if whose is None else ~self._given & whose
        np.copyto(self.shares, drawn, where=chosen[:, np.newaxis])

    def believed(self) -> FloatArray:
        """Return the estimates (n, 3), NaN of those that are told where they are."""
        return np.where(self._odom[:, np.newaxis], self.estimates, np.nan)

    def update(self, due: Rows, poses: FloatArray, velocities: FloatArray, rng: np.random.Generator) -> None:
        """Update those due; poses (n, 4) are true; velocities (n, 3) wanted [m/s, rad/s].

        A robot that is updated every few steps still integrates only one, as in Stage.
        """
        if self.all_gps and isinstance(due, slice):
            self.estimates[:, :2] = poses[:, :2]
            self.estimates[:, 2] = poses[:, 3]
            return
        is_due = np.zeros(len(self._odom), dtype=np.bool_)
        is_due[due] = True
        gps, odom = np.flatnonzero(is_due & ~self._odom), np.flatnonzero(is_due & self._odom)
        self.estimates[gps] = poses[gps][:, PLANAR]
        if len(odom):
            self._integrate(odom, velocities[odom] * self._interval, rng)

    def _integrate(self, rows: IntArray, wanted: FloatArray, rng: np.random.Generator) -> None:
        step = wanted * (1.0 + self.shares[rows])
        if not self._walk.off:
            step += self._stray(step) * rng.standard_normal(step.shape)
        self.estimates[rows] = self._advance(self.estimates[rows], step)

    def _stray(self, step: FloatArray) -> FloatArray:
        """Return standard deviations (n, 3) of a step (n, 3)."""
        way, turn = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
        along = self._walk.distance * np.sqrt(way)
        heading = np.sqrt(self._walk.heading_per_metre**2 * way + self._walk.heading_per_radian**2 * turn)
        return np.stack([along, along, heading], axis=-1)


def advance(poses: FloatArray, step: FloatArray) -> FloatArray:
    """Return poses (n, 3) after a step (n, 3) of their own frame: Stage's odometry turns first, then drives."""
    turned = poses.copy()
    turned[:, 2] = wrap(poses[:, 2] + step[:, 2])
    return compose(turned, step * [1.0, 1.0, 0.0])


def advance_on_arc(poses: FloatArray, step: FloatArray) -> FloatArray:
    """Return poses (n, 3) after a step (n, 3) at constant velocity: an exact arc."""
    half = step[:, 2] / 2
    chord = step * np.stack([np.sinc(half / np.pi)] * 2 + [np.ones(len(half))], axis=-1)
    halfway = poses.copy()
    halfway[:, 2] += half
    end = compose(halfway, chord)
    end[:, 2] = wrap(poses[:, 2] + step[:, 2])
    return end

# SPDX-License-Identifier: BSD-3-Clause
"""Follow waypoints: what a person does who sees where the chair is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import geometry, settings
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Route:
    """Waypoints (n, 2) [m] in the map frame and the manner of driving.

    speed [m/s] straight ahead; turn [rad/s] at most; gain [1/s] of turn per heading error; reach [m] within which a
    waypoint counts as passed; pause [s] at rest before and after; deadline [s] for the whole route.
    """

    waypoints: FloatArray
    speed: float
    turn: float
    gain: float
    reach: float
    pause: float
    deadline: float


def read_route(section: settings.Section) -> Route:
    """Return the route of a settings section. Raise Error naming file and key."""
    points = section.items("waypoints")
    waypoints = np.array([[point.number("x"), point.number("y")] for point in points])
    if not points:
        raise section.error("waypoints", "must name at least one point")
    for point in points:
        point.end()
    numbers = {name: section.number(name, above=0) for name in ("speed", "turn", "gain", "reach", "pause", "deadline")}
    section.end()
    return Route(waypoints, **numbers)


def load_route(path: Path) -> Route:
    """Read a route file. Raise Error naming file and key."""
    return read_route(settings.load(path))


class RouteFollower:
    """Goes through the waypoints of a route in order."""

    def __init__(self, route: Route) -> None:
        self._route = route
        self._passed = 0

    @property
    def done(self) -> bool:
        """True when the last waypoint has been passed."""
        return self._passed >= len(self._route.waypoints)

    def command(self, pose: FloatArray) -> tuple[float, float]:
        """Return v [m/s], w [rad/s] at a pose (3,) in the map frame; rest when done."""
        while not self.done and self._distance(pose) < self._route.reach:
            self._passed += 1
        if self.done:
            return 0.0, 0.0
        target = self._route.waypoints[self._passed] - pose[:2]
        error = float(geometry.wrap(np.arctan2(target[1], target[0]) - pose[2]))
        w = float(np.clip(self._route.gain * error, -self._route.turn, self._route.turn))
        return self._route.speed * max(np.cos(error), 0.0) ** 2, w

    def _distance(self, pose: FloatArray) -> float:
        return float(np.hypot(*(self._route.waypoints[self._passed] - pose[:2])))

# SPDX-License-Identifier: BSD-3-Clause
"""Follow waypoints, or drive to a pose: what a person does who sees where the chair is."""

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


@dataclass(frozen=True)
class Manner:
    """How to drive to a pose: gain [1/s] of speed per distance and of turn per heading error.

    reach [m], aim [rad]: how far place and heading may be off at the end; patience [s] without coming closer.
    """

    gain: float
    reach: float
    aim: float
    patience: float


class PoseFollower:
    """Turns to a goal, drives straight there, slower and slower, and turns to its heading; it goes round nothing."""

    def __init__(self, goal: FloatArray, manner: Manner, speed: float, turn: float) -> None:
        """Drive to a goal (3,) in the map frame; speed [m/s] and turn [rad/s] at most."""
        self._goal, self._manner = goal, manner
        self._speed, self._turn = speed, turn
        self._there = False  # only the heading is left
        self._best = np.inf  # what was left to do at most [m or rad], and since when [s]
        self._since = 0.0
        self.done = False

    def command(self, pose: FloatArray, now: float) -> tuple[float, float]:
        """Return v [m/s], w [rad/s] at a pose (3,) in the map frame; now [s]. Rest when done."""
        way = self._goal[:2] - pose[:2]
        distance, manner = float(np.hypot(*way)), self._manner
        there = distance < (2 * manner.reach if self._there else manner.reach)  # it may slip while it turns
        if there != self._there:
            self._there, self._best = there, np.inf
        aim = self._goal[2] if self._there else np.arctan2(way[1], way[0])
        error = float(geometry.wrap(aim - pose[2]))
        self.done = self.done or (self._there and abs(error) < manner.aim)
        if self.done:
            return 0.0, 0.0
        self._judge((0.0 if self._there else distance) + abs(error), now)
        v = 0.0 if self._there else min(self._speed, manner.gain * distance) * max(np.cos(error), 0.0) ** 2
        return float(v), float(np.clip(manner.gain * error, -self._turn, self._turn))

    def gave_up(self, now: float) -> bool:
        """Return whether it has not come closer for too long, at a time [s]."""
        return now - self._since > self._manner.patience

    def _judge(self, left: float, now: float) -> None:
        if left < self._best - self._manner.reach / 2 or not np.isfinite(self._best):
            self._best, self._since = left, now

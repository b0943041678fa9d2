# SPDX-License-Identifier: BSD-3-Clause
"""Simulated against wall time."""

from __future__ import annotations

import time

from kurumaisu.plausible import require
from kurumaisu.sim.live.requests import Requests

_GLANCE = 0.1  # [s] a wait lasts at most: a step may take hours, and its caller has more to look after
_BEHIND = 0.2  # [s] too far behind to catch up in one burst


class Pacer:
    """Holds simulated time to a multiple of wall time."""

    def __init__(self, speed: float) -> None:
        """speed: simulated seconds per wall second; 0: as fast as possible. Raise Error for one that makes no sense."""
        self._speed = checked_speed(speed)
        self._due = time.monotonic()

    @property
    def speed(self) -> float:
        """Simulated seconds per wall second."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        """Go on at another speed, what is left of the step under way included."""
        now = time.monotonic()
        left = max(self._due - now, 0.0) * self._speed  # of simulated time
        self._speed = checked_speed(speed)
        self._due = now + left / speed if speed > 0 else now

    def step(self, step: float) -> None:
        """Note a step [s] of simulated time, after which the next one is due."""
        now = time.monotonic()
        self._due = self._due + step / self._speed if self._speed > 0 else now
        if self._due < now - _BEHIND:
            self._due = now

    def wait(self, requests: Requests) -> bool:
        """Wait until the next step is due or something is asked for, but not for long. Return whether it is due."""
        left = self._due - time.monotonic()
        if left > 0:
            requests.wait(min(left, _GLANCE))
        return time.monotonic() >= self._due


def checked_speed(speed: float) -> float:
    """Return a speed. Raise Error unless it is 0, as fast as possible, or makes sense."""
    return speed if speed == 0 else require("simulation speed", "speed (0: as fast as possible)", speed)

# SPDX-License-Identifier: BSD-3-Clause
"""Simulated against wall time."""

import time


class Pacer:
    """Holds simulated time to a multiple of wall time."""

    def __init__(self, speed: float) -> None:
        """speed: simulated seconds per wall second; 0: as fast as possible."""
        self.speed = speed
        self._due = time.monotonic()

    def wait(self, step: float) -> None:
        """Sleep until a step [s] of simulated time may end."""
        if self.speed == 0:
            return
        now = time.monotonic()
        self._due += step / self.speed
        if self._due < now - 0.2:  # [s] too far behind to catch up in one burst
            self._due = now
        if self._due > now:
            time.sleep(self._due - now)

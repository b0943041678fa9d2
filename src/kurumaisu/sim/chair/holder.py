# SPDX-License-Identifier: BSD-3-Clause
"""What the D/A converter holds while simulated time runs."""

from __future__ import annotations

import math
from collections import deque

from kurumaisu.errors import Error
from kurumaisu.sim.chair.simulator import NEUTRAL, Command


class VoltageHolder:
    """Holds each command from its stamp until the next one's, for ever if none comes: so does the hardware.

    Which command acts in a step depends on stamps alone, if the commands come before their time; one that is
    late acts from the next step on. Times are whole nanoseconds.
    """

    _REMEMBERED = 8  # gaps between stamps

    def __init__(self) -> None:
        self._gaps: deque[int] = deque(maxlen=self._REMEMBERED)
        self._waiting: deque[tuple[int, Command]] = deque()
        self._held = NEUTRAL
        self.newest: int | None = None  # stamp of the newest command put

    def put(self, stamp: int, command: Command) -> None:
        """Add a command that is to act from its stamp on. Raise Error if it is unusable."""
        if not (math.isfinite(command.v_f) and math.isfinite(command.v_s)):
            raise Error(f"voltages: not finite: {command.v_f} V, {command.v_s} V")
        if self.newest is not None and stamp < self.newest:
            raise Error(f"voltages: stamp {stamp} ns is older than the last one, {self.newest} ns")
        if self.newest is not None and stamp > self.newest:
            self._gaps.append(stamp - self.newest)
        self.newest = stamp
        self._waiting.append((stamp, command))

    def at(self, time: int) -> Command:
        """Return the command that acts in the step that begins at a time; times must not decrease."""
        while self._waiting and self._waiting[0][0] <= time:
            self._held = self._waiting.popleft()[1]
        return self._held

    def is_due(self, time: int, lead: int) -> bool:
        """Whether the next command should be here at a time: the usual gap has passed since the last, or the lead."""
        if self.newest is None:
            return False
        return time - self.newest >= min(lead, max(self._gaps, default=lead))

    def clear(self) -> None:
        """Go back to neutral."""
        self._waiting.clear()
        self._held = NEUTRAL
        self._gaps.clear()
        self.newest = None

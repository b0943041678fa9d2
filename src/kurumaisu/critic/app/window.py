# SPDX-License-Identifier: BSD-3-Clause
"""The last minutes of a robot that is running, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.app.arrays import run_of
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.values.recording import Fan, Run
from kurumaisu.types import FloatArray

_OVERHEAD = 240  # bytes that a row takes beside its numbers, measured with tracemalloc and rounded up
_JUMP = 1.0  # [s] back from which the clock was set, or a simulation began anew; less is a late message
_SEVERAL = 3  # rows of a part in a row that are so old: one alone is a mistake


@dataclass(frozen=True)
class Heard:
    """What is known of a topic: rows kept, seconds that they span, and time of the newest, None when never heard."""

    rows: int
    span: float
    newest: float | None


class Window:
    """Rows of each part, by the time at which they were measured.

    seconds: rows older than that, by the newest row of any part, are forgotten; limit: bytes that a part may take, so
    that its window is shorter where its rows come too fast.
    """

    def __init__(self, parts: Sequence[str], seconds: float, limit: int) -> None:
        self._seconds = seconds
        self._limit = limit
        self._rows: dict[str, deque[tuple[float, FloatArray]]] = {part: deque() for part in parts}
        self._newest = -np.inf
        self._old = dict.fromkeys(parts, 0)  # rows in a row that were too old
        self._fan: Fan | None = None

    def add(self, part: str, t: float, row: Sequence[float] | FloatArray) -> None:
        """Take a row measured at t [s]; several of a clock that was set back forget all others, one is left out."""
        rows = self._rows[part]
        self._old[part] = self._old[part] + 1 if rows and t < rows[-1][0] - _JUMP else 0
        if 0 < self._old[part] < _SEVERAL:
            return
        if self._old[part]:
            self.clear()
        values = np.array(row, dtype=np.float64)
        rows.append((t, values))
        self._newest = max(self._newest, t)
        self._forget()
        while len(rows) * (_OVERHEAD + values.nbytes) > self._limit:
            rows.popleft()

    def see(self, fan: Fan) -> None:
        """Take scans of a fan from now on: another one than before, as after a driver's restart, forgets theirs."""
        if fan != self._fan:
            self._rows["scan"].clear()
            self._fan = fan

    def add_received(self, part: str, t: float, row: Sequence[float] | FloatArray) -> None:
        """Take a row without a stamp, received at t [s].

        A simulation's clock has ticks, and may stand: what comes within one is no copy, and the last of it holds.
        """
        rows = self._rows[part]
        if rows and rows[-1][0] == t:
            rows.pop()
        self.add(part, t, row)

    def clear(self) -> None:
        """Forget all."""
        for rows in self._rows.values():
            rows.clear()
        self._old = dict.fromkeys(self._rows, 0)
        self._newest = -np.inf

    def heard(self, part: str) -> Heard:
        """Return what is known of a part."""
        rows = self._rows[part]
        if not rows:
            return Heard(0, 0.0, None)
        return Heard(len(rows), rows[-1][0] - rows[0][0], rows[-1][0])

    def run(self, name: str, faults: Faults) -> Run:
        """Return what is kept as a run, cleaned as tables are; a single row of a part says too little."""
        tables = {part: np.array([[t, *row] for t, row in rows]) for part, rows in self._rows.items() if len(rows) > 1}
        return replace(run_of(name, tables, faults), fan=self._fan)

    def _forget(self) -> None:
        for part, rows in self._rows.items():
            # What is held until the next row holds from before the window on: one such row stays.
            held = part in ("command", "voltage")
            while len(rows) > held and rows[held][0] < self._newest - self._seconds:
                rows.popleft()

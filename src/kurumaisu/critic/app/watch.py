# SPDX-License-Identifier: BSD-3-Clause
"""Criticise what was last heard, again and again, in a process of its own; what is kept of it, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.critic import pipeline
from kurumaisu.critic.app.arrays import run_of
from kurumaisu.critic.app.job import why_none
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.processes.worker import ProgressMessage, Worker
from kurumaisu.critic.values.recording import Fan, Recording, Run
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.types import FloatArray

_SEED = 1  # of the particle filter that makes a missing reference
_LONGEST = 300.0  # [s] after which a criticism is given up
_OVERHEAD = 240  # bytes that a row takes beside its numbers, measured with tracemalloc and rounded up
_JUMP = 1.0  # [s] back from which the clock was set, or a simulation began anew; less is a late message
_SEVERAL = 3  # rows of a part in a row that are so old: one alone is a mistake


@dataclass(frozen=True)
class WatchedCriticism:
    """The answer about a window: a verdict and its headline, or why there is none."""

    verdict: Verdict | None
    headline: str


def criticise(
    recording: Recording, model: Path, ids: frozenset[str] | None, progress: Callable[[str], None]
) -> WatchedCriticism:
    """Return the answer about a recording in memory, writing nothing."""
    try:
        found = pipeline.criticise(with_reference(recording, _SEED, progress), model, progress, ids=ids)
    except Exception as error:  # a window that nobody foresaw must not end the watch
        return WatchedCriticism(None, why_none(error))
    return WatchedCriticism(found.verdict, found.story.headline)


class ContinuousCritic:
    """One criticism at a time; ask from time to time whether it is done. Times are of any steady clock [s]."""

    def __init__(self, model: Path, ids: frozenset[str] | None) -> None:
        self._model = model
        self._ids = ids
        self._worker = Worker()
        self._since: float | None = None

    @property
    def busy(self) -> bool:
        """Whether a criticism is under way."""
        return self._since is not None

    def start(self, recording: Recording, now: float) -> None:
        """Begin one; none may be under way."""
        assert not self.busy
        self._worker.send(criticise, recording, self._model, self._ids)
        self._since = now

    def answer(self, now: float) -> WatchedCriticism | None:
        """Return the answer once it is there."""
        while self._since is not None and self._worker.connection.poll():
            try:
                said = self._worker.receive()
            except EOFError:
                return self._renew(f"no verdict: {self._worker.died_of()}")
            if not isinstance(said, ProgressMessage):
                self._since = None
                assert isinstance(said, WatchedCriticism)
                return said
        if self._since is not None and now - self._since > _LONGEST:
            return self._renew(f"no verdict: given up after {_LONGEST:g} s")
        return None

    def close(self) -> None:
        """End its process."""
        self._worker.close()

    def _renew(self, words: str) -> WatchedCriticism:
        self._worker.close()
        self._worker, self._since = Worker(), None
        return WatchedCriticism(None, words)


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

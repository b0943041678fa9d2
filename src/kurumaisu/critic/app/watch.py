# SPDX-License-Identifier: BSD-3-Clause
"""Criticise what was last heard, again and again, in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.critic import pipeline
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.processes.worker import ProgressMessage, Worker
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error, one_line

_SEED = 1  # of the particle filter that makes a missing reference
_LONGEST = 300.0  # [s] after which a criticism is given up


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
    except Error as error:
        return WatchedCriticism(None, one_line(error))
    except Exception as error:  # a window that nobody foresaw must not end the watch
        return WatchedCriticism(None, f"the critic itself failed: {type(error).__name__}: {error}")
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

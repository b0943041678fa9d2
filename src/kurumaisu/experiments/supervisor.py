# SPDX-License-Identifier: BSD-3-Clause
"""Whoever drives a script on a real chair: begins when it stands, goes on while all is well, else stops. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import Enum

import numpy as np

from kurumaisu import geometry, settings
from kurumaisu.experiments.script import Script
from kurumaisu.experiments.timeline import samples
from kurumaisu.types import FloatArray

_SAME = 1e-9  # [s] less than any clock resolves


@dataclass(frozen=True)
class Care:
    """launch/experiment_node.yaml, where units and meaning are."""

    command_topic: str
    rate: float
    rest_time: float
    rest_distance: float
    rest_angle: float
    patience: float
    pose_timeout: float
    clock_jump: float
    lead_time: float
    stop_time: float
    place_distance: float
    place_angle: float
    margin: float


def read_care(section: settings.Section) -> Care:
    """Return the settings of a section. Raise Error naming file and key."""
    topic, *numbers = (field.name for field in fields(Care))
    care = Care(section.text(topic), **{name: section.number(name, above=0) for name in numbers})
    section.end()
    return care


class Rest:
    """Tells since when poses have hardly changed."""

    def __init__(self, care: Care) -> None:
        self._care = care
        self._anchor: FloatArray | None = None
        self.since = np.inf

    def see(self, t: float, pose: FloatArray) -> None:
        """Take the pose (3,) at a time [s]."""
        moved = np.inf if self._anchor is None else np.hypot(*(pose - self._anchor)[:2])
        if self._anchor is None or moved > self._care.rest_distance or self._turned(pose) > self._care.rest_angle:
            self._anchor, self.since = pose, t

    def _turned(self, pose: FloatArray) -> float:
        return 0.0 if self._anchor is None else abs(float(geometry.wrap(pose[2] - self._anchor[2])))


class Progress(Enum):
    """How far it has come."""

    WAITING = 1  # for the chair to stand; nothing is published
    RUNNING = 2
    STOPPING = 3  # zero is published
    ENDED = 4  # nothing is published any more


class Supervisor:
    """Says what to publish at a time, and ends with an outcome: '' for done, else why it was stopped or refused."""

    def __init__(
        self, script: Script, care: Care, sources: Sequence[str], refusal: Callable[[FloatArray], str]
    ) -> None:
        """sources: topics whose poses must keep coming, the first of which decides about space.

        refusal: says why a script cannot begin at a pose (3,), or ''.
        """
        self._script = script
        self._care = care
        self._sources = tuple(sources)
        self._refusal = refusal
        self._rows = samples(script.phases, 1 / care.rate)
        self._rest = Rest(care)
        self._poses: dict[str, tuple[float, FloatArray]] = {}
        self._first: float | None = None  # tick
        self._last = -np.inf  # tick
        self._due = -np.inf
        self._begin = np.inf
        self._end = np.inf
        self._origin = np.zeros(3)
        self.stage = Progress.WAITING
        self.outcome = ""

    @property
    def rest(self) -> tuple[float, ...]:
        """Return what is published to stop."""
        return (0.0,) * (self._rows.shape[1] - 1)

    def see(self, source: str, t: float, pose: FloatArray) -> None:
        """Take a pose (3,) that came at a time [s]; one that is not finite did not come."""
        if not np.isfinite(pose).all():
            return
        self._poses[source] = (t, pose)
        if source != self._sources[0]:
            return
        self._rest.see(t, pose)
        if self.stage is Progress.RUNNING and self._script.box.excess(geometry.between(self._origin, pose)) > 0:
            self.stop("the chair left the box of the experiment")

    def stop(self, why: str) -> None:
        """Stop, if it runs; before it has begun, end."""
        if self.stage in (Progress.WAITING, Progress.RUNNING):
            self.outcome = why
            self._end = np.inf
            self.stage = Progress.ENDED if self.stage is Progress.WAITING else Progress.STOPPING

    def tick(self, now: float, *, heard: bool = True) -> tuple[float, ...] | None:
        """Return what to publish at a time [s], or None for nothing: not due, time stands, not begun, or ended.

        heard: whether the chair obeys; until it does, rest is commanded, and then for as long as before any drive.
        """
        if now == self._last:
            return None
        self._watch_clock(now)
        if self.stage is Progress.WAITING:
            self._wait(now)
        elif self.stage is Progress.RUNNING:
            self._watch_poses(now)
            if not heard and now < self._begin:
                self._begin = now + self._care.lead_time
                if self._first is not None and now - self._first > 2 * self._care.patience:
                    self.stop("nobody obeys: is the chair locked or stopped?")
        if self.stage in (Progress.WAITING, Progress.ENDED) or now < self._due - _SAME:
            return None
        self._due = max(self._due + 1 / self._care.rate, now)
        return self._stopping(now) if self.stage is Progress.STOPPING else self._row(now)

    def _watch_clock(self, now: float) -> None:
        if self._first is None:
            self._first = now
        elif now < self._last:
            self.stop("time ran backwards")
            self._due, self._end = now, np.inf
        elif now - self._last > self._care.clock_jump:
            self._leap(now - self._last)
        self._last = now

    def _leap(self, seconds: float) -> None:
        if self.stage is Progress.RUNNING:
            self.stop(f"time jumped by {seconds:.2f} s")

    def _wait(self, now: float) -> None:
        absent = [source for source in self._sources if source not in self._poses]
        if not absent and now - self._rest.since >= self._care.rest_time and not self._lost(now):
            origin = self._poses[self._sources[0]][1]
            why = self._refusal(origin)
            if why:
                self.stop(why)
                return
            self._origin, self._begin, self._due, self.stage = origin, now + self._care.lead_time, now, Progress.RUNNING
        elif self._first is not None and now - self._first > self._care.patience:
            lost = absent or self._lost(now)
            self.stop(f"no poses on {', '.join(lost)}" if lost else "the chair does not stand")

    def _lost(self, now: float) -> list[str]:
        known = [name for name in self._sources if name in self._poses]
        return [name for name in known if now - self._poses[name][0] > self._care.pose_timeout]

    def _watch_poses(self, now: float) -> None:
        lost = self._lost(now)
        if lost:
            self.stop(f"poses on {', '.join(lost)} are lost")

    def _row(self, now: float) -> tuple[float, ...] | None:
        elapsed = now - self._begin
        if elapsed < -_SAME:
            return self.rest
        if elapsed >= self._rows[-1, 0] - _SAME:
            self.stop("")
            return self._stopping(now)
        row = np.searchsorted(self._rows[:, 0], elapsed + _SAME, side="right") - 1
        return tuple(float(x) for x in self._rows[row, 1:])

    def _stopping(self, now: float) -> tuple[float, ...] | None:
        self._end = min(self._end, now + self._care.stop_time)
        if now >= self._end - _SAME:
            self.stage = Progress.ENDED
            return None
        return self.rest

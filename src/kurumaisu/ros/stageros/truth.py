# SPDX-License-Identifier: BSD-3-Clause
"""The ground truth as stage_ros has it, or as a reference with effects measures it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kurumaisu.geometry import PLANAR
from kurumaisu.sim.robots.observation import Observation
from kurumaisu.types import FloatArray, IntArray

_NS = 1_000_000_000


class Change(NamedTuple):
    """Stamps (n,) [ns], which hold until the next step; poses now and before (n, 4): x, y, z [m], heading [rad].

    spans (n,) [s]: between them.
    """

    stamps: IntArray
    now: FloatArray
    before: FloatArray
    spans: FloatArray


class _Seen(NamedTuple):
    """Poses (n, 4) of all robots; by how much (n,) [s] the clocks that they are measured by are fast; None: not."""

    poses: FloatArray
    fast: FloatArray | None


class GroundTruth:
    """Poses, and their change since the step before in the world's axes."""

    def __init__(self, interval: float) -> None:
        """Note the length of the steps [s]."""
        self._interval = interval
        self._stamps, self._spans = np.zeros(0, dtype=np.int64), np.zeros(0)
        self.forget()

    def forget(self) -> None:
        """Have the next step be the first one, whose message says a twist of zero, as in 1.8.0."""
        self._now: _Seen | None = None
        self._before: _Seen | None = None

    def take(self, observation: Observation) -> None:
        """Take a step."""
        seen = _seen(observation)
        self._before, self._now = self._now or seen, seen

    def change(self, stamp: int) -> Change:
        """Return the change of the newest step, which has a stamp [ns]."""
        now, before = self._now, self._before
        assert now is not None
        assert before is not None
        stamps, spans = self._stamps, self._spans  # made once
        if len(stamps) != len(now.poses):
            stamps = self._stamps = np.zeros(len(now.poses), dtype=np.int64)
            spans = self._spans = np.full(len(now.poses), self._interval)
        if now.fast is None or before.fast is None:
            stamps.fill(stamp)
            return Change(stamps, now.poses, before.poses, spans)
        stamps = np.maximum(stamp + np.rint(now.fast * _NS).astype(np.int64), 0)
        return Change(stamps, now.poses, before.poses, spans + now.fast - before.fast)


def _seen(observation: Observation) -> _Seen:
    poses, reference = observation.poses, observation.reference
    if reference is None:
        return _Seen(poses, None)
    measured = poses.copy()
    measured[:, PLANAR] = reference.poses
    return _Seen(measured, reference.times - observation.time)

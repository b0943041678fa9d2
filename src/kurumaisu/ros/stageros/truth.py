# SPDX-License-Identifier: BSD-3-Clause
"""The ground truth as stage_ros has it, or as a reference with effects measures it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from kurumaisu.ros.wire import Stamp, planar
from kurumaisu.sim.robots.observation import Observation

_NS = 1_000_000_000


class _Seen(NamedTuple):
    """Poses x, y, z, heading of all robots, and by how much [s] the clocks that they are measured by are fast."""

    poses: list[list[float]]
    fast: list[float]


class GroundTruth:
    """Poses, and their change since the step before in the world's axes."""

    def __init__(self, interval: float) -> None:
        """Note the length of the steps [s]."""
        self._interval = interval
        self.forget()

    def forget(self) -> None:
        """Have the next step be the first one, whose message says a twist of zero, as in 1.8.0."""
        self._now: _Seen | None = None
        self._before: _Seen | None = None

    def take(self, observation: Observation) -> None:
        """Take a step."""
        seen = _seen(observation)
        self._before, self._now = self._now or seen, seen

    def messages(self, stamp: Stamp) -> Iterator[tuple[tuple[float, ...], tuple[float, ...], Stamp]]:
        """Give pose (7,), twist (6,) and stamp of each robot."""
        now, before = self._now, self._before
        assert now is not None
        assert before is not None
        poses = planar([(x, y, heading) for x, y, _, heading in now.poses])
        for i, pose in enumerate(poses):
            dt = self._interval + now.fast[i] - before.fast[i]
            yield pose, _rates(now.poses[i], before.poses[i], dt), _later(stamp, now.fast[i])


def _seen(observation: Observation) -> _Seen:
    poses: list[list[float]] = observation.poses.tolist()
    reference = observation.reference
    if reference is None:
        return _Seen(poses, [0.0] * len(poses))
    measured = [
        [x, y, z, heading] for (x, y, heading), (_, _, z, _) in zip(reference.poses.tolist(), poses, strict=True)
    ]
    return _Seen(measured, (reference.times - observation.time).tolist())


def _rates(now: list[float], before: list[float], dt: float) -> tuple[float, ...]:
    """Return the change (6,) from one pose (4,) to another."""
    x, y, z, heading = now
    x0, y0, z0, heading0 = before
    turn = math.remainder(heading - heading0, math.tau)
    return (x - x0) / dt, (y - y0) / dt, (z - z0) / dt, 0.0, 0.0, turn / dt


def _later(stamp: Stamp, by: float) -> Stamp:
    if by == 0:
        return stamp
    return divmod(max(stamp[0] * _NS + stamp[1] + round(by * _NS), 0), _NS)

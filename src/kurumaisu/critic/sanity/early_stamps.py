# SPDX-License-Identifier: BSD-3-Clause
"""A chair that seems to move before it is asked to: the reference's stamps are early, or those of what drove it late.

No effect of a chair does that; but a few others together, fitted to it, come near.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem, log_posterior
from kurumaisu.critic.search import search
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.criticism import Progress
from kurumaisu.critic.values.recording import Run
from kurumaisu.types import FloatArray

_LONGEST = 0.6  # [s] that is looked for: more shows at first sight
_TRIED = (0.01, 0.02, 0.04, 0.08, 0.16, 0.3, _LONGEST)  # [s] first
_HOPE = 10.0  # [nat] that it must explain by itself to be looked at
_WIN = 8.0  # [nat], as far as they are believed, by which clocks must beat what the chair may do
_TASTE = 1.25  # periods: nobody knows a lead quite
_PAUSE = 0.1  # [s] rows further apart than this are written when something changes
_LEAST = 2e-3  # [s] less is the rounding of stamps


def lead(problem: Problem, found: SearchResult, progress: Progress) -> float:
    """Return by how much the motion comes before what asks for it [s], 0 where a chair may do what is seen.

    found: what acts if no clock is wrong.
    """
    alone = _cost(problem, 0.0)
    cost, tried = min((_cost(problem, by), by) for by in _TRIED)
    if alone - cost < _HOPE:
        return 0.0
    progress("checking whether the clocks agree")
    best = minimize_scalar(lambda by: _cost(problem, by), bounds=(0.0, min(2 * tried, _LONGEST)), method="bounded")
    by = float(best.x)
    if by < _LEAST:
        return 0.0
    other = search.search(_later(problem, by), progress)
    won = log_posterior(other.best, len(other.p)) - log_posterior(found.best, len(found.p))
    return by if won > _WIN else 0.0


def restamped(drive: Drive, by: float) -> Drive:
    """Return a drive whose reference is stamped later [s]."""
    return drive.seen_at(drive.times + by, drive.poses)


def tolerated_lead(runs: Sequence[Run]) -> float:
    """Return the lead [s] up to which it is a matter of taste: a stamp may mean either end of a period.

    That is the longest time between rows of poses or inputs, but no pause; a single row is held throughout.
    """
    parts = [part for run in runs for part in (run.pose, run.voltage or run.command or run.odom)]
    steps = [np.diff(part.t) for part in parts if part is not None]
    return _TASTE * min(max(float(np.median(some)) if len(some) else _PAUSE for some in steps), _PAUSE)


def problem(by: float) -> str:
    """Return what is wrong with the clocks, in words."""
    return f"all runs: the motion comes {by:.3f} s before its command; try t of the reference pose {by:+.3f} s"


def note(by: float, *, imu: bool) -> str:
    """Return what was mended, in words; imu: odometry is compared with one."""
    late, of = (
        ("the odometry comes {:.3f} s after the imu", "imu")
        if imu
        else ("the motion comes {:.3f} s before its command", "pose")
    )
    return f"all runs: {late.format(by)}: judged with the {of}'s stamps {by:+.3f} s"


def _later(problem: Problem, by: float) -> Problem:
    return problem.changed(drives=[restamped(drive, by) for drive in problem.drives])


def _cost(problem: Problem, by: float) -> float:
    left: FloatArray = _later(problem, by).residual((), np.empty(0))
    return 0.5 * float(left @ left)

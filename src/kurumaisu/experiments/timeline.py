# SPDX-License-Identifier: BSD-3-Clause
"""What is asked for at which time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import _core
from kurumaisu.types import FloatArray

PERIOD = 0.02  # [s] between the samples of a path: the control loop of the base


@dataclass(frozen=True)
class Phase:
    """What is asked for during so many seconds; the first `ramp` [s] lead over linearly from what was before."""

    seconds: float
    target: tuple[float, ...]
    ramp: float


def samples(phases: Sequence[Phase], period: float) -> FloatArray:
    """Return rows (n, 1 + targets) of t [s] and what is asked for, each held until the next; the last one is rest."""
    knots, values = [0.0], [(0.0,) * len(phases[0].target)]
    for phase in phases:
        begin = knots[-1]
        # Two knots at one time are a step: np.interp takes the later one from there on.
        knots += [begin + phase.ramp, begin + phase.seconds]
        values += [phase.target, phase.target]
    end = knots[-1]
    t = period * np.arange(round(end / period))
    at = np.array(values)
    rows = np.column_stack([t, *(np.interp(t + 1e-9, knots, at[:, i]) for i in range(at.shape[1]))])
    return np.vstack([rows, [end, *np.zeros(at.shape[1])]])


def nominal_path(phases: Sequence[Phase]) -> FloatArray:
    """Return the poses (n + 1, 3) of a chair that does what it is told, by equation (3) from (0, 0, 0)."""
    rows = samples(phases, PERIOD)
    return np.asarray(_core.integrate(rows[:-1, 1], rows[:-1, 2], np.diff(rows[:, 0]), [0.0, 0.0, 0.0]))

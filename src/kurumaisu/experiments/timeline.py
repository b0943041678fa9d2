# SPDX-License-Identifier: BSD-3-Clause
"""What is asked for at which time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import _core
from kurumaisu.types import FloatArray

_SAME = 1e-9  # [s] less than any clock resolves
PERIOD = 0.02  # [s] between the samples of a path: the control loop of the base


@dataclass(frozen=True)
class Phase:
    """What is asked for during so many seconds; the first `ramp` [s] lead over linearly from what was before."""

    seconds: float
    target: tuple[float, ...]
    ramp: float


def samples(phases: Sequence[Phase], period: float) -> FloatArray:
    """Return rows (n, 1 + targets) of t [s] and what is asked for, each held until the next; the last one is rest."""
    end = sum(phase.seconds for phase in phases)
    t = period * np.arange(round(end / period))
    asked = np.zeros((len(t) + 1, len(phases[0].target)))
    begin, before = 0.0, np.zeros(asked.shape[1])
    for phase in phases:
        first = np.searchsorted(t, begin - _SAME)
        elapsed = np.maximum(t[first:] - begin, 0.0)
        share = np.minimum(elapsed / phase.ramp, 1.0) if phase.ramp > 0 else np.ones(len(elapsed))
        asked[first:-1] = before + share[:, np.newaxis] * (np.array(phase.target) - before)
        begin, before = begin + phase.seconds, np.array(phase.target)
    asked[-1] = 0.0
    return np.column_stack([np.append(t, end), asked])


def nominal_path(phases: Sequence[Phase]) -> FloatArray:
    """Return the poses (n + 1, 3) of a chair that does what it is told, by equation (3) from (0, 0, 0)."""
    rows = samples(phases, PERIOD)
    return np.asarray(_core.integrate(rows[:-1, 1], rows[:-1, 2], np.diff(rows[:, 0]), [0.0, 0.0, 0.0]))

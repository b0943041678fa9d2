# SPDX-License-Identifier: BSD-3-Clause
"""The lowest place of a cost whose derivatives are differences: by L-BFGS-B, for as long as it gets anywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from kurumaisu.types import FloatArray

_STEP = 0.01  # of a difference
_OPTIONS = {"ftol": 3e-6, "maxiter": 60}
# Within so much of the lowest place, and no lower: a line search that comes back to where it began. By what has been
# learnt of the cost there is no way down any more, and twenty more trials, with a gradient each, would end there, too.
_BACK = 1e-5

Cost = Callable[[FloatArray], float]


class _StuckError(Exception):
    pass


def minimise(cost: Cost, begin: FloatArray, bounds: FloatArray) -> tuple[FloatArray, float]:
    """Return the place (k,) of a local minimum within bounds (k, 2), searched for from another, and its cost.

    Where it is stuck it forgets what it has learnt, and begins anew from there, until that is of no use.
    """
    where, least = begin, np.inf
    while True:
        before, (where, least, stuck) = least, _attempt(cost, where, bounds)
        if not stuck or before - least <= _OPTIONS["ftol"] * max(abs(least), 1.0):
            return where, least


def _attempt(cost: Cost, begin: FloatArray, bounds: FloatArray) -> tuple[FloatArray, float, bool]:
    """Return the lowest place that was seen, its cost, and whether the search got stuck there."""
    best, least = begin, np.inf

    def with_gradient(at: FloatArray) -> tuple[float, FloatArray]:
        nonlocal best, least
        here = cost(at)
        if here >= least and np.abs(at - best).max() < _BACK:
            raise _StuckError
        if here < least:
            best, least = at.copy(), here
        return here, _gradient(cost, at, here, bounds)

    try:
        found = minimize(with_gradient, begin, jac=True, method="L-BFGS-B", bounds=bounds, options=_OPTIONS)
    except _StuckError:
        return best, least, True
    return found.x, float(found.fun), False


def _gradient(cost: Cost, at: FloatArray, here: float, bounds: FloatArray) -> FloatArray:
    """Return the differences to neighbours, above where there is room."""
    out = np.empty(len(at))
    for i, upper in enumerate(bounds[:, 1]):
        moved = at.copy()
        moved[i] += _STEP if at[i] + _STEP <= upper else -_STEP
        out[i] = (cost(moved) - here) / (moved[i] - at[i])
    return out

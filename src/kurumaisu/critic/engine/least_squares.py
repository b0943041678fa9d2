# SPDX-License-Identifier: BSD-3-Clause
"""Nonlinear least squares with bounds, by Levenberg and Marquardt: few simulations, which are what costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from kurumaisu.critic.engine.evidence import Problem

_ROUNDS = 25
_ENOUGH = 0.01  # [nat] less to gain ends the search
_SAME_SLOPES = 0.1  # [nat] a step that gains less, half a standard deviation at most, leaves the slopes as they were
_DAMPING = (1e-4, 0.3, 8.0, 1e6)  # at first, on success, on failure, at last


@dataclass(frozen=True)
class Solution:
    """values and sds per term; cost: half the squared residual, with that of shapes; slopes: (rows, k) per step."""

    values: FloatArray
    sds: FloatArray
    cost: float
    residual: FloatArray
    slopes: FloatArray


def least_squares(problem: Problem, terms: Sequence[Term], start: FloatArray) -> Solution:
    """Return the best values within their bounds near a start."""
    unit = np.array([term.step * term.parameter.scale for term in terms])
    lower, upper = (np.array([getattr(term.parameter, side) for term in terms]) for side in ("lower", "upper"))
    null = np.array([term.null for term in terms])
    tight = np.array([term.step if term.shape else 0.0 for term in terms])  # 1 / sd of a shape's prior, per step
    values, damping = np.clip(start, lower, upper), _DAMPING[0]
    # Slopes of what has many likely values lead astray: where they lead nowhere, the others go on alone.
    rough, held = np.array([term.rough for term in terms]), np.zeros(len(terms), dtype=np.bool_)

    def cost_at(at: FloatArray, residual: FloatArray) -> float:
        return 0.5 * float(residual @ residual + np.sum((tight * (at - null) / unit) ** 2))

    residual, slopes = _linearised(problem, terms, values)
    cost = cost_at(values, residual)
    for _ in range(_ROUNDS):
        pull = slopes.T @ residual - tight**2 * (values - null) / unit
        stuck = ((values <= lower) & (pull * unit < 0)) | ((values >= upper) & (pull * unit > 0)) | (lower == upper)
        stuck |= held
        gram = slopes.T @ slopes + np.diag(tight**2)
        better = False
        while damping < _DAMPING[3]:
            move, hope = _step(gram, pull, stuck, damping)
            if hope < _ENOUGH:
                break
            tried = np.clip(values + move * unit, lower, upper)
            left = problem.residual(terms, tried)
            if cost_at(tried, left) < cost:
                better = True
                break
            damping *= _DAMPING[2]
        if not better:
            if held.any() or not rough.any():
                break
            held, damping = rough, _DAMPING[0]
            continue
        gained = cost - cost_at(tried, left)
        values, damping = tried, damping * _DAMPING[1]
        residual, cost = left, cost - gained
        if gained < _ENOUGH:
            break
        if gained > _SAME_SLOPES:
            residual, slopes = _linearised(problem, terms, values)
    return Solution(values, _sds(slopes, tight, lower == upper) * np.abs(unit), cost, residual, slopes)


def _linearised(problem: Problem, terms: Sequence[Term], values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the residual and the slopes, which are 0 for what is fixed."""
    free = np.array([not term.fixed for term in terms])
    residual, some = problem.linearised(terms, values, [term for term in terms if not term.fixed])
    slopes = np.zeros((len(residual), len(terms)))
    slopes[:, free] = some
    return residual, slopes


def _step(gram: FloatArray, pull: FloatArray, stuck: BoolArray, damping: float) -> tuple[FloatArray, float]:
    """Return the damped step of the parameters that are free, and what it promises in nats."""
    move = np.zeros(len(pull))
    free = ~stuck
    if not free.any():
        return move, 0.0
    part = gram[np.ix_(free, free)]
    part = part + damping * np.diag(np.diag(part)) + 1e-9 * np.eye(len(part))
    move[free] = np.linalg.solve(part, pull[free])
    return move, float(pull @ move - 0.5 * move @ gram @ move)


def _sds(slopes: FloatArray, tight: FloatArray, fixed: BoolArray) -> FloatArray:
    """Return standard deviations in units of the steps; 0 of what is fixed."""
    sds = np.zeros(len(tight))
    free = ~fixed
    gram: FloatArray = np.asarray(slopes[:, free].T @ slopes[:, free], dtype=np.float64)
    sds[free] = np.sqrt(np.diag(covariance(gram + np.diag(tight[free] ** 2))))
    return sds


def covariance(gram: FloatArray) -> FloatArray:
    """Return the covariance of parameters, in units of their steps, for G = J'J with columns per step.

    A weak prior of 1000 steps keeps it finite where the data do not determine a parameter at all.
    """
    return np.asarray(np.linalg.inv(gram + 1e-6 * np.eye(len(gram))))

# SPDX-License-Identifier: BSD-3-Clause
"""What sizes of effects cost beyond what each costs by itself: parts of the Occam factor of a set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.values.policy import Z_USUAL, in_proportion
from kurumaisu.types import FloatArray

_ROUGH_RANGE = float(np.log(np.log(100.0)))  # [nat] a size may lie anywhere within two decades, on a log scale


def alike(slopes: FloatArray) -> float:
    """Return half the log determinant of how slopes (rows, k) correlate."""
    unit = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-9)
    return 0.5 * float(np.linalg.slogdet(unit.T @ unit + np.eye(slopes.shape[1]) / Z_USUAL**2)[1])


def proportion(terms: Sequence[Term], solution: least_squares.Solution, loud: Sequence[int]) -> float:
    """Return what two amplitudes of one cause cost less for being in their usual proportion, in nats.

    Of a quantity that has a direction, such as a slope, either sign of both is possible, and every direction as likely.
    """
    bounds = [(terms[i].parameter.lower, terms[i].parameter.upper) for i in loud]
    natural = [terms[i].null in ends for i, ends in zip(loud, bounds, strict=True)]
    if len(loud) != 2 or not any(natural):
        return 0.0
    order = sorted(range(2), key=lambda k: natural[k])  # the second has one sign only
    use = [loud[k] for k in order]
    free = [i for i, term in enumerate(terms) if not term.fixed]
    step = np.array([terms[i].step for i in free])
    tight = np.array([terms[i].step if terms[i].shape else 0.0 for i in free])
    slopes = solution.slopes[:, free]
    inside = [free.index(i) for i in use]
    whole = slopes.T @ slopes + np.diag(np.square(tight).astype(np.float64))
    spread = least_squares.covariance(whole)[np.ix_(inside, inside)]
    spread = spread * np.outer(step[inside], step[inside])
    own = slopes[:, inside] / step[inside]
    sizes = np.array([(solution.values[i] - terms[i].null) / terms[i].parameter.scale for i in use])
    return in_proportion(sizes, spread, own.T @ own)


def step_cost(terms: Sequence[Term], solution: least_squares.Solution, loud: Sequence[int]) -> float:
    """Return the cost of sizes that the data know so closely: by chance, one out of many would fit as well.

    A threshold that is met by little, too: it could be anywhere, and is where the drives just reach it.
    """
    many = [i for i in loud if terms[i].rough or terms[i].sudden]
    if not many:
        return -np.inf
    sizes = [abs(solution.values[i] - terms[i].null) for i in many]
    sds = [solution.sds[i] for i in many]
    width = np.sqrt(2 * np.pi) * np.array(sds) / np.maximum(sizes, 1e-12)
    return float(np.sum(_ROUGH_RANGE - np.log(np.clip(width, 1e-6, 1.0))))

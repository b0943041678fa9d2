# SPDX-License-Identifier: BSD-3-Clause
"""How far evidence is believed beside strong causes: no real cause has quite the catalogue's equation.

What a strong cause leaves behind lies along other effects by chance, and speaks for or against them as noise does. So a
log posterior ratio is worth less, by as much as such leavings add to its variance: a coarsened posterior.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import expit, logit, softmax

from kurumaisu.critic.engine.confounding import SetPosterior, confounded
from kurumaisu.critic.engine.evidence import Fit, log_posterior
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.types import FloatArray

# What an equation misses, as a share of the signal's norm: soft corners and second orders do.
_MISSED = 0.1
# Directions among which that is spread: as many as the catalogue has parameters, or so.
_DIRECTIONS = 45
_NEAR = 1.0  # [nat] by which many sets together speak louder than the best of them


def of_effects(found: SearchResult, odds: Mapping[str, float]) -> tuple[dict[str, float], tuple[tuple[str, ...], ...]]:
    """Return probabilities of effects as far as the evidence is believed, and the sets that cannot be told apart.

    odds: log odds of each. What speaks against an effect is believed: nothing is likelier than not for being in doubt.
    """
    shares = {name: float(expit(log if log <= 0 else _coarsened(found, name, log))) for name, log in odds.items()}
    return shares, confounded(SetPosterior(found.fits, weights(found)), shares)


def _coarsened(found: SearchResult, name: str, odds: float) -> float:
    plain = min(_simpler(found, name, odds), odds)
    return (odds - plain) / variance(found) + plain


def of_finding(found: SearchResult, p: float) -> float:
    """Return the probability of something that is judged by what a set of effects leaves, as far as it is believed."""
    return float(expit(logit(p) / variance(found)))


def weights(found: SearchResult) -> FloatArray:
    """Return how likely each set is, as far as the evidence is believed."""
    return np.asarray(softmax(np.array([of_set(found, fit) for fit in found.fits]) / variance(found)))


def variance(found: SearchResult) -> float:
    """Return by what log posterior ratios are to be divided."""
    nothing = next((fit for fit in found.fits if not fit.candidates), found.best)
    square = 2 * (found.best.log_likelihood - nothing.log_likelihood)  # z^2 of all that acts
    return 1 + _MISSED**2 * max(square, 0.0) / _DIRECTIONS


def of_set(found: SearchResult, fit: Fit) -> float:
    """Return the log posterior of a set, not normalised."""
    return log_posterior(fit, len(found.p))


def _simpler(found: SearchResult, name: str, odds: float) -> float:
    """Return what of an effect's odds [nat] is no evidence of the drives: what could stand in needs more to be fitted.

    A wrong sign says by itself what a gain must be fitted to say, however strong it is.
    """
    sides = ([fit for fit in found.fits if (name in fit.ids) is there] for there in (True, False))
    first, other = (max(side, key=lambda fit: of_set(found, fit), default=None) for side in sides)
    if first is None or other is None or odds < of_set(found, first) - of_set(found, other) - _NEAR:
        return 0.0  # a curve is nearer than any other set
    if first.sizes >= other.sizes:
        return 0.0
    costs = [fit.log_likelihood - of_set(found, fit) for fit in (other, first)]
    return max(costs[0] - costs[1], 0.0)

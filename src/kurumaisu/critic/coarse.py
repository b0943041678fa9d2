# SPDX-License-Identifier: BSD-3-Clause
"""How far evidence is believed beside strong causes: no real cause has quite the catalogue's equation.

What a strong cause leaves behind lies along other effects by chance, and speaks for or against them as noise does. So a
log posterior ratio is worth less, by as much as such leavings add to its variance: a coarsened posterior.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import expit, softmax

from kurumaisu.critic.evidence import Fit
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.prior import log_prior
from kurumaisu.critic.stand_ins import Posterior, confounded
from kurumaisu.types import FloatArray

# What an equation misses, as a share of the signal's norm: soft corners and second orders do.
_MISSED = 0.1
# Directions among which that is spread: as many as the catalogue has parameters, or so.
_DIRECTIONS = 45


def believed(found: Naming, odds: Mapping[str, float]) -> tuple[dict[str, float], tuple[tuple[str, ...], ...]]:
    """Return probabilities of effects as far as the evidence is believed, and the sets that cannot be told apart.

    odds: log odds of each. What speaks against an effect is believed: nothing is likelier than not for being in doubt.
    """
    doubt = variance(found)
    shares = {name: float(expit(log / doubt if log > 0 else log)) for name, log in odds.items()}
    return shares, confounded(Posterior(found.fits, weights(found)))


def weights(found: Naming) -> FloatArray:
    """Return how likely each set is, as far as the evidence is believed."""
    return np.asarray(softmax(np.array([_worth(found, fit) for fit in found.fits]) / variance(found)))


def variance(found: Naming) -> float:
    """Return by what log posterior ratios are to be divided."""
    least = min(fit.log_likelihood for fit in found.fits)  # nothing's
    square = 2 * (found.best.log_likelihood - least)  # z^2 of all that acts
    return 1 + _MISSED**2 * max(square, 0.0) / _DIRECTIONS


def _worth(found: Naming, fit: Fit) -> float:
    """Return the log posterior of a set, not normalised."""
    return fit.score + log_prior(len(fit.candidates), len(found.p))

# SPDX-License-Identifier: BSD-3-Clause
"""How far evidence is believed beside strong causes: no real cause has quite the catalogue's equation.

What a strong cause leaves behind lies along other effects by chance, and speaks for or against them as noise does. So a
log posterior ratio is worth less, by as much as such leavings add to its variance: a coarsened posterior.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import expit, logit, softmax

from kurumaisu.critic.evidence import Fit
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.prior import log_prior
from kurumaisu.critic.stand_ins import Posterior, confounded

# What an equation misses, as a share of the signal's norm: soft corners and second orders do.
_MISSED = 0.1
# Directions among which that is spread: as many as the catalogue has parameters, or so.
_DIRECTIONS = 45


def believed(found: Naming, p: Mapping[str, float]) -> tuple[dict[str, float], tuple[tuple[str, ...], ...]]:
    """Return probabilities p of effects as far as the evidence is believed, and the sets that cannot be told apart."""
    square = 2 * (found.best.log_likelihood - found.empty.log_likelihood)  # z^2 of all that acts
    variance = 1 + _MISSED**2 * max(square, 0.0) / _DIRECTIONS
    posterior = Posterior(found.fits, softmax(np.array([_worth(found, fit) for fit in found.fits]) / variance))
    # What is certain is so but for the rounding of the logs, of which no doubt is to be made by believing less.
    certain = 1.0 - 2 * np.spacing(abs(found.best.score))
    sure = {name: 1.0 if share > certain else max(share, 0.0) for name, share in p.items()}
    shares = {name: float(expit(logit(share) / variance)) for name, share in sure.items()}
    return shares, confounded(posterior)


def _worth(found: Naming, fit: Fit) -> float:
    """Return the log posterior of a set, not normalised."""
    return fit.score + log_prior(len(fit.candidates), len(found.p))

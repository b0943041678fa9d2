# SPDX-License-Identifier: BSD-3-Clause
"""How far evidence is believed beside strong causes: no real cause has quite the catalogue's equation.

What a strong cause leaves behind lies along other effects by chance, and speaks for or against them as noise does. So a
log posterior ratio is worth less, by as much as such leavings add to its variance: a coarsened posterior.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import expit, logit, softmax

from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.prior import log_prior
from kurumaisu.critic.stand_ins import Posterior, confounded
from kurumaisu.types import FloatArray

# What an equation misses, as a share of the signal's norm: soft corners and second orders do.
_MISSED = 0.1
# Directions among which that is spread where nothing is known: as many as the catalogue has parameters, or so.
_DIRECTIONS = 45


def believed(
    problem: Problem, found: Naming, p: Mapping[str, float]
) -> tuple[dict[str, float], tuple[tuple[str, ...], ...]]:
    """Return probabilities p of effects as far as the evidence is believed, and the sets that cannot be told apart."""
    best, square = found.best, 2 * (found.best.log_likelihood - found.empty.log_likelihood)  # z^2 of all that acts
    variance = 1 + _MISSED**2 * max(square, 0.0) / _DIRECTIONS
    posterior = Posterior(found.fits, softmax(np.array([_worth(found, fit) for fit in found.fits]) / variance))
    shares = {name: float(expit(logit(np.clip(share, 0.0, 1.0)) / variance)) for name, share in p.items()}
    alike = _alike(problem, best)
    for fit in found.fits:
        for name in best.ids:
            if fit.candidates == {candidate for candidate in best.candidates if candidate.id != name}:
                # It may be no effect of its own, but what others leave whose signals have a part of it.
                nats = _worth(found, best) - _worth(found, fit)
                alone = expit(nats / (variance + _MISSED**2 * alike[name]))
                shares[name] = min(shares[name], float(alone))
    return shares, confounded(posterior)


def _worth(found: Naming, fit: Fit) -> float:
    """Return the log posterior of a set, not normalised."""
    return fit.score + log_prior(len(fit.candidates), len(found.p))


def _alike(problem: Problem, fit: Fit) -> dict[str, float]:
    """Return, per effect of a fit, the square of the others' signals along its own."""
    signals = {name: _signal(problem, fit, name) for name in sorted(fit.ids)}
    own = {name: signal / max(float(np.linalg.norm(signal)), 1e-9) for name, signal in signals.items()}
    return {a: sum(float(own[a] @ signals[b]) ** 2 for b in signals if b != a) for a in signals}


def _signal(problem: Problem, fit: Fit, name: str) -> FloatArray:
    """Return what an effect does to the whitened residual, (rows,)."""
    pairs = zip(fit.terms, fit.values, strict=True)
    without = np.array([term.null if term.id == name else value for term, value in pairs])
    return problem.residual(fit.terms, without) - problem.residual(fit.terms, fit.values)

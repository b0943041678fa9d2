# SPDX-License-Identifier: BSD-3-Clause
"""How likely each cause is: the posterior over the sets that were fitted, without and with a curve beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.engine.catalogue import Candidate
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.search.confounding import SetPosterior, confounded
from kurumaisu.critic.search.curve_search import CurveSearch, SetWithCurve
from kurumaisu.critic.values.prior import NAMED, UNKNOWN_ODDS
from kurumaisu.types import FloatArray

_NEAR, _LIKELY = 8.0, 5  # [nat] behind the best set within which others may be the cause in another noise; how many
_SAID = 1e-3  # posterior from which it is asked what a curve draws
_ENOUGH = 3  # residuals per parameter of the catalogue, at least


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    fits: all sets that were fitted, best first; curves: those with a curve beside them, likewise; p: posterior per
    effect, and per curve by its id; confounded: sets of effects of which one acts, but the data do not say which;
    enough: there are more data than could be fitted by the catalogue as a whole.
    """

    fits: tuple[Fit, ...]
    curves: tuple[SetWithCurve, ...]
    p: dict[str, float]
    p_curves: dict[str, float]
    confounded: tuple[tuple[str, ...], ...]
    enough: bool = True

    @property
    def best(self) -> Fit:
        """Return the most probable set without a curve."""
        return self.fits[0]

    @property
    def empty(self) -> Fit:
        """Return the fit of nothing."""
        return next(fit for fit in self.fits if not fit.candidates)

    @property
    def likely(self) -> tuple[Fit, ...]:
        """Return the likeliest fits of some sets of effects, the best first: those that other noise may put first."""
        least = self.log_posterior(self.best) - _NEAR
        of_set: dict[frozenset[str], Fit] = {}
        for fit in self.fits:
            if self.log_posterior(fit) > least:
                of_set.setdefault(fit.ids, fit)
        return tuple(of_set.values())[:_LIKELY]

    def nats(self, fit: Fit) -> float:
        """Return the evidence [nat] of a set over nothing, none where data are too few to believe in it."""
        return fit.score - self.empty.score if self.enough else 0.0

    def log_posterior(self, one: Fit | SetWithCurve) -> float:
        """Return the log posterior [nat] of a set, without or with a curve, not normalised."""
        if isinstance(one, SetWithCurve):
            return log_posterior(one.fit, len(self.p)) + one.nats
        return log_posterior(one, len(self.p)) + float(np.log1p(-UNKNOWN_ODDS))

    @property
    def named(self) -> tuple[str, ...]:
        """Return the effects of the best set that are certain enough to be named."""
        return tuple(name for name in sorted(self.best.ids) if self.p[name] >= NAMED)


def posterior(problem: Problem, fitted: Mapping[frozenset[Candidate], Fit], search: CurveSearch) -> SearchResult:
    """Return how likely each effect and each curve is, by the sets that were fitted and the curves beside them."""
    names = sorted({candidate.id for candidate in problem.candidates})
    fits = sorted(fitted.values(), key=lambda fit: -log_posterior(fit, len(names)))
    found = [one for fit in fits for one in search.found(fit)]
    found.sort(key=lambda one: -(one.nats + log_posterior(one.fit, len(names))))
    bare = np.array([log_posterior(fit, len(names)) for fit in fits]) + np.log1p(-UNKNOWN_ODDS)
    curved = np.array([one.nats + log_posterior(one.fit, len(names)) for one in found])
    total = logsumexp(np.concatenate([bare, curved]))
    weights, others = np.exp(bare - total), np.exp(curved - total)
    asked = (others > _SAID) | (curved > bare.max())
    curves = [_told(one, fitted, search) if told else one for one, told in zip(found, asked, strict=True)]
    p = dict.fromkeys(names, 0.0)
    for ids, weight in _acting(fits, weights, curves, others):
        for name in ids:
            p[name] += weight
    p = {name: min(each, 1.0) for name, each in p.items()}  # but for rounding
    p_curves: dict[str, float] = {}
    for one, weight in zip(curves, others, strict=True):
        if one.form_of is None:
            p_curves[one.curve.id] = p_curves.get(one.curve.id, 0.0) + float(weight)
    sets = SetPosterior(fits, np.exp(bare - logsumexp(bare)))
    enough = len(fitted[frozenset()].beside.residual) > _ENOUGH * len(problem.terms)
    return SearchResult(tuple(fits), tuple(curves), p, p_curves, confounded(sets, p), enough)


def _acting(
    fits: Sequence[Fit], weights: FloatArray, curves: Sequence[SetWithCurve], others: FloatArray
) -> list[tuple[frozenset[str], float]]:
    """Return which effects act, and how likely that is, for each set without and with a curve."""
    plain = [(fit.ids, float(w)) for fit, w in zip(fits, weights, strict=True)]
    drawn = [frozenset() if one.form_of is None else frozenset({one.form_of}) for one in curves]
    return plain + [(one.fit.ids | more, float(w)) for one, more, w in zip(curves, drawn, others, strict=True)]


def _told(one: SetWithCurve, fitted: Mapping[frozenset[Candidate], Fit], search: CurveSearch) -> SetWithCurve:
    """Return a set with a curve, told as the form of an effect that it draws, if there is one."""
    own = one.fit.candidates
    return search.as_form(one, [fit for chosen, fit in fitted.items() if own < chosen and len(chosen - own) == 1])

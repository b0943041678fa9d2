# SPDX-License-Identifier: BSD-3-Clause
"""What an effect that nobody is sure of does to the size of one that is certain: it is left out, and its share told.

The likeliest set may hold an effect that more probably does not act, where many smaller sets share the rest. The best
single model has those only that act with a probability of a half (Barbieri and Berger 2004, Ann. Statist. 32, 870).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu.critic.engine import coarsened_posterior
from kurumaisu.critic.engine.evidence import Fit
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.values.verdict import NORMAL90, Estimate

_ACTS = 0.5  # probability from which an effect is in the best single model
_LIKELY = 0.01  # below which a set says nothing about a size


def without_uncertain(found: SearchResult) -> SearchResult:
    """Return what was found with the median model first, if it was fitted; the members of a told set stay."""
    told = {name for group in found.confounded for name in group}
    kept = {name for name in found.best.ids if found.p[name] >= _ACTS or name in told}
    fit = next((fit for fit in found.fits if fit.ids == kept), None) if kept else None
    if fit is None or fit is found.best:
        return found
    return replace(found, fits=(fit, *(other for other in found.fits if other is not fit)))


def widened_intervals(found: SearchResult, name: str, parameters: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Return the parameters of an effect of the best set with what other likely sets make of them in the intervals."""
    return {key: _widened(found, name, key, one) for key, one in parameters.items()}


def _widened(found: SearchResult, name: str, parameter: str, one: Estimate) -> Estimate:
    form = _form(found.best, name)
    alike = [_form(fit, name) == form for fit in found.fits]  # another form has other sizes
    weights = coarsened_posterior.weights(found) * alike
    likely = np.flatnonzero(weights >= _LIKELY * weights.sum())
    off = np.array([_value(found.fits[i], name, parameter) for i in likely]) - one.estimate
    shares = weights[likely] / weights[likely].sum()
    low, high = (NORMAL90 * float(np.sqrt(shares @ np.maximum(side * off, 0.0) ** 2)) for side in (-1.0, 1.0))
    lo90, hi90 = one.estimate - one.lo90, one.hi90 - one.estimate
    return replace(one, lo90=one.estimate - float(np.hypot(lo90, low)), hi90=one.estimate + float(np.hypot(hi90, high)))


def _form(fit: Fit, name: str) -> frozenset[tuple[str, float | None]]:
    """Return the parameters that an effect has in a set, with the values of those that are not fitted."""
    terms = zip(fit.terms, fit.values, strict=True)
    return frozenset((term.parameter.name, float(v) if term.fixed else None) for term, v in terms if term.id == name)


def _value(fit: Fit, name: str, parameter: str) -> float:
    terms = zip(fit.terms, fit.values, strict=True)
    return next(float(v) for term, v in terms if (term.id, term.parameter.name) == (name, parameter))

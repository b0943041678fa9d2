# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act on the mean readings: evidence of sets, from normal equations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.ranges.signals.effect_columns import Form
from kurumaisu.critic.values.policy import NAMED, RIVAL, Z_LOW, log_prior, occam
from kurumaisu.types import FloatArray

_LARGEST = 5  # effects in a set
_WIDTH = 8  # sets that are extended at a time
WEAK_PRIOR = 1e-4  # prior precision of a coefficient, in units of its parameter's scale
# Share of what a set explains that one more effect in it must bring: a real effect hardly has the catalogue's very
# form, and what its form leaves is not another one.
LINE_ERROR = 0.02
_CONTAINED = 1e-4  # share of a column's power that a form may leave, and contain it
_INSTEAD = 2.0  # times as likely without an effect as beside it is what stands in for it


@dataclass(frozen=True)
class FittedForms:
    """Forms that act together: coefficients and their sds in units of the columns; score: log evidence and prior."""

    forms: tuple[Form, ...]
    coefficients: FloatArray
    sds: FloatArray
    log_likelihood: float
    score: float

    @property
    def ids(self) -> frozenset[str]:
        """The effects."""
        return frozenset(form.id for form in self.forms)

    def parts(self) -> Iterator[tuple[Form, FloatArray]]:
        """Yield each form with its coefficients."""
        start = 0
        for form in self.forms:
            stop = start + len(form.columns)
            yield form, self.coefficients[start:stop]
            start = stop

    def without(self, ids: frozenset[str]) -> FittedForms:
        """Return the other effects, as they were fitted beside these."""
        keep = np.repeat([form.id not in ids for form in self.forms], [len(form.columns) for form in self.forms])
        forms = tuple(form for form in self.forms if form.id not in ids)
        return replace(self, forms=forms, coefficients=self.coefficients[keep], sds=self.sds[keep])


@dataclass(frozen=True)
class FormPosterior:
    """Result of a search: all sets tried, best first; p: posterior per effect; confounded: sets of which one acts."""

    fits: tuple[FittedForms, ...]
    p: dict[str, float]
    confounded: tuple[tuple[str, ...], ...]

    @property
    def best(self) -> FittedForms:
        """The most probable set."""
        return self.fits[0]

    @property
    def named(self) -> tuple[str, ...]:
        """Effects of the best set that are certain enough."""
        return tuple(form.id for form in self.best.forms if self.p[form.id] >= NAMED)


class FormSearch:
    """Sets of forms, weighed by normal equations."""

    def __init__(self, forms: Sequence[Form], gram: FloatArray) -> None:
        """Take the forms of all effects, and the gram of their columns with, last, the residual."""
        self._forms = dict(enumerate(forms))
        self._ids = tuple(dict.fromkeys(form.id for form in forms))
        self._count = {name: sum(form.id == name for form in forms) for name in self._ids}
        self._gram = gram
        self._known: dict[frozenset[int], FittedForms | None] = {}
        self._contains = {i: _contained(form, self._forms, gram) for i, form in self._forms.items()}

    def run(self) -> FormPosterior:
        """Extend, swap and prune the best sets until none is better."""
        frontier = [frozenset[int]()]
        best = -np.inf
        while True:
            for chosen in frontier:
                for other in self._near(chosen):
                    self._weigh(other)
            ranked = sorted((s for s, fit in self._known.items() if fit is not None), key=lambda s: -self._score(s))
            frontier = ranked[:_WIDTH]
            if self._score(ranked[0]) <= best:
                return posterior_of([fit for s in ranked if (fit := self._known[s]) is not None], self._ids)
            best = self._score(ranked[0])

    def _near(self, chosen: frozenset[int]) -> Iterable[frozenset[int]]:
        """Return a set, those with one form more, less, or exchanged, and those with any two where it is empty."""
        yield chosen
        ids = {self._forms[i].id for i in chosen}
        for i in chosen:
            yield chosen - {i}
        for j, form in self._forms.items():
            if form.id not in ids and len(chosen) < _LARGEST:
                yield chosen | {j}
            for i in chosen:
                if form.id not in ids - {self._forms[i].id}:
                    yield chosen - {i} | {j}
            if not chosen:
                yield from (frozenset((j, k)) for k, other in self._forms.items() if k > j and other.id != form.id)

    def _score(self, chosen: frozenset[int]) -> float:
        fit = self._known[chosen]
        return -np.inf if fit is None else fit.score

    def _weigh(self, chosen: frozenset[int]) -> None:
        if chosen not in self._known:
            fit = self._fit(tuple(self._forms[i] for i in sorted(chosen)))
            self._known[chosen] = None if fit is None or self._plainer(chosen, fit) else fit

    def _plainer(self, chosen: frozenset[int], fit: FittedForms) -> bool:
        """Return whether a form of fewer columns, which one of the set contains, explains as much in its place.

        What shows of a temperature that hardly varies, about a reference that is anywhere, is an offset.
        """
        for i in chosen:
            for j in self._contains[i]:
                fewer = chosen - {i} | {j}
                if self._forms[j].id not in fit.ids:
                    self._weigh(fewer)
                    other = self._known[fewer]
                    if other is not None and 2 * (fit.log_likelihood - other.log_likelihood) < Z_LOW**2:
                        return True
        return False

    def _fit(self, forms: tuple[Form, ...]) -> FittedForms | None:
        """Return forms fitted together; None where a parameter leaves its bounds."""
        prior = log_prior(len(forms), len(self._ids))
        if not forms:
            return FittedForms((), np.empty(0), np.empty(0), 0.0, prior)
        use = np.concatenate([np.arange(form.span.start, form.span.stop) for form in forms])
        gram, b = self._gram[np.ix_(use, use)], self._gram[use, -1]
        inverse = np.linalg.inv(gram + WEAK_PRIOR * np.eye(len(use)))
        at = inverse @ b
        likelihood = float(b @ at - 0.5 * at @ gram @ at)
        cost, start = 0.0, 0
        for form in forms:
            own = slice(start, start + len(form.columns))
            start = own.stop
            if not _within(form, at[own]):
                return None
            z = float(np.sqrt(at[own] @ np.linalg.solve(inverse[own, own], at[own])))
            # A direction among several columns is as free as z is large.
            cost += float(occam(np.array(z))) + (len(form.columns) - 1) * np.log(max(z, 1.0))
            cost += np.log(self._count[form.id])
        cost += LINE_ERROR * (len(forms) - 1) * likelihood
        return FittedForms(forms, at, np.sqrt(np.diag(inverse)), likelihood, likelihood - cost + prior)


def posterior_of(fits: Iterable[FittedForms], ids: Sequence[str]) -> FormPosterior:
    """Return how likely each of some effects is by sets of them."""
    known = sorted(fits, key=lambda fit: -fit.score)
    scores = np.array([fit.score for fit in known])
    weights = np.exp(scores - logsumexp(scores))
    pairs = [(fit.ids, float(weight)) for fit, weight in zip(known, weights, strict=True)]
    return FormPosterior(tuple(known), *confusion(pairs, known[0].ids, ids))


def over_all(found: Sequence[FormPosterior], nats: Sequence[float]) -> FormPosterior:
    """Return the posterior of sets, whatever else holds; found: where each of some things does, likely by nats."""
    total = float(logsumexp(nats))
    every: dict[tuple[int, ...], list[FittedForms]] = {}
    for one, own in zip(found, nats, strict=True):
        for fit in one.fits:
            every.setdefault(tuple(form.start for form in fit.forms), []).append(
                replace(fit, score=fit.score + own - total)
            )
    merged = []
    for fits in every.values():
        best = max(fits, key=lambda fit: fit.score)
        merged.append(replace(best, score=float(logsumexp([fit.score for fit in fits]))))
    return posterior_of(merged, tuple(found[0].p))


def confusion(
    weights: Sequence[tuple[frozenset[str], float]], best: frozenset[str], ids: Sequence[str]
) -> tuple[dict[str, float], tuple[tuple[str, ...], ...]]:
    """Return the posterior of each effect by weighed sets, and the sets of which one acts but not known which.

    best: the effects of the best set; those of it that are not certain have rivals. A rival takes their place: what is
    as likely beside them as without them is one more effect, about which nobody knows.
    """

    def p_any(names: Iterable[str]) -> float:
        return sum(weight for chosen, weight in weights if not chosen.isdisjoint(names))

    p = {name: p_any([name]) for name in ids}
    uncertain = sorted(name for name in best if p[name] < NAMED)
    without = 1 - p_any(uncertain)

    def instead(name: str) -> bool:
        alone = sum(weight for chosen, weight in weights if name in chosen and chosen.isdisjoint(uncertain))
        beside = p[name] - alone
        return alone >= RIVAL and alone * (1 - without) > _INSTEAD * beside * without

    group = tuple(uncertain + sorted(name for name in p if name not in best and instead(name)))
    one = uncertain and len(group) > 1 and p_any(group) >= NAMED
    return p, (group,) if one else ()


def _contained(form: Form, forms: Mapping[int, Form], gram: FloatArray) -> list[int]:
    """Return which forms of one column and another effect a form of several columns contains."""
    out = []
    for j, other in forms.items() if len(form.columns) > 1 else ():
        if len(other.columns) == 1 and other.id != form.id:
            inner, outer = gram[form.span, form.span], gram[form.span, other.start]
            left = gram[other.start, other.start] - outer @ np.linalg.lstsq(inner, outer, rcond=1e-9)[0]
            if left < _CONTAINED * gram[other.start, other.start]:
                out.append(j)
    return out


def _within(form: Form, coefficients: FloatArray) -> bool:
    if form.between:
        return bool(coefficients.min() * coefficients.max() >= 0)
    if len(form.columns) > 1:
        return True  # of several columns the parameter is a length, whose bounds the refit heeds
    column = form.columns[0]
    if column.squared:
        return bool(coefficients[0] >= 0)
    parameter = column.parameter
    return bool(parameter.lower <= parameter.null + coefficients[0] * parameter.scale <= parameter.upper)

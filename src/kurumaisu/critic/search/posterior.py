# SPDX-License-Identifier: BSD-3-Clause
"""How likely each cause is: the posterior over the sets that were fitted, without and with a curve beside them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.engine.catalogue import Candidate
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.search.curve_search import CurveSearch, SetWithCurve
from kurumaisu.critic.values.policy import MEMBER, NAMED, UNKNOWN_ODDS
from kurumaisu.types import FloatArray

_MOST = 7  # members of a set: more may be a chance leaving that everything explains a little
_NOT_BY_CHANCE = 1e-3  # posterior of nothing in its place below which a set may have more members
_LEFT_OUT = 0.05  # posterior of all that a set may be without
_RATHER = 3.0  # ratio of odds from which one effect acts in the place of another rather than beside it
_AS_GOOD = 2.0  # [nat] by which what explains as much may explain less: the truth itself does once in 44, by chance
_CLOSELY = 3.0  # times as closely as what it explains shows, from which a size is met by chance
_TINY = 1e-9  # posterior of what no set has
_NEAR, _LIKELY = 8.0, 5  # [nat] behind the best set within which others may be the cause in another noise; how many
_SAID = 1e-3  # posterior from which it is asked what a curve draws
_ENOUGH = 3  # residuals per parameter of the catalogue, at least


class SetPosterior:
    """Sets of effects, best first, and how likely each is; p: of each effect."""

    def __init__(self, ranked: Sequence[Fit], weights: FloatArray) -> None:
        self.ranked = ranked
        self.weights = weights
        self.p = {name: self.any_of([name]) for name in frozenset().union(*(fit.ids for fit in ranked))}

    def any_of(self, names: Iterable[str]) -> float:
        """Return how likely it is that one of some effects acts."""
        wanted = set(names)
        return float(sum(w for w, fit in zip(self.weights, self.ranked, strict=True) if fit.ids & wanted))

    def instead(self, name: str, other: str) -> bool:
        """Tell whether another effect acts rather in the place of one than beside it: by the ratio of their odds.

        Of two pairs of twins each is as likely with either of the other pair: it is in no place of that.
        """
        mine, its = (np.array([one in fit.ids for fit in self.ranked], dtype=np.bool_) for one in (name, other))
        one, rest, both, none = (
            float(self.weights[these].sum()) + _TINY for these in (mine & ~its, ~mine & its, mine & its, ~mine & ~its)
        )
        return one * rest > _RATHER * both * none


def confounded(posterior: SetPosterior, p: Mapping[str, float] | None = None) -> tuple[tuple[str, ...], ...]:
    """Return, for each uncertain effect of the best set, the set with those that could stand in, if one must act.

    p: of each effect, where more is known of it than the sets say, such as what curves do.
    """
    best = posterior.ranked[0]
    p = posterior.p if p is None else p
    merged: list[set[str]] = []
    apart: list[set[str]] = []
    for name in sorted(best.ids):
        if p[name] >= NAMED:
            continue
        group = _alone(posterior, name)
        if posterior.any_of(group) < NAMED:
            group = _with_others(posterior, name, group)
        if posterior.any_of(group) < NAMED:
            group = group | _exchanged(posterior, name)
        pair = {name} | {other for other in best.ids if p[other] < NAMED and posterior.instead(name, other)}
        if posterior.any_of(group) < NAMED <= posterior.any_of(pair):
            apart.append(pair | _as_good(posterior, {name}))
            continue
        meeting = [other for other in merged if other & group]
        merged = [other for other in merged if not other & group] + [group.union(*meeting)]
    told = (group for group in merged if len(group) > 1 and posterior.any_of(group) >= NAMED)
    kept = [group for group in told if len(group) <= _MOST or _needed(posterior, group)]
    sets = [_likeliest(posterior, group) | _as_good(posterior, group) for group in kept]
    # An effect that does two things may do the one in the place of one effect, and the other in that of another.
    sets += [pair for i, pair in enumerate(apart) if not any(pair <= other for other in [*sets, *apart[:i]])]
    return tuple(tuple(sorted(group)) for group in sets)


def _likeliest(posterior: SetPosterior, group: set[str]) -> set[str]:
    """Return a set without those of its members that all together act less than once in twenty, two at least."""
    ordered = sorted(group, key=lambda name: (posterior.p[name], name))
    left_out = np.cumsum([posterior.p[name] for name in ordered])
    few = min(int(np.searchsorted(left_out, _LEFT_OUT, side="right")), len(ordered) - 2)
    return set(ordered[few:])


def _as_good(posterior: SetPosterior, group: set[str]) -> set[str]:
    """Return what explains the drives as well as a member of the best set does, in its place, though less likely.

    Before the data its form may have been the less likely one: nobody who drove so could know. What has a size for
    everything, as a converter has steps, does so by chance.
    """
    best = posterior.ranked[0]
    places = [best.ids - {name} for name in best.ids & group]
    good = [fit for fit in posterior.ranked if _explained(fit) > _explained(best) - _AS_GOOD]
    own = ((fit, fit.ids - place) for fit in good for place in places if place < fit.ids)
    likely = ((fit, name) for fit, (name, *more) in own if not more and posterior.p[name] >= MEMBER / 10)
    return {name for fit, name in likely if not _by_chance(posterior, fit, name)}


def _by_chance(posterior: SetPosterior, fit: Fit, name: str) -> bool:
    """Tell whether a size of an effect must be met far more closely than what it explains would show."""
    nothing = next((other for other in posterior.ranked if not other.ids), fit)
    z = np.sqrt(2 * max(fit.log_likelihood - nothing.log_likelihood, 0.0))
    sizes = [i for i, term in enumerate(fit.terms) if term.id == name and not (term.fixed or term.shape)]
    return any(abs(fit.values[i] - fit.terms[i].null) > _CLOSELY * z * fit.sds[i] for i in sizes)


def _explained(fit: Fit) -> float:
    """Return the log likelihood [nat], less what any size that is fitted explains of noise."""
    return fit.log_likelihood - 0.5 * fit.sizes


def _needed(posterior: SetPosterior, group: set[str]) -> bool:
    """Tell whether it is no chance leaving that a group explains: what has none of it is out of the question."""
    rest = posterior.ranked[0].ids - group
    without = (w for w, fit in zip(posterior.weights, posterior.ranked, strict=True) if fit.ids <= rest)
    return bool(sum(without) < _NOT_BY_CHANCE)


def _alone(posterior: SetPosterior, name: str) -> set[str]:
    """Return an effect with those that do alone what it does: what needs others beside it is another story."""
    best = posterior.ranked[0]
    without = best.ids - {name}
    group = {name}
    for fit, weight in zip(posterior.ranked, posterior.weights, strict=True):
        stands_in = name not in fit.ids and len(fit.ids & without) >= len(without) - 1
        if stands_in and len(fit.ids) <= len(best.ids) and weight > MEMBER / 5:
            own = (other for other in fit.ids - best.ids if posterior.instead(name, other))
            group |= {other for other in own if posterior.p[other] >= MEMBER}
    return group


def _exchanged(posterior: SetPosterior, name: str) -> frozenset[str]:
    """Return the effects that do in the place of one nearly as likely what it does, though they act beside it as often.

    Where many do, as at a single speed, any two of them explain the drives as well.
    """
    without = posterior.ranked[0].ids - {name}
    pairs = zip(posterior.ranked, posterior.weights, strict=True)
    likely = (fit.ids - without for fit, w in pairs if without < fit.ids and _RATHER * w > posterior.weights[0])
    return frozenset[str]().union(*(own for own in likely if len(own) == 1))


def _with_others(posterior: SetPosterior, name: str, group: set[str]) -> set[str]:
    """Return the set with effects that do together what it does, the likeliest sets first, until one must act."""
    certain = {other for other, p in posterior.p.items() if p >= NAMED}
    for fit in posterior.ranked:
        if posterior.any_of(group) >= NAMED:
            break
        if name not in fit.ids:
            best = posterior.ranked[0].ids
            own = {other for other in fit.ids - certain if other not in best and posterior.instead(name, other)}
            group = group | own
    return group


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
    def near(self) -> tuple[Fit, ...]:
        """Return all fits that are nearly as likely as the best one, which comes first."""
        least = self.log_posterior(self.best) - _NEAR
        return tuple(fit for fit in self.fits if self.log_posterior(fit) > least)

    @property
    def likely(self) -> tuple[Fit, ...]:
        """Return the likeliest fits of some sets of effects, the best first: those that other noise may put first."""
        of_set: dict[frozenset[str], Fit] = {}
        for fit in self.near:
            of_set.setdefault(fit.ids, fit)
        return tuple(of_set.values())[:_LIKELY]

    def led_by(self, fit: Fit) -> SearchResult:
        """Return the same with one of the fits as the best, for which something speaks that the search did not ask."""
        return replace(self, fits=(fit, *(one for one in self.fits if one is not fit)))

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
    curves = [_told(one, fits, len(names), search) if told else one for one, told in zip(found, asked, strict=True)]
    acting = [(fit.ids, float(weight)) for fit, weight in zip(fits, weights, strict=True)]
    for one, weight in zip(curves, others, strict=True):
        drawn = (one.form_of, *(frozenset({name}) for name in sorted(one.likewise)))
        acting += [(one.fit.ids | ids, float(weight) / len(drawn)) for ids in drawn]
    p = dict.fromkeys(names, 0.0)
    for ids, weight in acting:
        for name in ids:
            p[name] += weight
    p = {name: min(each, 1.0) for name, each in p.items()}  # but for rounding
    p_curves: dict[str, float] = {}
    for one, weight in zip(curves, others, strict=True):
        if not one.form_of:
            p_curves[one.curve.id] = p_curves.get(one.curve.id, 0.0) + float(weight)
    sets = SetPosterior(fits, np.exp(bare - logsumexp(bare)))
    enough = len(fitted[frozenset()].beside.residual) > _ENOUGH * len(problem.terms)
    return SearchResult(tuple(fits), tuple(curves), p, p_curves, confounded(sets, p), enough)


def _told(one: SetWithCurve, fits: Sequence[Fit], of: int, search: CurveSearch) -> SetWithCurve:
    """Return a set with a curve, told as the form of the effects that it draws, if there are any.

    fits: the likeliest first. Two effects can draw much: they must be nearly as likely as the curve.
    """
    own, least = one.fit.candidates, log_posterior(one.fit, of) + one.nats - _NEAR
    more = [fit for fit in fits if own < fit.candidates]
    return search.as_form(
        one, [fit for fit in more if len(fit.candidates - own) == 1 or log_posterior(fit, of) > least]
    )

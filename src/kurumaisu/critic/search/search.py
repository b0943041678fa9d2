# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act: single effects propose, the joint evidence of sets decides.

Wang, Sarkar, Carbonetto and Stephens 2020 (J. R. Stat. Soc. B 82, 1273) sum single effects. Here they only propose, for
what two causes do together is no sum: the sets that they propose are fitted by simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.engine.scan import Dictionary, Guess, scan
from kurumaisu.critic.search.curve_search import CurveSearch, nearly_same_rates
from kurumaisu.critic.search.posterior import SearchResult, posterior
from kurumaisu.critic.values.prior import UNKNOWN_ODDS, log_prior

EffectSet = frozenset[Candidate]
_WIDTH = 3  # sets that are gone on from in a round
_NEAR = 8.0  # [nat] behind the best set within which one is gone on from
_ADDED = 8  # proposals beside a set, forms of one effect among them
_BESIDE_CURVE = 2  # of these, what is proposed beside the best curve
_SURELY = 4  # of those, tried however little they promise: what an equation misses is not in the promise
_SWAPPED = 4  # and in the place of each of its effects
_ASKED = 20.0  # [nat] behind the best set from which on no curve is asked for beside one
_HOPELESS = 10.0  # [nat] that a proposal may promise less than the best set has
_ROUNDS = 8
_CLOSER = 4  # sets beside which curves of other kinds are tried
_LARGEST = 6  # effects in a set
_STEP_COST = 4.0  # [nat] of a size that may be any of many


def search(
    problem: Problem, progress: Callable[[str], None], first: Sequence[Fit] = (), rounds: int = _ROUNDS
) -> SearchResult:
    """Return which effects act, and which curves may; first: sets to begin with; rounds: at most."""
    made = _Search(problem, progress, rounds)
    made.run(first)
    return posterior(problem, made.fits, made.curves)


class _Search:
    """The sets that were fitted, and what they propose."""

    def __init__(self, problem: Problem, progress: Callable[[str], None], rounds: int) -> None:
        self.problem, self._progress, self._rounds = problem, progress, rounds
        self.of = len({candidate.id for candidate in problem.candidates})
        self.fits: dict[EffectSet, Fit] = {}
        self.curves = CurveSearch(problem)
        self._dictionary = Dictionary(problem)
        self._done: set[EffectSet] = set()

    def bare(self, fit: Fit) -> float:
        """Return the log posterior of a set without a curve."""
        return log_posterior(fit, self.of) + float(np.log1p(-UNKNOWN_ODDS))

    def score(self, fit: Fit) -> float:
        """Return the log posterior of a set, with the best curve beside it where that is likelier.

        Curves are asked for beside sets that are near the best one.
        """
        bare = self.bare(fit)
        near = bare > max(map(self.bare, self.fits.values())) - _ASKED or not fit.candidates
        curves = self.curves.beside(fit) if near else self.curves.found(fit)
        return max(bare, log_posterior(fit, self.of) + (curves[0].nats if curves else -np.inf))

    def fit(self, chosen: EffectSet, start: Mapping[Key, float]) -> Fit | None:
        """Return the fit of a set, made now if it was not before."""
        ids = [candidate.id for candidate in chosen]
        if len(set(ids)) < len(ids) or len(ids) > _LARGEST:
            return None
        if chosen not in self.fits:
            self._progress(f"fitting {', '.join(sorted(ids)) or 'nothing'}")
            self.fits[chosen] = self.problem.fit_candidates(chosen, start)
        return self.fits[chosen]

    def run(self, first: Sequence[Fit]) -> None:
        """Go on from the best sets until none of them proposes anything."""
        self.fit(frozenset(), {})
        for known in first:
            self.fit(known.candidates, known.start)
        self._go_on()
        best = max(self.fits.values(), key=self.score)
        if not nearly_same_rates(self.problem, best):
            self.curves = CurveSearch(self.problem, best)
            self._go_on()
        near = [fit for fit in self.fits.values() if self.score(fit) > self.score(best) - _NEAR]
        near = sorted(near, key=self.score, reverse=True)[:_CLOSER]
        for fit in near:
            self.curves.closer(fit)
        best = max(self.fits.values(), key=self.score)
        if any(one.nats > 0 for one in self.curves.found(best)[:1]):
            for one in best.candidates:  # beside the closer curve it may be needless
                rest = self.fits.get(best.candidates - {one})
                if rest is not None and all(rest is not fit for fit in near):
                    self.curves.closer(rest)

    def _go_on(self) -> None:
        for _ in range(self._rounds):
            ranked = sorted(self.fits.values(), key=self.score, reverse=True)
            best = self.score(ranked[0])
            # What a curve draws beside nothing, two effects may do, of which neither comes near it by itself.
            likeliest = max(ranked, key=self.bare)
            near = [fit for fit in ranked[:_WIDTH] if self.score(fit) > best - _NEAR]
            ahead = [fit for fit in [*near, likeliest] if fit.candidates not in self._done]
            if not ahead:
                break
            for fit in ahead:
                if fit.candidates not in self._done:
                    self._done.add(fit.candidates)
                    self._expand(fit)

    def _expand(self, fit: Fit) -> None:
        best = max(self.bare(other) for other in self.fits.values())
        for k, guess in enumerate(self._proposals(fit, steps=True)[:_ADDED]):
            if (k < _SURELY and guess.nats > 0) or self.bare(fit) + guess.nats > best - _HOPELESS:
                self._with(fit, guess)
        for one in sorted(fit.candidates, key=lambda candidate: (candidate.id, len(candidate.terms))):
            rest = self.fit(fit.candidates - {one}, fit.start)
            if rest is None:
                continue
            if any(one.nats > 0 for one in self.curves.found(fit)[:1]):
                self.curves.beside(rest)  # beside the curve one of them may be needless
            proposals = self._proposals(rest, steps=not rest.ids)
            # Lines promise less than a fit keeps, of this one as of a rival that does the same.
            own = max((g.nats for g in proposals if g.candidate == one), default=np.inf)
            others = [g for g in proposals if g.candidate not in fit.candidates]
            for guess in others[:_SWAPPED]:
                if guess.nats > min(best - self.bare(rest), own) - _HOPELESS:
                    self._with(rest, guess)

    def _with(self, fit: Fit, guess: Guess) -> None:
        self.fit(fit.candidates | {guess.candidate}, {**fit.start, **guess.start})

    def _proposals(self, fit: Fit, *, steps: bool) -> list[Guess]:
        """Return what may act beside a fit, best first; what may act beside its best curve besides, comes behind."""
        plain = self._priced(fit, [*scan(self._dictionary, fit), *(self._steps(fit) if steps else ())])
        curves = self.curves.found(fit)
        if not curves or curves[0].nats <= 0:
            return plain
        beside = self._priced(fit, scan(self._dictionary, fit, self.curves.columns(fit, curves[0])))
        return [*plain[: _ADDED - _BESIDE_CURVE], *beside[:_BESIDE_CURVE], *plain[_ADDED - _BESIDE_CURVE :]]

    def _priced(self, fit: Fit, guesses: Sequence[Guess]) -> list[Guess]:
        """Return the best guess for each candidate, best first, with the prior of one more effect."""
        price = log_prior(len(fit.ids) + 1, self.of) - log_prior(len(fit.ids), self.of)
        first: dict[Candidate, Guess] = {}
        for guess in sorted(guesses, key=lambda guess: -guess.nats):
            first.setdefault(guess.candidate, replace(guess, nats=guess.nats + price))
        return list(first.values())

    def _steps(self, fit: Fit) -> Iterator[Guess]:
        """Yield what has many likely sizes, such as a converter's steps, with what the best one promises."""
        for candidate in self.problem.candidates:
            if candidate.id not in fit.ids and any(term.rough and not term.fixed for term in candidate.terms):
                nats = self.problem.start_values.step_evidence(candidate.terms, fit.terms, fit.values)
                yield Guess(candidate, {}, nats - float(np.log(candidate.ways)) - _STEP_COST)

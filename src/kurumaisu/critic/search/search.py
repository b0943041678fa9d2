# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act: single effects propose, the joint evidence of sets decides.

Wang, Sarkar, Carbonetto and Stephens 2020 (J. R. Stat. Soc. B 82, 1273) sum single effects. Here they only propose, for
what two causes do together is no sum: the sets that they propose are fitted by simulation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key, Term
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.search.curve_search import CurveSearch, nearly_same_rates
from kurumaisu.critic.search.posterior import SearchResult, posterior
from kurumaisu.critic.values.policy import UNKNOWN_ODDS, log_prior, occam
from kurumaisu.types import FloatArray

_FACTORS = (0.25, 1.0, 4.0, 16.0, 64.0)  # of a term's step: sizes that are tried first, either way
_ALIKE = 0.9  # correlation of neighbouring sizes' signals, at least
_HALVED = 3  # times a gap is halved to reach it
_STRAIGHT = 0.998  # correlation of the least and the largest size's signals from which one stands for all
_SHARES = (0.1, 10.0)  # of a signal by which its size is mended
_OWN = 1e-5  # share of a signal's square beyond what is beside a fit, below which nothing is left of it
_NOTHING = 1e-3  # whitened norm of a signal that is none
EffectSet = frozenset[Candidate]
_WIDTH = 3  # sets that are gone on from in a round
_NEAR = 8.0  # [nat] behind the best set within which one is gone on from
_ADDED = 8  # proposals beside a set, forms of one effect among them
_FIRST = 20  # the same beside nothing: at a single speed, say, many do what the best one does
_BESIDE_CURVE = 2  # of these, what is proposed beside the best curve
_SURELY = 4  # of those, tried however little they promise: what an equation misses is not in the promise
_SWAPPED = 4  # and in the place of each of its effects
_ASKED = 20.0  # [nat] behind the best set from which on no curve is asked for beside one
_HOPELESS = 10.0  # [nat] that a proposal may promise less than the best set has
_ROUNDS = 8
_MOST = 80  # sets fitted, after which no more is gone on from: where nothing explains all, many come near
_AGAIN = 20  # sets fitted in a second look, at least, before that
_CLOSER = 4  # sets beside which curves of other kinds are tried
_LARGEST = 6  # effects in a set
_STEP_COST = 4.0  # [nat] of a size that may be any of many


@dataclass(frozen=True)
class Signals:
    """What a candidate does: values (n, terms), whitened signals (rows, n); of (n,): which amplitude each moves."""

    candidate: Candidate
    values: FloatArray
    columns: FloatArray
    of: FloatArray


@dataclass(frozen=True)
class Guess:
    """A candidate with first values, and what it may explain [nat], by lines, less what it costs."""

    candidate: Candidate
    start: Mapping[Key, float]
    nats: float


class Dictionary:
    """The signals of all candidates about the model, each at sizes that cover what it may do."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._here = problem.residual((), np.empty(0))
        self.signals: list[Signals] = [found for c in problem.candidates if (found := self._signals(c)) is not None]
        whole = [np.empty((len(self._here), 0)), *(each.columns for each in self.signals)]
        self.single = np.concatenate(whole, axis=1, dtype=np.float32)  # those of all, in their order

    def _signals(self, candidate: Candidate) -> Signals | None:
        terms = candidate.terms
        nulls = np.array([term.parameter.lower if term.fixed else term.null for term in terms])
        if candidate.fixed:
            rows, columns, of = [nulls], [self._column(terms, nulls)], [-1]
        else:
            rows, columns, of = [], [], []
            for i, term in enumerate(terms):
                if term.fixed or term.shape or term.rough:
                    continue
                for values, column in self._sizes(terms, nulls, i):
                    rows.append(values)
                    columns.append(column)
                    of.append(i)
        loud = [k for k, column in enumerate(columns) if np.linalg.norm(column) > _NOTHING]
        if not loud:
            return None
        return Signals(
            candidate,
            np.array([rows[k] for k in loud]),
            np.array([columns[k] for k in loud]).T,
            np.array([of[k] for k in loud]),
        )

    def _column(self, terms: Sequence[Term], values: FloatArray) -> FloatArray:
        return np.asarray(self._here - self._problem.residual(terms, values))

    def _sizes(self, terms: Sequence[Term], nulls: FloatArray, i: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield values with one amplitude moved, and their signals, so close that neighbours are alike."""
        term, p = terms[i], terms[i].parameter

        def at(size: float) -> tuple[FloatArray, FloatArray]:
            values = np.where(np.arange(len(nulls)) == i, float(np.clip(term.null + size, p.lower, p.upper)), nulls)
            return values, self._column(terms, values)

        for sign in (1.0, -1.0):
            room = (p.upper - term.null) if sign > 0 else (term.null - p.lower)
            sizes = [f * abs(term.step) * p.scale for f in _FACTORS if f * abs(term.step) * p.scale < room]
            sizes = [*sizes, room] if room > 0 and (not sizes or room < 4 * sizes[-1]) else sizes
            found = [(size, *at(sign * size)) for size in sizes]
            found = [one for one in found if np.linalg.norm(one[2]) > _NOTHING]
            if not found:
                continue
            if _correlation(found[0][2], found[-1][2]) > _STRAIGHT:
                yield found[len(found) // 2][1:]
                continue
            for _ in range(_HALVED):
                gaps = [k for k in range(len(found) - 1) if _correlation(found[k][2], found[k + 1][2]) < _ALIKE]
                for k in reversed(gaps):
                    size = float(np.sqrt(found[k][0] * found[k + 1][0]))
                    found.insert(k + 1, (size, *at(sign * size)))
                if not gaps:
                    break
            yield from (one[1:] for one in found if np.linalg.norm(one[2]) > _NOTHING)


def scan(dictionary: Dictionary, fit: Fit, also: FloatArray | None = None) -> list[Guess]:
    """Return what each candidate would explain beside a fit, best first; also (rows, k): of a curve beside it."""
    beside = fit.beside
    missed = beside.covariance
    if also is not None:
        missed = missed.beside(also)
    inverse = missed.inverse(beside.residual)
    taken = fit.ids
    guesses: list[Guess] = []
    every, start = missed.along(dictionary.single), 0
    for signals in dictionary.signals:
        lost = every[:, start : (start := start + signals.columns.shape[1])]
        if signals.candidate.id in taken:
            continue
        columns = signals.columns
        pull = columns.T @ inverse
        own = beside.own.T @ columns
        square = np.sum(columns**2, axis=0) - np.sum(own**2, axis=0) - missed.lost @ lost**2
        pull = pull - own.T @ (beside.own.T @ inverse)
        whole = np.sum(columns**2, axis=0)
        known = square > _OWN * whole
        z = np.where(known, pull / np.sqrt(np.maximum(square, 1e-12)), 0.0)
        guesses += _guesses(signals, z, np.where(known, pull / np.maximum(square, 1e-12), 0.0))
    return sorted(guesses, key=lambda guess: -guess.nats)


def _guesses(signals: Signals, z: FloatArray, shares: FloatArray) -> Iterator[Guess]:
    """Yield the candidate with its best size, along each of its amplitudes together; shares: of each signal."""
    terms = signals.candidate.terms
    values = np.array([term.parameter.lower if term.fixed else term.null for term in terms])
    nats = -float(np.log(signals.candidate.ways))
    for i in np.unique(signals.of):
        mine = np.flatnonzero(signals.of == i)
        best = mine[int(np.argmax(z[mine]))]
        if z[best] <= 0 and len(np.unique(signals.of)) == 1:
            return
        if i < 0:  # as it is, or not at all
            nats += (shares[best] - 0.5) * (z[best] / max(shares[best], 1e-9)) ** 2
            continue
        nats += 0.5 * max(float(z[best]), 0.0) ** 2 - float(occam(max(float(z[best]), 0.0)))
        if z[best] > 0:
            p = terms[i].parameter
            size = (signals.values[best, i] - terms[i].null) * float(np.clip(shares[best], *_SHARES))
            values[i] = np.clip(terms[i].null + size, p.lower, p.upper)
    start = {term.key: float(value) for term, value in zip(terms, values, strict=True) if not term.shape}
    yield Guess(signals.candidate, start, nats)


def _correlation(one: FloatArray, other: FloatArray) -> float:
    norms = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / norms if norms > 0 else 1.0


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
        self._began, self._until = time.monotonic(), _MOST

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
            self._say(", ".join(sorted(ids)) or "nothing")
            self.fits[chosen] = self.problem.fit_candidates(chosen, start)
        return self.fits[chosen]

    def _say(self, what: str) -> None:
        done = len(self.fits)
        most = max(self._until, done + 1)
        left = (most - done) * (time.monotonic() - self._began) / max(done, 1)
        self._progress(f"fitting set {done + 1} of at most {most}, some {left:.0f} s to go: {what}")

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
        self._until = max(_MOST, len(self.fits) + _AGAIN)
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
                if fit.candidates not in self._done and len(self.fits) < self._until:
                    self._done.add(fit.candidates)
                    self._expand(fit)

    def _expand(self, fit: Fit) -> None:
        best = self._most()
        for k, guess in enumerate(self._proposals(fit, steps=True)[: _ADDED if fit.ids else _FIRST]):
            best = self._most() if k == _ADDED else best
            if (k < _SURELY and guess.nats > 0) or self.bare(fit) + guess.nats > best - _HOPELESS:
                self._with(fit, guess)
        for one in sorted(fit.candidates, key=lambda candidate: (candidate.id, len(candidate.terms))):
            self._exchange(fit, one, best)

    def _exchange(self, fit: Fit, one: Candidate, best: float) -> None:
        """Fit a set without one of its effects, with others in its place, and with other forms of it."""
        rest = self.fit(fit.candidates - {one}, fit.start)
        if rest is None:
            return
        if any(curve.nats > 0 for curve in self.curves.found(fit)[:1]):
            self.curves.beside(rest)  # beside the curve one of them may be needless
        proposals = self._proposals(rest, steps=not rest.ids)
        # Lines promise less than a fit keeps, of this one as of a rival that does the same.
        own = max((g.nats for g in proposals if g.candidate == one), default=np.inf)
        others = [g for g in proposals if g.candidate not in fit.candidates]
        for guess in others[:_SWAPPED]:
            if guess.nats > min(best - self.bare(rest), own) - _HOPELESS:
                self._with(rest, guess)
        # Lines say little about what has many likely sizes: its other forms are tried at the size that it has.
        for form in self.problem.candidates if one.rough else ():
            if form.id == one.id and form not in fit.candidates:
                self.fit(rest.candidates | {form}, fit.start)

    def _most(self) -> float:
        """Return the log posterior of the likeliest set without a curve."""
        return max(map(self.bare, self.fits.values()))

    def _with(self, fit: Fit, guess: Guess) -> None:
        if len(self.fits) < self._until:
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

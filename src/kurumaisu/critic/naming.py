# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act: a search over sets, its posterior, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic import stand_ins
from kurumaisu.critic.catalogue import Candidate, Key, Term
from kurumaisu.critic.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.exchanged import exchanges
from kurumaisu.critic.scan import Guess, Screen
from kurumaisu.critic.stand_ins import Posterior, confounded
from kurumaisu.critic.teeth import HOPE
from kurumaisu.types import FloatArray

NAMED, RIVAL = stand_ins.NAMED, stand_ins.RIVAL
_REFITS = 10  # sets refitted after each scan
_FEWER = 4  # of fewer effects than the best set has, besides
_BENT = 0.05  # share of what a set explains by which lines may be off for one effect that does what two do
_RIVALS = 2  # likely sets besides the best one from which others are looked for
_CLOSE = 12.0  # [nat] behind the best guess that a refit may make good
_ROUNDS = 8  # scans at most
_MOST = 200  # refitted sets from which on none is looked for: where ten effects seem to act, each round has a hundred
_HOPES = 3.0  # times what lines promise at most, about nothing, that something with a comb of likely values explains
_HOPELESS = 100.0  # [nat] behind the best set that nothing makes good
_STUCK = 0.5  # [nat] by which a fit must be beaten by mere first values to be made again
NULLS = 2000  # draws of the null calibration


@dataclass(frozen=True)
class Naming:
    """Result of a search.

    fits: all refitted sets, best first; log_posterior of each (not normalised); p: posterior per effect;
    confounded: sets of effects of which one acts, but the data do not say which; false_alarm: share of null draws,
    on this very design, with evidence at least as strong as the best single effect's; enough: there are more data than
    could be fitted by the catalogue as a whole.
    """

    fits: tuple[Fit, ...]
    p: dict[str, float]
    confounded: tuple[tuple[str, ...], ...]
    false_alarm: float
    enough: bool = True

    @property
    def best(self) -> Fit:
        """Return the most probable set."""
        return self.fits[0]

    @property
    def empty(self) -> Fit:
        """Return the fit of nothing."""
        return next(fit for fit in self.fits if not fit.candidates)

    def nats(self, fit: Fit) -> float:
        """Return the evidence [nat] of a set over nothing, none where data are too few to believe in it."""
        return fit.score - self.empty.score if self.enough else 0.0

    @property
    def named(self) -> tuple[str, ...]:
        """Return the effects of the best set that are certain enough to be named."""
        return tuple(name for name in sorted(self.best.ids) if self.p[name] >= NAMED)


Chosen = frozenset[Candidate]


def search(problem: Problem, progress: Callable[[str], None], first: Fit | None = None) -> Naming:
    """Scan sets of effects linearly, refit the promising ones, and go on from the best until it stays the best.

    first: a set to begin with, such as an earlier search under another noise has found.
    """
    count = len({candidate.id for candidate in problem.candidates})
    empty = problem.fit_candidates((), {})
    fits: dict[Chosen, Fit] = {empty.candidates: empty}

    def try_sets(guesses: Iterable[tuple[Chosen, Mapping[Key, float]]]) -> Fit:
        for chosen, start in guesses:
            old = fits.get(chosen)
            if old is not None and not begins_better(problem, old, start):
                continue
            progress(f"fitting {', '.join(sorted(candidate.id for candidate in chosen))}")
            fit = problem.fit_candidates(chosen, start)
            if old is None or fit.score > old.score:
                fits[chosen] = fit
        return max(fits.values(), key=lambda fit: log_posterior(fit, count))

    nothing = screen = Screen(problem, empty)
    centre, screened = empty, set[Chosen]()
    if first is not None and first.candidates:
        centre = try_sets([(first.candidates, first.start)])
        screen = Screen(problem, centre) if centre is not empty else nothing
    for _ in range(_ROUNDS):
        guesses = screen.guesses()
        near = _promising(guesses, centre, centre.log_likelihood - empty.log_likelihood)
        best = try_sets((guess.chosen, guess.start) for guess in near)
        if best is centre:  # the last word is by fits: could others stand in, and does each have to be there?
            alone: list[tuple[Chosen, Mapping[Key, float]]] = [
                (frozenset({other}), {}) for other in screen.fixed if nothing.mends(other)
            ]
            best = try_sets([*alone, *_neighbours(problem, screen, nothing, best)])
        if best is centre:
            best = try_sets(_beside_rivals(problem, _ranked(fits, count), count, screened))
        if best is centre or len(fits) > _MOST:
            break
        centre = best
        screen = Screen(problem, centre)
    try_sets(exchanges(_ranked(fits, count), count))
    ranked = _ranked(fits, count)
    weights = np.array([log_posterior(fit, count) for fit in ranked])
    weights = np.exp(weights - logsumexp(weights))

    posterior = Posterior(ranked, weights)
    p = {name: posterior.p.get(name, 0.0) for name in sorted({candidate.id for candidate in problem.candidates})}
    return Naming(tuple(ranked), p, confounded(posterior), _false_alarm(nothing), nothing.enough)


def _ranked(fits: Mapping[Chosen, Fit], of: int) -> list[Fit]:
    return sorted(fits.values(), key=lambda fit: -log_posterior(fit, of))


def _promising(guesses: Sequence[Guess], about: Fit, explained: float) -> list[Guess]:
    """Return the guesses that are worth a refit, of those about a fit; explained: what that explains [nat].

    Lines about two effects tell little of one that does what both do: it has the more to gain by a refit, and without
    one it would never be known that fewer suffice. None is worth one where by their lines all leave their bounds.
    """
    best = max((guess.score for guess in guesses), default=0.0)
    close = [guess for guess in guesses[:_REFITS] if guess.score > best - _CLOSE]
    far = best - max(_CLOSE, _BENT * explained)
    size = len(about.candidates)
    fewer = [guess for guess in guesses[len(close) :] if len(guess.chosen) < size and guess.score > far]
    # Parts of the fit's set are tried anyway.
    return close + [guess for guess in fewer if not guess.chosen < about.candidates][:_FEWER]


def _beside_rivals(
    problem: Problem, ranked: Sequence[Fit], of: int, screened: set[Chosen]
) -> Iterator[tuple[Chosen, Mapping[Key, float]]]:
    """Yield what promises more than a likely rival of the best set, seen from there; screened: whence it was seen.

    Where one effect does what two others do together, the best set may be several exchanges away from the second best.
    """
    likely = [fit for fit in ranked[1:] if log_posterior(fit, of) > log_posterior(ranked[0], of) + np.log(RIVAL)]
    for fit in likely[:_RIVALS]:
        if fit.candidates and fit.candidates not in screened:
            screened.add(fit.candidates)
            guesses = Screen(problem, fit).guesses()
            own = next((guess.score for guess in guesses if guess.chosen == fit.candidates), -np.inf)
            yield from ((guess.chosen, guess.start) for guess in guesses[:_REFITS] if guess.score > own)


def begins_better(problem: Problem, fit: Fit, start: Mapping[Key, float]) -> bool:
    """Tell whether other first values of a set, or of a part of it, explain more than its fit, which stuck half way.

    Else what is needless seems to act, and what stands in for what acts seems not to.
    """
    own = fit.start if fit.terms else {}
    if not any(key in start for key in own):
        return False
    values = np.array(
        [term.parameter.lower if term.fixed else start.get(term.key, own[term.key]) for term in fit.terms]
    )
    left = problem.residual(fit.terms, values)
    return -0.5 * float(left @ left) > fit.log_likelihood + _STUCK


def _neighbours(
    problem: Problem, screen: Screen, nothing: Screen, fit: Fit
) -> Iterator[tuple[Chosen, Mapping[Key, float]]]:
    """Yield the set without each of its effects, with what can only act or not, and with each rival instead."""
    kept = fit.start
    for one in sorted(fit.candidates, key=lambda candidate: candidate.id):
        yield fit.candidates - {one}, kept
        for other in problem.candidates:
            new = other.id not in fit.ids - {one.id} and other not in fit.candidates
            # What clips or swallows hides its rivals: beside it their columns are empty, without it they are not.
            alike = screen.related(one, other) or nothing.related(one, other)
            if new and (screen.mends(other, one) if other.fixed else alike):
                # What fits one form of a comb is nowhere near what fits another.
                begin = {key: value for key, value in kept.items() if not other.rough or key[0] != other.id}
                yield fit.candidates - {one} | {other}, begin
                if other.id == one.id:  # what stood in for the right form may go with the wrong one
                    rest = fit.candidates - {one}
                    yield from ((rest - gone | {other}, begin) for gone in _that_stood_in(rest))
    for other in screen.fixed:
        if other.id not in fit.ids and screen.mends(other):
            yield fit.candidates | {other}, kept
    for other in problem.candidates:
        if other.rough and other.id not in fit.ids:
            if not hopeless_alone(problem, other, nothing.centre, fit):
                yield frozenset({other}), {}
            yield fit.candidates | {other}, kept
    # Its tooth was the best one when less acted beside it.
    yield from (
        (fit.candidates, problem.teeth.anew(fit.terms, fit.values, one.id)) for one in fit.candidates if one.rough
    )
    yield from _combs(problem, screen, fit)


def _that_stood_in(rest: Chosen) -> Iterator[Chosen]:
    """Yield each effect of some, and each pair of which one shows in the forward speed and the other in the yaw rate.

    Steps of a converter are in both, so for their wrong form two may stand in.
    """
    yield from (frozenset({one}) for one in rest)
    yield from (frozenset({one, other}) for one in rest if _in_v(one) for other in rest if not _in_v(other))


def _in_v(candidate: Candidate) -> bool:
    return getattr(effects.by_id(candidate.id), "shows_in", None) == effects.Rate.V


def hopeless_alone(problem: Problem, rough: Candidate, empty: Fit, fit: Fit) -> bool:
    """Tell whether something rough, even if it explains several times what its best tooth promises, is far behind.

    Nobody asks what is thousands of nats behind, but to find that out would take as long as any other fit.
    """
    sizes = [term for term in rough.terms if not term.fixed and not term.shape]
    if not all(term.rough for term in sizes):
        return False
    hope = max(problem.teeth.hope(rough.terms, empty.terms, empty.values), 0.0) * problem.teeth.share * len(sizes)
    return empty.log_likelihood + _HOPES * hope < fit.log_likelihood - _HOPELESS


def _combs(problem: Problem, screen: Screen, fit: Fit) -> Iterator[tuple[Chosen, Mapping[Key, float]]]:
    """Yield what has a comb of likely values beside the part of the set that leaves it most to explain.

    Smooth effects that draw the mean of its steps together leave no tooth that stands out beside all of them.
    """
    parts = [(part, *_left(problem, part)) for part in screen.parts()]
    for other in problem.candidates if parts else ():
        if not other.rough or other in fit.candidates:
            continue
        hopes = [
            (problem.teeth.hope(other.terms, terms, values), likelihood, part)
            for part, terms, values, likelihood in parts
        ]
        hope, likelihood, part = max(hopes, key=lambda found: found[0] + found[1])
        if hope > HOPE and likelihood + hope > fit.log_likelihood - _CLOSE:
            begin = {key: value for key, value in part.start.items() if key[0] != other.id}
            yield frozenset(each for each in part.chosen if each.id != other.id) | {other}, begin


def _left(problem: Problem, part: Guess) -> tuple[tuple[Term, ...], FloatArray, float]:
    """Return the terms and values of a guess, and its log likelihood when simulated."""
    ordered = sorted(part.chosen, key=lambda candidate: candidate.id)
    terms = tuple(term for candidate in ordered for term in candidate.terms)
    values = np.array([term.parameter.lower if term.fixed else part.start.get(term.key, term.null) for term in terms])
    left = problem.residual(terms, values)
    return terms, values, -0.5 * float(left @ left)


def _false_alarm(screen: Screen) -> float:
    """Return how often noise alone, b ~ N(0, G), gives a single effect the evidence that the data give the best one."""
    loud = [i for i, term in enumerate(screen.terms) if not term.shape]
    if not loud:
        return 1.0
    correlation = screen.correlation[np.ix_(loud, loud)]
    observed = screen.b[loud] / np.sqrt(np.maximum(np.diag(screen.gram)[loud], 1e-18))
    roots = np.linalg.cholesky(correlation + 1e-6 * np.eye(len(loud)))
    draws = np.random.default_rng(0).standard_normal((NULLS, len(loud))) @ roots.T
    return float(np.mean(np.abs(draws).max(axis=1) >= np.abs(observed).max()))

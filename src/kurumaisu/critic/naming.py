# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act: a search over sets, its posterior, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.evidence import Fit, Problem, covariance, occam
from kurumaisu.types import FloatArray

NAMED = 0.9  # posterior from which a cause is named
RIVAL = 0.05  # posterior from which an effect counts as a rival of another
_PRIOR = 0.1  # of any one effect to be at work, before the data
_LARGEST = 3  # effects in a set that the linear scan tries; larger sets grow from the best ones
_REFITS = 8  # sets refitted after each scan
NULLS = 2000  # draws of the null calibration


@dataclass(frozen=True)
class Naming:
    """Result of a search.

    fits: all refitted sets, best first; log_posterior of each (not normalised); p: posterior per effect;
    confounded: sets of effects of which one acts, but the data do not say which; false_alarm: share of null draws,
    on this very design, with evidence at least as strong as the best single effect's.
    """

    fits: tuple[Fit, ...]
    p: dict[str, float]
    confounded: tuple[tuple[str, ...], ...]
    false_alarm: float

    @property
    def best(self) -> Fit:
        """Return the most probable set."""
        return self.fits[0]

    @property
    def named(self) -> tuple[str, ...]:
        """Return the effects of the best set that are certain enough to be named."""
        return tuple(term.id for term in self.best.terms if self.p[term.id] >= NAMED)


def search(problem: Problem, progress: Callable[[str], None]) -> Naming:
    """Scan sets of effects linearly, refit the promising ones, and go on from the best until it stays the best."""
    ids = tuple(dict.fromkeys(term.id for term in problem.terms))
    empty = problem.fit((), {})
    fits: dict[frozenset[str], Fit] = {empty.ids: empty}
    centre = empty

    def try_sets(guesses: Iterable[tuple[frozenset[str], dict[str, float]]]) -> Fit:
        for chosen, start in guesses:
            if chosen not in fits:
                progress(f"fitting {', '.join(sorted(chosen))}")
                fits[chosen] = problem.fit(chosen, start)
        return max(fits.values(), key=lambda fit: fit.score + log_prior(len(fit.ids), len(ids)))

    while True:
        best = try_sets((guess.ids, guess.start) for guess in _scan(problem, centre, ids))
        if best is centre:  # the last word is by fits: could any other effect stand in for one of these?
            best = try_sets(_swaps(best, ids))
        if best is centre:
            break
        centre = best
    ranked = sorted(fits.values(), key=lambda fit: -(fit.score + log_prior(len(fit.ids), len(ids))))
    weights = _weights(ranked, ids)

    def p_any(names: Iterable[str]) -> float:
        return float(sum(w for w, fit in zip(weights, ranked, strict=True) if fit.ids & set(names)))

    p = {name: p_any([name]) for name in ids}
    return Naming(tuple(ranked), p, _confounded(ranked[0], p, p_any), _false_alarm(problem, empty, ids))


def log_prior(size: int, of: int) -> float:
    """Return the log prior of a set of so many effects out of so many."""
    return float(size * np.log(_PRIOR) + (of - size) * np.log1p(-_PRIOR))


def _swaps(fit: Fit, ids: tuple[str, ...]) -> Iterator[tuple[frozenset[str], dict[str, float]]]:
    for one in sorted(fit.ids):
        for other in ids:
            if other not in fit.ids:
                kept = {term.id: float(value) for term, value in zip(fit.terms, fit.values, strict=True)}
                yield fit.ids - {one} | {other}, kept


@dataclass(frozen=True)
class _Guess:
    ids: frozenset[str]
    start: dict[str, float]
    score: float


def _scan(problem: Problem, centre: Fit, ids: tuple[str, ...]) -> list[_Guess]:
    """Return the most probable sets of up to _LARGEST changes, from columns linearised at a fit.

    A change adds an effect to the fit's set or takes one out, so that swaps are found: two effects may cancel.
    """
    columns = problem.columns(centre.terms, centre.values, problem.terms)
    y = problem.residual(centre.terms, centre.values)
    gram, b = columns.T @ columns, columns.T @ y
    guesses = []
    for size in range(_LARGEST + 1):
        for changes in combinations(ids, size):
            chosen = centre.ids.symmetric_difference(changes)
            guess = _linear(problem, centre, chosen, gram, b)
            if guess is not None:
                guesses.append(guess)
    guesses.sort(key=lambda guess: -(guess.score + log_prior(len(guess.ids), len(ids))))
    return guesses[:_REFITS]


def _linear(problem: Problem, centre: Fit, chosen: frozenset[str], gram: FloatArray, b: FloatArray) -> _Guess | None:
    """Return a set's estimate and score by the linearisation; None where a parameter leaves its bounds."""
    fitted = {(term.id, term.parameter.name): value for term, value in zip(centre.terms, centre.values, strict=True)}
    known = np.array(
        [(fitted.get((t.id, t.parameter.name), t.null) - t.null) / t.parameter.scale for t in problem.terms]
    )
    use = np.array([term.id in chosen for term in problem.terms])
    # All offsets from null: those of effects taken out of the fit fall back to 0 and return to the residual.
    target = b + gram @ known
    if not use.any():
        return _Guess(chosen, {}, -0.5 * float(known @ gram @ known) - float(b @ known))
    inverse = covariance(gram[np.ix_(use, use)])
    offsets = inverse @ target[use]
    terms = [term for term, used in zip(problem.terms, use, strict=True) if used]
    values = [term.null + x * term.parameter.scale for term, x in zip(terms, offsets, strict=True)]
    if any(not t.parameter.lower <= v <= t.parameter.upper for t, v in zip(terms, values, strict=True)):
        return None
    step = np.zeros(len(known))
    step[use] = offsets
    step -= known
    gained = float(b @ step) - 0.5 * float(step @ gram @ step)
    z = offsets / np.sqrt(np.diag(inverse))
    start = {term.id: value for term, value in zip(terms, values, strict=True)}
    return _Guess(chosen, start, gained - float(occam(z).sum()))


def _weights(fits: Sequence[Fit], ids: tuple[str, ...]) -> FloatArray:
    """Return the posterior of each fit, all together 1."""
    weights = np.array([fit.score + log_prior(len(fit.ids), len(ids)) for fit in fits])
    return np.asarray(np.exp(weights - logsumexp(weights)))


def _confounded(best: Fit, p: dict[str, float], p_any: Callable[[Iterable[str]], float]) -> tuple[tuple[str, ...], ...]:
    """Return the best set's uncertain effects with the rivals that could stand in for them, if one of them must act."""
    uncertain = sorted(name for name in best.ids if p[name] < NAMED)
    rivals = sorted(name for name in p if name not in best.ids and p[name] >= RIVAL)
    group = tuple(uncertain + rivals)
    return (group,) if uncertain and len(group) > 1 and p_any(group) >= NAMED else ()


def _false_alarm(problem: Problem, empty: Fit, ids: tuple[str, ...]) -> float:
    """Return how often noise alone, b ~ N(0, G), gives a single effect the evidence that the data give the best one."""
    columns = problem.columns((), np.empty(0), problem.terms)
    norms = np.linalg.norm(columns, axis=0)
    seen = np.maximum(norms, 1e-9)
    correlation = (columns / seen).T @ (columns / seen)
    observed = columns.T @ problem.residual((), np.empty(0)) / seen
    roots = np.linalg.cholesky(correlation + 1e-9 * np.eye(len(seen)))
    draws = np.random.default_rng(0).standard_normal((NULLS, len(seen))) @ roots.T
    return float(np.mean(np.abs(draws).max(axis=1) >= np.abs(observed).max()))

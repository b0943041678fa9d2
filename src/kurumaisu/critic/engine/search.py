# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act: a search over sets, its posterior, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.engine.catalogue import Key
from kurumaisu.critic.engine.confounding import SetPosterior, confounded
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.engine.linear_screening import Screen, ScreenedSet
from kurumaisu.critic.engine.neighbouring_sets import CLOSE, EffectSet, neighbouring_sets
from kurumaisu.critic.engine.refit import other_step_size, start_is_better
from kurumaisu.critic.engine.swapped_sets import swapped_sets
from kurumaisu.critic.values.policy import NAMED, RIVAL

_REFITS = 10  # sets refitted after each scan
_FEWER = 4  # of fewer effects than the best set has, besides
_LINE_ERROR = 0.05  # share of what a set explains by which lines may be off for one effect that does what two do
_ALTERNATIVES = 2  # likely sets besides the best one from which others are looked for
_ROUNDS = 8  # scans at most
_MOST = 200  # refitted sets from which on none is looked for: where ten effects seem to act, each round has a hundred
NULLS = 2000  # draws of the null calibration


@dataclass(frozen=True)
class SearchResult:
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


def search(problem: Problem, progress: Callable[[str], None], first: Fit | None = None) -> SearchResult:
    """Scan sets of effects linearly, refit the promising ones, and go on from the best until it stays the best.

    first: a set to begin with, such as an earlier search under another noise has found.
    """
    count = len({candidate.id for candidate in problem.candidates})
    empty = problem.fit_candidates((), {})
    fits: dict[EffectSet, Fit] = {empty.candidates: empty}
    begun = set[tuple[EffectSet, float]]()

    def try_sets(guesses: Iterable[tuple[EffectSet, Mapping[Key, float]]]) -> Fit:
        for chosen, start in guesses:
            old = fits.get(chosen)
            if old is not None and not (other_step_size(old, start, begun) or start_is_better(problem, old, start)):
                continue
            progress(f"fitting {', '.join(sorted(candidate.id for candidate in chosen))}")
            fit = problem.fit_candidates(chosen, start)
            if old is None or fit.score > old.score:
                fits[chosen] = fit
        return max(fits.values(), key=lambda fit: log_posterior(fit, count))

    nothing = screen = Screen(problem, empty)
    centre, screened = empty, set[EffectSet]()
    if first is not None and first.candidates:
        centre = try_sets([(first.candidates, first.start)])
        screen = Screen(problem, centre) if centre is not empty else nothing
    for _ in range(_ROUNDS):
        guesses = screen.guesses()
        near = _promising(guesses, centre, centre.log_likelihood - empty.log_likelihood)
        best = try_sets((guess.chosen, guess.start) for guess in near)
        if best is centre:  # the last word is by fits: could others stand in, and does each have to be there?
            alone: list[tuple[EffectSet, Mapping[Key, float]]] = [
                (frozenset({other}), {}) for other in screen.fixed if nothing.mends(other)
            ]
            best = try_sets([*alone, *neighbouring_sets(problem, screen, nothing, best)])
        if best is centre:
            best = try_sets(_about_alternatives(problem, _ranked(fits, count), count, screened))
        if best is centre or len(fits) > _MOST:
            break
        centre = best
        screen = Screen(problem, centre)
    try_sets(swapped_sets(_ranked(fits, count), count))
    ranked = _ranked(fits, count)
    weights = np.array([log_posterior(fit, count) for fit in ranked])
    weights = np.exp(weights - logsumexp(weights))

    posterior = SetPosterior(ranked, weights)
    p = {name: posterior.p.get(name, 0.0) for name in sorted({candidate.id for candidate in problem.candidates})}
    return SearchResult(tuple(ranked), p, confounded(posterior), _false_alarm(nothing), nothing.enough)


def _ranked(fits: Mapping[EffectSet, Fit], of: int) -> list[Fit]:
    return sorted(fits.values(), key=lambda fit: -log_posterior(fit, of))


def _promising(guesses: Sequence[ScreenedSet], about: Fit, explained: float) -> list[ScreenedSet]:
    """Return the guesses that are worth a refit, of those about a fit; explained: what that explains [nat].

    Lines about two effects tell little of one that does what both do: it has the more to gain by a refit, and without
    one it would never be known that fewer suffice. None is worth one where by their lines all leave their bounds.
    """
    best = max((guess.score for guess in guesses), default=0.0)
    close = [guess for guess in guesses[:_REFITS] if guess.score > best - CLOSE]
    far = best - max(CLOSE, _LINE_ERROR * explained)
    size = len(about.candidates)
    fewer = [guess for guess in guesses[len(close) :] if len(guess.chosen) < size and guess.score > far]
    # Parts of the fit's set are tried anyway.
    return close + [guess for guess in fewer if not guess.chosen < about.candidates][:_FEWER]


def _about_alternatives(
    problem: Problem, ranked: Sequence[Fit], of: int, screened: set[EffectSet]
) -> Iterator[tuple[EffectSet, Mapping[Key, float]]]:
    """Yield what promises more than a likely rival of the best set, seen from there; screened: whence it was seen.

    Where one effect does what two others do together, the best set may be several exchanges away from the second best.
    """
    likely = [fit for fit in ranked[1:] if log_posterior(fit, of) > log_posterior(ranked[0], of) + np.log(RIVAL)]
    for fit in likely[:_ALTERNATIVES]:
        if fit.candidates and fit.candidates not in screened:
            screened.add(fit.candidates)
            guesses = Screen(problem, fit).guesses()
            own = next((guess.score for guess in guesses if guess.chosen == fit.candidates), -np.inf)
            yield from ((guess.chosen, guess.start) for guess in guesses[:_REFITS] if guess.score > own)


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

# SPDX-License-Identifier: BSD-3-Clause
"""Linear screening: how good sets of effects would be, from columns linearised at a fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key, Term
from kurumaisu.critic.engine.evidence import Fit, Problem, covariance
from kurumaisu.critic.values.prior import log_prior, occam
from kurumaisu.types import FloatArray

ALIKE = 0.9995  # correlation of columns from which no drive like these tells their effects apart
_JOINT = 0.6  # correlation from which three changes are tried together: two may cancel
_ENOUGH = 3  # residuals per parameter of the catalogue, at least
_COMMON_PART = 0.3  # correlation from which one effect may pass for another
_SWAPS = 3  # changes to a set at most
_LARGEST = 6  # effects in a set: what is in no catalogue and strong would be pieced together from a dozen, for minutes


@dataclass(frozen=True)
class ScreenedSet:
    """A set with first values, and its log evidence with its prior, relative to other guesses."""

    chosen: frozenset[Candidate]
    start: dict[Key, float]
    score: float


class Screen:
    """Columns of every term at a fit, and what they say about other sets."""

    def __init__(self, problem: Problem, centre: Fit) -> None:
        self.problem, self.centre = problem, centre
        self.terms: tuple[Term, ...] = problem.terms
        self.fixed = [candidate for candidate in problem.candidates if candidate.fixed]
        y, columns = problem.linearised(centre.terms, centre.values, self.terms)
        self.enough = len(y) > _ENOUGH * len(self.terms)
        self.gram, self.b = columns.T @ columns, columns.T @ y
        norms = np.sqrt(np.maximum(np.diag(self.gram), 1e-18))
        self.correlation = self.gram / np.outer(norms, norms)
        self._index: Mapping[Key, int] = {term.key: i for i, term in enumerate(self.terms)}
        fitted = centre.start
        self._known = np.array([self._steps(term, fitted.get(term.key, term.null)) for term in self.terms])

    def alike(self, one: Candidate, other: Candidate) -> bool:
        """Tell whether two effects of one parameter have the same column."""
        mine, others = ([term for term in c.terms if not term.fixed] for c in (one, other))
        if len(mine) != 1 or len(others) != 1:
            return False
        i, j = self._index[mine[0].key], self._index[others[0].key]
        return bool(abs(self.correlation[i, j]) > ALIKE)

    def related(self, one: Candidate, other: Candidate) -> bool:
        """Tell whether one could stand in for the other: their columns have something in common, or one has none."""
        return one.fixed or other.fixed or self._common(one, other) > _COMMON_PART

    def mends(self, fixed: Candidate, instead: Candidate | None = None) -> bool:
        """Tell whether the fit gets better with an effect that can only act or not, perhaps instead of another."""
        start = {**self.centre.start, **{term.key: term.parameter.lower for term in fixed.terms}}
        gone = {term.key for term in instead.terms} if instead else set()
        terms = (*(term for term in self.centre.terms if term.key not in gone), *fixed.terms)
        left = self.problem.residual(terms, np.array([start[term.key] for term in terms]))
        return 0.5 * float(left @ left) < -self.centre.log_likelihood

    def guesses(self) -> list[ScreenedSet]:
        """Return sets of up to _SWAPS changes to the fit's set, best first."""
        found = [guess for chosen in self._sets() if (guess := self._guess(chosen)) is not None]
        return sorted(found, key=lambda guess: -guess.score)

    def parts(self) -> list[ScreenedSet]:
        """Return of each size below the set's, down to 1, the part that explains most alone."""
        own = sorted(self.centre.candidates, key=_name)
        found = []
        for size in range(1, len(own)):
            guesses = (self._guess(frozenset(part)) for part in combinations(own, size))
            found += [max(filter(None, guesses), key=lambda guess: guess.score, default=None)]
        return [guess for guess in found if guess is not None]

    def _sets(self) -> Iterator[frozenset[Candidate]]:
        """Yield the fit's set with effects added and taken out; three changes only where some of them may cancel."""
        own = sorted(self.centre.candidates, key=_name)
        others = [c for c in self.problem.candidates if c.usual and not c.fixed and c not in self.centre.candidates]
        pool = [*own, *others]
        joint = [[self._common(one, other) > _JOINT for other in pool] for one in pool]
        for size in range(_SWAPS + 1):
            for changes in combinations(range(len(pool)), size):
                if size == _SWAPS and not all(any(joint[i][j] for j in changes if j != i) for i in changes):
                    continue
                chosen = self.centre.candidates.symmetric_difference(pool[i] for i in changes)
                if self._allowed(chosen):
                    yield chosen

    def _common(self, one: Candidate, other: Candidate) -> float:
        return max(
            (
                abs(float(self.correlation[self._index[a.key], self._index[b.key]]))
                for a in one.terms
                for b in other.terms
                if a.key in self._index and b.key in self._index
            ),
            default=0.0,
        )

    def _allowed(self, chosen: frozenset[Candidate]) -> bool:
        ids = [candidate.id for candidate in chosen]
        few = len(set(ids)) == len(ids) <= _LARGEST
        return few and not any(self.alike(a, b) for a, b in combinations(chosen, 2))

    def _guess(self, chosen: frozenset[Candidate]) -> ScreenedSet | None:
        """Return a set's estimate and score by the linearisation; None where a parameter leaves its bounds."""
        ordered = sorted(chosen, key=_name)
        use = [self._index[t.key] for c in ordered for t in c.terms if t.key in self._index and not t.shape]
        of = len({candidate.id for candidate in self.problem.candidates})
        known, gram = self._known, self.gram
        prior = log_prior(len(chosen), of) - sum(float(np.log(c.ways)) for c in chosen)
        if not use:
            return ScreenedSet(chosen, {}, -0.5 * float(known @ gram @ known) - float(self.b @ known) + prior)
        # All offsets from null: those of effects taken out of the fit fall back to 0 and return to the residual.
        target = (self.b + gram @ known)[use]
        offsets = covariance(gram[np.ix_(use, use)]) @ target
        start = {}
        for i, x in zip(use, offsets, strict=True):
            term = self.terms[i]
            value = term.null + float(x) * term.step * term.parameter.scale
            if not term.parameter.lower <= value <= term.parameter.upper:
                return None
            if not term.rough or term.key in self.centre.start:  # else it is searched for
                start[term.key] = value
        step = -known
        step[use] += offsets
        gained = float(self.b @ step) - 0.5 * float(step @ gram @ step)
        return ScreenedSet(chosen, start, gained - self._costs(use, offsets) + prior)

    def _costs(self, use: Sequence[int], offsets: FloatArray) -> float:
        signals = np.abs(offsets) * np.sqrt(np.diag(self.gram)[use])
        part = self.correlation[np.ix_(use, use)] + 1e-3 * np.eye(len(use))
        return float(np.sum(occam(signals))) + 0.5 * float(np.linalg.slogdet(part)[1])

    def _steps(self, term: Term, value: float) -> float:
        return (value - term.null) / (term.step * term.parameter.scale) if not term.shape else 0.0


def _name(candidate: Candidate) -> tuple[str, int]:
    return candidate.id, len(candidate.terms)

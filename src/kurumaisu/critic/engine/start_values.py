# SPDX-License-Identifier: BSD-3-Clause
"""First values of a fit, and the likeliest of the many peaks that the likelihood of a converter's step has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import Key, Term
from kurumaisu.critic.engine.step_likelihood import StepLikelihood
from kurumaisu.types import FloatArray

_STARTS = (1.0, 4.0, 16.0)  # steps from null, either way, from which a fit may start
_PLACES = 17  # that are tried on a peak
_ROUNDS, _BETTER = 8, 0.1  # how often a peak is left for a likelier one close by, and by how much that is so [nat]
STEP_EVIDENCE = 4.0  # [nat] less is not worth a closer look: a peak costs more


class LinearByDrive(least_squares.Linearised, Protocol):
    """What can be fitted, drive by drive."""

    def residuals(self, terms: Sequence[Term], values: FloatArray) -> list[FloatArray]:
        """Return the whitened residual of each drive."""


class StartValues:
    """First values; of what is rough, by the likelihood of what every size would explain."""

    def __init__(self, problem: LinearByDrive, likelihood: Callable[[], StepLikelihood]) -> None:
        """Take what is fitted; likelihood: makes that of its drives, where something is rough."""
        self._problem, self._make = problem, likelihood

    @cached_property
    def _likelihood(self) -> StepLikelihood:
        return self._make()

    @property
    def share(self) -> float:
        """Return how many times longer the drives are than what the likelihood sees of them."""
        return self._likelihood.share

    def first(self, terms: Sequence[Term], start: Mapping[Key, float]) -> FloatArray:
        """Return first values: those given; for others, one after the other, the best of some steps from null."""
        lower = np.array([term.parameter.lower for term in terms])
        upper = np.array([term.parameter.upper for term in terms])
        values = np.array([start.get(term.key, term.null) for term in terms])
        values = np.clip(values, lower, upper)
        for i, term in enumerate(terms):
            if term.key in start or term.shape or term.fixed:
                continue
            steps = [sign * n * term.step * term.parameter.scale for n in _STARTS for sign in (1, -1)]
            values = self._best(terms, values, i) if term.rough else values
            values = self._nearest(terms, values, i, [term.null + step for step in steps])
        return values

    def likeliest(self, terms: Sequence[Term], solution: least_squares.Solution) -> least_squares.Solution:
        """Return a solution in which what is rough is where none close by is likelier.

        The peak on which it began was the best one before the others were fitted.
        """
        rough = [i for i, term in enumerate(terms) if term.rough and not term.fixed]
        for _ in range(_ROUNDS if rough else 0):
            values = solution.values
            for i in rough:
                apart = self._likelihood.apart(terms[i], _form(terms, terms[i].id), float(values[i]))
                for way in (apart, apart / _PLACES):
                    values = self._nearest(terms, values, i, values[i] + way * np.linspace(-1.0, 1.0, _PLACES))
            left = self._problem.residual(terms, values)
            if 0.5 * float(solution.residual @ solution.residual - left @ left) < _BETTER:
                break
            again = least_squares.least_squares(self._problem, terms, values)
            if again.cost >= solution.cost:
                break
            solution = again
        return solution

    def with_best_step(self, terms: Sequence[Term], values: FloatArray, rough: str) -> dict[Key, float]:
        """Return values with the best peak of one of the effects, seen beside the rest."""
        for i, term in enumerate(terms):
            if term.id == rough and term.rough:
                values = self._best(terms, np.where(np.arange(len(values)) == i, term.null, values), i)
        return {term.key: float(value) for term, value in zip(terms, values, strict=True)}

    def step_evidence(self, rough: Sequence[Term], terms: Sequence[Term], values: FloatArray) -> float:
        """Return what the best peak of an effect with rough terms explains beside others, by lines, in nats."""
        residual = self._problem.residuals(terms, values)
        form = [term for term in rough if term.fixed]
        starts = [self._likelihood.starts(term, form, residual) for term in rough if term.rough]
        return max((found[0].nats for found in starts if found), default=0.0)

    def _best(self, terms: Sequence[Term], values: FloatArray, i: int) -> FloatArray:
        """Return values with the best peak of one of them, and the best place on it."""
        starts = self._likelihood.starts(terms[i], _form(terms, terms[i].id), self._problem.residuals(terms, values))
        if not starts or starts[0].nats < STEP_EVIDENCE:
            return np.where(np.arange(len(values)) == i, starts[0].value if starts else values[i], values)
        apart = {start.value: start.apart for start in starts}
        found = self._nearest(terms, values, i, apart)
        places = np.linspace(-1.0, 1.0, _PLACES) * apart.get(float(found[i]), 0.0)
        return self._nearest(terms, found, i, found[i] + places[places != 0])

    def _nearest(self, terms: Sequence[Term], values: FloatArray, i: int, guesses: Iterable[float]) -> FloatArray:
        """Return values with the best of some guesses of one of them, or of itself where it is not null."""
        p, own = terms[i].parameter, values[i]
        inside = [guess for guess in guesses if p.lower <= guess <= p.upper]
        inside += [own] if own != terms[i].null or not inside else []
        tried = [np.where(np.arange(len(values)) == i, guess, values) for guess in inside]
        return min(tried, key=lambda guess: float(np.sum(self._problem.residual(terms, guess) ** 2)))


def _form(terms: Sequence[Term], name: str) -> list[Term]:
    """Return the fixed terms that say in which form an effect acts."""
    return [term for term in terms if term.id == name and term.fixed]

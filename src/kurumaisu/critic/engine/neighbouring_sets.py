# SPDX-License-Identifier: BSD-3-Clause
"""Sets next to the best one, of which lines say too little: without an effect, in other forms, with rivals instead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.engine.catalogue import Candidate, Key, Term
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.linear_screening import Screen, ScreenedSet
from kurumaisu.critic.engine.start_values import STEP_EVIDENCE
from kurumaisu.types import FloatArray

CLOSE = 12.0  # [nat] behind the best guess that a refit may make good
_HOPES = 3.0  # times what lines promise at most, about nothing, that something with many likely values explains
_HOPELESS = 100.0  # [nat] behind the best set that nothing makes good

EffectSet = frozenset[Candidate]


def neighbouring_sets(
    problem: Problem, screen: Screen, nothing: Screen, fit: Fit
) -> Iterator[tuple[EffectSet, Mapping[Key, float]]]:
    """Yield the set without each of its effects, with what can only act or not, and with each rival instead."""
    kept = fit.start
    for one in sorted(fit.candidates, key=lambda candidate: candidate.id):
        yield fit.candidates - {one}, kept
        for other in problem.candidates:
            new = other.id not in fit.ids - {one.id} and other not in fit.candidates
            # What clips or swallows hides its rivals: beside it their columns are empty, without it they are not.
            alike = screen.related(one, other) or nothing.related(one, other)
            if new and (screen.mends(other, one) if other.fixed else alike):
                # What fits one form of a step is nowhere near what fits another.
                begin = {key: value for key, value in kept.items() if not other.rough or key[0] != other.id}
                yield fit.candidates - {one} | {other}, begin
                if other.id == one.id:  # what stood in for the right form may go with the wrong one
                    rest = fit.candidates - {one}
                    sets = [rest - gone | {other} for gone in _stand_ins(rest)]
                    # Steps are as large in another form, but beside what stood in others may look better.
                    yield from ((chosen, start) for chosen in sets for start in (begin, kept))
    for other in screen.fixed:
        if other.id not in fit.ids and screen.mends(other):
            yield fit.candidates | {other}, kept
    for other in problem.candidates:
        if other.rough and other.id not in fit.ids:
            if not hopeless_alone(problem, other, nothing.centre, fit):
                yield frozenset({other}), {}
            yield fit.candidates | {other}, kept
    # Its peak was the best one when less acted beside it.
    yield from (
        (fit.candidates, problem.start_values.with_best_step(fit.terms, fit.values, one.id))
        for one in fit.candidates
        if one.rough
    )
    yield from _step_sets(problem, screen, fit)


def _stand_ins(rest: EffectSet) -> Iterator[EffectSet]:
    """Yield each effect of some, and each pair of which one shows in the forward speed and the other in the yaw rate.

    Steps of a converter are in both, so for their wrong form two may stand in.
    """
    yield from (frozenset({one}) for one in rest)
    yield from (frozenset({one, other}) for one in rest if _in_v(one) for other in rest if not _in_v(other))


def _in_v(candidate: Candidate) -> bool:
    return getattr(effects.by_id(candidate.id), "shows_in", None) == effects.Rate.V


def hopeless_alone(problem: Problem, rough: Candidate, empty: Fit, fit: Fit) -> bool:
    """Tell whether something rough, even if it explains several times what its best peak promises, is far behind.

    Nobody asks what is thousands of nats behind, but to find that out would take as long as any other fit.
    """
    sizes = [term for term in rough.terms if not term.fixed and not term.shape]
    if not all(term.rough for term in sizes):
        return False
    first = problem.start_values
    hope = max(first.step_evidence(rough.terms, empty.terms, empty.values), 0.0) * first.share * len(sizes)
    return empty.log_likelihood + _HOPES * hope < fit.log_likelihood - _HOPELESS


def _step_sets(problem: Problem, screen: Screen, fit: Fit) -> Iterator[tuple[EffectSet, Mapping[Key, float]]]:
    """Yield what has many likely values beside the part of the set that leaves it most to explain.

    Smooth effects that draw the mean of its steps together leave no peak that stands out beside all of them.
    """
    parts = [(part, *_guess_values(problem, part)) for part in screen.parts()]
    for other in problem.candidates if parts else ():
        if not other.rough or other in fit.candidates:
            continue
        hopes = [
            (problem.start_values.step_evidence(other.terms, terms, values), likelihood, part)
            for part, terms, values, likelihood in parts
        ]
        hope, likelihood, part = max(hopes, key=lambda found: found[0] + found[1])
        if hope > STEP_EVIDENCE and likelihood + hope > fit.log_likelihood - CLOSE:
            begin = {key: value for key, value in part.start.items() if key[0] != other.id}
            yield frozenset(each for each in part.chosen if each.id != other.id) | {other}, begin


def _guess_values(problem: Problem, part: ScreenedSet) -> tuple[tuple[Term, ...], FloatArray, float]:
    """Return the terms and values of a guess, and its log likelihood when simulated."""
    ordered = sorted(part.chosen, key=lambda candidate: candidate.id)
    terms = tuple(term for candidate in ordered for term in candidate.terms)
    values = np.array([term.parameter.lower if term.fixed else part.start.get(term.key, term.null) for term in terms])
    left = problem.residual(terms, values)
    return terms, values, -0.5 * float(left @ left)

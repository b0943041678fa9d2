# SPDX-License-Identifier: BSD-3-Clause
"""Is it outside the catalogue? Curves weighed twice, the second time beside a catalogue searched with one of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.engine import coarsened_posterior, search
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.unknown.comparison import CurveComparison, compare, no_curves
from kurumaisu.critic.unknown.curves import Design, null_evidence, without_own_span
from kurumaisu.critic.unknown.joint_fit import FitWithCurve, fit_with_curve
from kurumaisu.critic.values.policy import NAMED

_ALARM = 0.01  # share of null draws with as much evidence above which a curve is not believed
_NEVER = float(np.log(1e3 / 1e-7))  # [nat] that no draw has of the curves, of which there are hundreds
_HOPELESS = 100.0  # [nat] behind the catalogue, when simulated, that no other effects beside a curve make good
_SLOW = 1.0  # [s] noise that is forgotten sooner can draw no curve over a place or a time, nor take one up
_HINT = -3.0  # [nat] of lead, where slow noise is not believed, from which the noise is estimated about a curve


@dataclass(frozen=True)
class Beyond:
    """What was found outside the catalogue.

    rivalry: all curves; extension: the best one with the effects beside it, None where the catalogue suffices;
    false_alarm: share of null draws on this very design in which some curve has as much evidence; better: a set of
    effects without a curve that the search had missed, and that beats its best one.
    """

    rivalry: CurveComparison
    extension: FitWithCurve | None
    false_alarm: float
    better: Fit | None = None


def hinted_curve(problem: Problem, found: SearchResult) -> FitWithCurve | None:
    """Return the best set with a curve if one may well act, for an estimate of the noise about it."""
    if not _asked(problem) or not found.enough:
        return None
    easy = problem
    if problem.noise.slow_tau >= _SLOW:
        easy = problem.changed(noise=replace(problem.noise, slow_v=0.0, slow_lateral=0.0, slow_w=0.0))
    rivalry = compare(easy, found)
    return _extension(easy, rivalry) if rivalry.lead > _HINT else None


def judge(problem: Problem, found: SearchResult, progress: Callable[[str], None]) -> Beyond:
    """Return whether a curve beats the catalogue, and the best one with the effects that act beside it."""
    if not _asked(problem) or not found.enough:
        return Beyond(no_curves(found), None, 1.0)
    progress("trying errors outside the catalogue")
    rivalry = compare(problem, found)
    if rivalry.winner is None and not undecided(found, rivalry):
        return Beyond(rivalry, None, 1.0)
    first = _extension(problem, rivalry)
    if not _holds(problem, found, first, _HOPELESS):
        return Beyond(no_curves(found), None, 1.0)
    curved = replay.extend(problem.model, [first.unknown])
    # With the curve in, sets may be best that nobody would have tried without it.
    other = search.search(problem.changed(model=curved), progress, first.fit).best
    if other.candidates not in {fit.candidates for fit in found.fits}:
        more = problem.fit_candidates(other.candidates, other.start)
        if coarsened_posterior.of_set(found, more) > coarsened_posterior.of_set(found, found.best):
            return Beyond(rivalry, None, 1.0, more)
        found = replace(found, fits=(*found.fits, more))
    rivalry = compare(problem, found, also=other.candidates)
    if rivalry.winner is None and not undecided(found, rivalry):
        return Beyond(rivalry, None, 1.0)
    extension = _extension(problem, rivalry)
    if not _holds(problem, found, extension, 0.0):
        return Beyond(no_curves(found), None, 1.0)
    alarm = false_alarm(problem, rivalry)
    return Beyond(rivalry, extension if alarm <= _ALARM else None, alarm)


def undecided(found: SearchResult, rivalry: CurveComparison) -> bool:
    """Tell whether something acts for sure, but it may as well be a curve as any effect of the best set."""
    if not found.best.ids or found.confounded or not rivalry.rivals or rivalry.p_nothing > 1 - NAMED:
        return False
    surest = max(rivalry.p_effects[name] for name in found.best.ids)
    return surest < NAMED <= surest + sum(rivalry.p.values())


def _holds(problem: Problem, found: SearchResult, extension: FitWithCurve, behind: float) -> bool:
    """Tell whether a curve that wins by straight lines about a fit is not so many nats behind when it is simulated.

    Where the model is far off, as with another steering law, lines lead astray by any number of nats.
    """
    curved = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    left = curved.residual(extension.fit.terms, extension.fit.values)
    return -0.5 * float(left @ left) > found.best.log_likelihood - behind


def false_alarm(problem: Problem, rivalry: CurveComparison) -> float:
    """Return how often noise alone gives some curve, beside the same effects, the evidence of the best one.

    Evidence is a ratio of densities, whose mean over draws of noise is 1: of them, exp(-x) at most have x nats. More
    than all that is left is no evidence, but columns of which rounding makes something.
    """
    best = rivalry.rivals[0]
    if best.evidence.nats > -best.fit.log_likelihood:
        return 1.0
    if best.evidence.nats > _NEVER:
        return 0.0
    design = Design(problem, best.fit.settings)
    drawn = null_evidence(design, without_own_span(problem, best.fit, design.columns)[1], search.NULLS)
    return float(np.mean(drawn >= best.evidence.nats))


def _asked(problem: Problem) -> bool:
    return problem.ids is None or effects.SMOOTH in problem.ids


def _extension(problem: Problem, rivalry: CurveComparison) -> FitWithCurve:
    best = rivalry.rivals[0]
    return fit_with_curve(problem, best.fit, best.curve, best.evidence.prior)

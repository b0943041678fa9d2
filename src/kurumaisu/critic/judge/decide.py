# SPDX-License-Identifier: BSD-3-Clause
"""What acts: effects of the catalogue, a curve outside it or nothing, each in the noise that is left about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine import coarsened_posterior, form_error_fit, search, uncertain_effects
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.heldout import drive_gain
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.predict import parameter_doubt
from kurumaisu.critic.unknown import beyond_catalogue, comparison, joint_fit
from kurumaisu.critic.unknown.joint_fit import FitWithCurve
from kurumaisu.critic.values.policy import NAMED
from kurumaisu.critic.values.prior import odds
from kurumaisu.critic.values.progress import Progress
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_ANEW = 1  # times at most that all is judged anew, because other effects act than those about which the noise was taken
Truth = tuple[float, float] | None


@dataclass(frozen=True)
class Decision:
    """What acts, in a problem whose noise is that about it.

    growth: whether the noise grows with the rates; beyond: what was found outside the catalogue; untested: drives held
    out can neither confirm nor refute it.
    """

    problem: Problem
    found: search.SearchResult
    growth: base_noise.NoiseGrowth
    beyond: beyond_catalogue.Beyond
    untested: bool = False

    @property
    def something(self) -> bool:
        """Return whether there is anything to extend the model by."""
        return bool(self.found.best.ids) or self.beyond.extension is not None

    def refit(self, drives: Sequence[Drive]) -> drive_gain.FittedExtension:
        """Return what was found, fitted to other drives."""
        best, extension = self.found.best, self.beyond.extension
        if extension is not None:
            curved = joint_fit.refitted(extension, drives, self.problem)
            return drive_gain.FittedExtension(
                curved.settings, lambda drive: joint_fit.doubt(self.problem, drive, curved)
            )
        other = self.problem.changed(drives=drives)
        fit = other.fit_candidates(best.candidates, best.start)
        return drive_gain.FittedExtension(
            fit.settings, parameter_doubt.doubt(other, fit.settings, parameter_doubt.about_fit(other, fit))
        )


def decide(first: Problem, truth: Truth, progress: Progress) -> Decision:
    """Return what acts in drives of which only a first noise is known.

    Noise that was estimated without a curve has taken it up. So if one may act, the noise is estimated about it; and
    if it then does not win, as if there had never been one.
    """
    found = search.search(first, progress)
    hint = beyond_catalogue.hinted_curve(first, found)
    if hint is not None:
        made = _judged(first, found, hint, truth, progress)
        rivalry = made.beyond.rivalry
        won = made.beyond.extension is not None and rivalry.winner is not None
        if won and rivalry.lead - _by_noise(first, made, truth) > rivalry.least:
            return made
        first = first.changed(missed=made.problem.missed)
    for _ in range(_ANEW + 1):
        made, before = _judged(first, found, None, truth, progress), found.best.ids
        first = first.changed(missed=made.problem.missed)
        better = made.beyond.better
        found = made.found if better is None else replace(made.found, fits=(better, *made.found.fits))
        if found.best.ids == before:
            break
    settled = made.found if made.beyond.extension is not None else uncertain_effects.without_uncertain(made.found)
    return made if settled is made.found else replace(made, found=settled)


def without_curves(made: Decision) -> Decision:
    """Return what acts if nothing outside the catalogue does."""
    found, beyond = made.found, beyond_catalogue.Beyond(comparison.no_curves(made.found), None, 1.0)
    p, still_open = coarsened_posterior.of_effects(found, beyond.rivalry.odds)
    found = uncertain_effects.without_uncertain(with_curve_odds(replace(found, confounded=still_open), p))
    return replace(made, found=found, beyond=beyond)


def _by_noise(first: Problem, made: Decision, truth: Truth) -> float:
    """Return by how many nats the best set without a curve explains more with the noise about itself.

    What wanders slowly is a curve over the place as well: the noise about a curve lacks what the curve has taken up, so
    it speaks for it. Nobody knows the noise beforehand, so each side is heard with its own.
    """
    best = made.found.best
    own = first.changed(noise=noise_residuals(first, best, truth, project=True).estimate(first.noise).noise)
    return max(_density(own, best) - _density(made.problem, best), 0.0)


def _density(problem: Problem, fit: Fit) -> float:
    """Return the log density of the drives about a fit, up to a constant."""
    left = problem.residual(fit.terms, fit.values)
    volume = sum(float(base_noise.whitener(drive, problem.noise).log_determinants.sum()) for drive in problem.drives)
    return -0.5 * (float(left @ left) + volume)


def _judged(
    first: Problem, found: search.SearchResult, beside: FitWithCurve | None, truth: Truth, progress: Progress
) -> Decision:
    progress("estimating the noise again, with the effects found")
    left = noise_residuals(first, found.best, truth, project=True, beside=beside)
    final = left.estimate(first.noise)
    growth = left.growth(final, odds(len(found.p)))
    if growth.p > 1 / 2 and found.best.ids and beside is None:
        # What a cause of another form leaves behind is no noise, and grows with the rates, too.
        strict = noise_residuals(first, found.best, truth, project=True, forms=True)
        final = strict.estimate(final.noise)
        growth = strict.growth(final, odds(len(found.p)))
    elif growth.p > 1 / 2 and beside is not None:
        # The noise stays that about the curve as it is: what its knots leave is no effect of the catalogue either.
        strict = noise_residuals(first, found.best, truth, project=True, beside=beside, forms=True)
        growth = strict.growth(strict.estimate(final.noise), odds(len(found.p)))
    problem = first.changed(noise=growth.noise if growth.p > 1 / 2 else final.noise)
    again = search.search(problem, progress, found.best)
    if problem.missed is None:
        missed, fit = form_error_fit.likeliest_form_error(problem, again)
        if missed is not None:
            problem = problem.changed(missed=missed)
            again = search.search(problem, progress, fit)
    beyond = beyond_catalogue.judge(problem, again, progress)
    p, still_open = coarsened_posterior.of_effects(again, beyond.rivalry.odds)
    growth = replace(growth, p=coarsened_posterior.of_finding(again, growth.p))
    return Decision(problem, with_curve_odds(replace(again, confounded=still_open), p), growth, beyond)


def with_curve_odds(found: search.SearchResult, p: dict[str, float]) -> search.SearchResult:
    """Return what was found with the probabilities beside curves.

    What a curve draws speaks for its effect, which may decide what the effects alone left open: then it is no set.
    """
    still_open = (group for group in found.confounded if all(p[name] < NAMED for name in group))
    return replace(found, p=p, confounded=tuple(still_open))


def noise_residuals(
    problem: Problem,
    fit: Fit,
    truth: Truth,
    *,
    project: bool,
    beside: FitWithCurve | None = None,
    forms: bool = False,
) -> base_noise.NoiseResiduals:
    """Return what is left about a fit, or an extension, with all that may act projected out or nothing.

    forms: with what the causes of the fit would do in other forms projected out, too, and the chair at rest where they
    have it rest: a law that swallows small commands must not pass for noise that grows with them. Likewise with what
    the curve would do if it had more knots.
    """
    settings = fit.settings if beside is None else beside.settings
    residuals = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]

    def columns(drive: Drive, rows: int) -> FloatArray:
        if not project or not problem.terms:
            return np.empty((rows, 0))
        if beside is None:
            own = problem.simulated_columns(drive, fit)
            return np.column_stack([own, form_error_fit.columns(problem, drive, fit)]) if forms else own
        return joint_fit.simulated_columns(problem, drive, beside, finer=forms)

    projected = [columns(drive, left.size) for drive, left in zip(problem.drives, residuals, strict=True)]
    drives = [_resting(drive, problem.model, settings) for drive in problem.drives] if forms else problem.drives
    return base_noise.NoiseResiduals(drives, residuals, projected, truth)


def _resting(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> Drive:
    """Return a drive that knows where the simulated chair rests although it is asked to move."""
    motion = replay.motion(drive, model, settings)
    return replace(drive, still=~motion.moving)

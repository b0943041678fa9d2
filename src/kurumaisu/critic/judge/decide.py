# SPDX-License-Identifier: BSD-3-Clause
"""What acts: effects of the catalogue, a curve outside it or nothing, each in the noise that is left about it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.base.sensitivity import all_free_columns
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.least_squares import covariance
from kurumaisu.critic.heldout import drive_gain
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.search import search
from kurumaisu.critic.search.curve_search import CurveSearch, SetWithCurve
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.unknown import joint_fit
from kurumaisu.critic.unknown.joint_fit import FitWithCurve
from kurumaisu.critic.values.criticism import Progress, Settings
from kurumaisu.critic.values.policy import odds
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_HINT = -3.0  # [nat] from which all is judged with the noise about a curve, too
_LASTS = 5.0  # [s] for which noise lasts that may be what acts throughout
_LOOKS = 1  # rounds of that search: what it finds is judged by another one
_LEAST = 3.0  # [nat] by which that must be likelier
_ANEW = 2  # times that all is judged anew, because other effects act than those about which the noise was taken
Truth = tuple[float, float] | None
_SLIGHT = 1e-3  # share of the largest direction's whitened size below which one does not count


@dataclass(frozen=True)
class Decision:
    """What acts, in a problem whose noise is that about it.

    growth: whether the noise grows with the rates; extension: the best set with a curve, where that is likelier than
    any without; untested: drives held out can neither confirm nor refute it.
    """

    problem: Problem
    found: SearchResult
    growth: base_noise.NoiseGrowth
    extension: FitWithCurve | None = None
    untested: bool = False

    @property
    def lead(self) -> float:
        """Return by how many nats the best set with a curve is likelier than the best without."""
        return self.found.log_posterior(self.found.curves[0]) - self.found.log_posterior(self.found.best)

    @property
    def something(self) -> bool:
        """Return whether there is anything to extend the model by."""
        return bool(self.found.best.ids) or self.extension is not None

    def refit(self, drives: Sequence[Drive]) -> drive_gain.FittedExtension:
        """Return what was found, fitted to other drives."""
        best, extension = self.found.best, self.extension
        if extension is not None:
            curved = joint_fit.refitted(extension, drives, self.problem)
            return drive_gain.FittedExtension(
                curved.settings, doubt(self.problem, curved.settings, about_curve(curved))
            )
        other = self.problem.changed(drives=drives)
        fit = other.fit_candidates(best.candidates, best.start)
        return drive_gain.FittedExtension(fit.settings, doubt(other, fit.settings, about_fit(other, fit)))


@dataclass(frozen=True)
class Hint:
    """What may act beside what was found: the best of other sets, or one with a curve."""

    found: SearchResult
    curve: SetWithCurve | None


def decide(first: Problem, found: SearchResult, truth: Truth, progress: Progress) -> Decision:
    """Return what acts in drives of which only a first noise is known; found: what seems to act in that.

    Noise that was estimated without a curve has taken it up. So where one may act, all is judged with the noise about
    it, too, and the likelier one holds, each heard with its own noise.
    """
    curve = likelier_curve(found)
    made = _settled(first, found, curve, _noise_about(first, found, curve, truth, progress), truth, progress)
    other = _hinted(first, found, progress) if made.extension is None and found.enough else None
    if other is None:
        return made
    growth, density = _noise_about(first, other.found, other.curve, truth, progress), _density(made)
    if _density_with(first.changed(noise=growth.noise), other) < density + _HINT:
        return made
    anew = _settled(first, other.found, other.curve, growth, truth, progress)
    return anew if _density(anew) > density + _LEAST else made


def _settled(
    first: Problem,
    found: SearchResult,
    curve: SetWithCurve | None,
    growth: base_noise.NoiseGrowth,
    truth: Truth,
    progress: Progress,
) -> Decision:
    """Return what acts in the noise about what was found, a curve among it or not; anew where others act then.

    growth: that noise, as of _noise_about.
    """
    problem: Problem | None = None
    for again in range(_ANEW):
        if again:
            growth = _noise_about(first, found, curve, truth, progress)
        if problem is not None and base_noise.alike(growth.noise, problem.noise):
            break
        if problem is None and curve is None and base_noise.alike(growth.noise, first.noise):
            problem = first
            break
        problem = first.changed(noise=growth.noise)
        before, had = found, curve
        found = search.search(problem, progress, [*([] if curve is None else [curve.fit]), *found.likely])
        curve = likelier_curve(found)
        if found.best.ids == before.best.ids and (curve is None) == (had is None):
            break
    assert problem is not None
    return Decision(problem, found, growth, None if curve is None else fitted_curve(problem, curve))


def _noise_about(
    first: Problem, found: SearchResult, curve: SetWithCurve | None, truth: Truth, progress: Progress
) -> base_noise.NoiseGrowth:
    """Return the noise about what was found, or about a curve, and whether it grows with the rates."""
    progress("estimating the noise again, with the effects found")
    extension = None if curve is None else fitted_curve(first, curve)
    left = noise_residuals(first, found.best if curve is None else curve.fit, truth, project=True, beside=extension)
    final = left.estimate(first.noise)
    growth = left.growth(final, odds(len(found.p)))
    return growth if growth.p > 1 / 2 else replace(growth, noise=final.noise)


def _hinted(problem: Problem, found: SearchResult, progress: Progress) -> Hint | None:
    """Return what may well act were nothing slow in the noise: what lasts for long may be the one or the other."""
    easy = problem.changed(noise=problem.noise.quick)
    if problem.noise.slowest > _LASTS:
        progress("looking again, as if no noise were slow")
        again = search.search(easy, progress, found.likely, _LOOKS)
        curve = likelier_curve(again)
        return Hint(again, curve) if curve is not None or again.best.ids != found.best.ids else None
    curves = CurveSearch(easy)
    sets = {frozenset(): found.empty, found.best.candidates: found.best}
    fits = [easy.fit_candidates(chosen, fit.start if chosen else {}) for chosen, fit in sets.items()]
    tried = [one for fit in fits for one in curves.beside(fit)[:1] if not one.form_of]
    best = max(tried, key=found.log_posterior, default=None)
    bare = max(map(found.log_posterior, fits))
    return Hint(found, best) if best is not None and found.log_posterior(best) > bare + _HINT else None


def _log_density(problem: Problem, log_posterior: float) -> float:
    """Return the log posterior density of what acts, with its noise, up to a constant."""
    volume = sum(float(base_noise.whitener(drive, problem.noise).log_determinants.sum()) for drive in problem.drives)
    return log_posterior - 0.5 * volume


def _density(made: Decision) -> float:
    """Return that of the likeliest set, with a curve or without."""
    return _log_density(made.problem, made.found.log_posterior(likelier_curve(made.found) or made.found.best))


def _density_with(problem: Problem, hint: Hint) -> float:
    """Return the same of what a hint says in a problem, before other sets are sought there."""
    if hint.curve is None:
        fit = problem.fit_candidates(hint.found.best.candidates, hint.found.best.start)
        return _log_density(problem, hint.found.log_posterior(fit))
    fit, curves = problem.fit_candidates(hint.curve.fit.candidates, hint.curve.fit.start), CurveSearch(problem)
    curves.closer(fit)
    return max(_log_density(problem, hint.found.log_posterior(one)) for one in curves.beside(fit)[:1])


def likelier_curve(found: SearchResult) -> SetWithCurve | None:
    """Return the best set with a curve, where that is likelier than all of the catalogue, in whatever form."""
    best = next(iter(found.curves), None)
    if best is None or best.form_of or not found.enough:
        return None
    return best if found.log_posterior(best) > found.log_posterior(found.best) else None


def fitted_curve(problem: Problem, curve: SetWithCurve) -> FitWithCurve:
    """Return a set with its curve, fitted together."""
    return joint_fit.fit_with_curve(problem, curve.fit, curve.curve, curve.evidence.prior)


def noise_residuals(
    problem: Problem, fit: Fit, truth: Truth, *, project: bool, beside: FitWithCurve | None = None
) -> base_noise.NoiseResiduals:
    """Return what is left about a fit, or an extension, with all that may act projected out or nothing."""
    settings = fit.settings if beside is None else beside.settings
    residuals = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]

    def columns(drive: Drive, rows: int) -> FloatArray:
        if not project or not problem.terms:
            return np.empty((rows, 0))
        if beside is None:
            return problem.simulated_columns(drive, fit)
        return joint_fit.simulated_columns(problem, drive, beside)

    free = all_free_columns(problem.drives, problem.model)
    projected = [
        np.hstack([own, columns(drive, left.size)])
        for own, drive, left in zip(free, problem.drives, residuals, strict=True)
    ]
    return base_noise.NoiseResiduals(problem.drives, residuals, projected, truth)


def about_fit(problem: Problem, fit: Fit) -> tuple[Settings, ...]:
    """Return settings that differ from a fit to the problem's drives by one standard deviation each."""
    free = [i for i, term in enumerate(fit.terms) if not term.fixed]
    if not free:
        return ()
    slopes = problem.linearised(fit.terms, fit.values, [fit.terms[i] for i in free])[1]
    tight = np.array([fit.terms[i].step if fit.terms[i].shape else 0.0 for i in free])
    unit = np.array([fit.terms[i].step * fit.terms[i].parameter.scale for i in free])
    root = np.linalg.cholesky(covariance(slopes.T @ slopes + np.diag(tight**2)))
    lower = np.array([term.parameter.lower for term in fit.terms])
    upper = np.array([term.parameter.upper for term in fit.terms])
    others = []
    for direction in root.T:
        moved = fit.values.copy()
        moved[free] += unit * direction
        inside = np.clip(moved, lower, upper)
        others.append(replay.completed(problem.model, settings_of(fit.terms, inside)))
    return tuple(others)


def about_curve(extension: FitWithCurve) -> tuple[Settings, ...]:
    """Return settings that differ from an extension's by one standard deviation of its curve each."""
    values, vectors = np.linalg.eigh(extension.covariance)
    sizes = np.sqrt(np.maximum(values, 0.0))
    basis = extension.curve.basis
    return tuple(
        (
            *extension.fit.settings,
            EffectSetting(extension.curve.id, basis.parameters(extension.coefficients + size * vector)),
        )
        for size, vector in zip(sizes, vectors.T, strict=True)
        if size > _SLIGHT * sizes.max()
    )


def doubt(problem: Problem, settings: Settings, others: Sequence[Settings]) -> Callable[[Drive], FloatArray] | None:
    """Return the change of a drive's increments (3 m, k) from settings to each other ones; None without any."""
    if not others:
        return None

    def columns(drive: Drive) -> FloatArray:
        here = problem.simulated(drive, settings)
        return np.column_stack([(problem.simulated(drive, other) - here).ravel() for other in others])

    return columns

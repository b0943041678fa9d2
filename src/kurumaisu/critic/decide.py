# SPDX-License-Identifier: BSD-3-Clause
"""What acts: effects of the catalogue, a curve outside it or nothing, each in the noise that is left about it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic import gain, naming, noise, predict_doubt, smooth_fit, smooth_judge
from kurumaisu.critic.drive import Drive
from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.prior import odds
from kurumaisu.critic.smooth_fit import Extension
from kurumaisu.types import FloatArray

Progress = Callable[[str], None]
Truth = tuple[float, float] | None


@dataclass(frozen=True)
class Decision:
    """What acts, in a problem whose noise is that about it.

    growth: whether the noise grows with the rates; beyond: what was found outside the catalogue.
    """

    problem: Problem
    found: naming.Naming
    growth: noise.Growth
    beyond: smooth_judge.Beyond

    @property
    def something(self) -> bool:
        """Return whether there is anything to extend the model by."""
        return bool(self.found.best.ids) or self.beyond.extension is not None

    def refit(self, drives: Sequence[Drive]) -> gain.Fitted:
        """Return what was found, fitted to other drives."""
        best, extension = self.found.best, self.beyond.extension
        if extension is not None:
            curved = smooth_fit.again(extension, drives, self.problem)
            return gain.Fitted(curved.settings, lambda drive: smooth_fit.doubt(self.problem, drive, curved))
        other = self.problem.changed(drives=drives)
        fit = other.fit_candidates(best.candidates, best.start)
        return gain.Fitted(fit.settings, predict_doubt.doubt(other, fit.settings, predict_doubt.about_fit(other, fit)))


def decide(first: Problem, truth: Truth, progress: Progress) -> Decision:
    """Return what acts in drives of which only a first noise is known.

    Noise that was estimated without a curve has taken it up. So if one may act, the noise is estimated about it; and
    if it then does not win, as if there had never been one.
    """
    found = naming.search(first, progress)
    hint = smooth_judge.hinted(first, found)
    if hint is not None:
        made = _judged(first, found, hint, truth, progress)
        if made.beyond.extension is not None:
            return made
    return _judged(first, found, None, truth, progress)


def _judged(
    first: Problem, found: naming.Naming, beside: Extension | None, truth: Truth, progress: Progress
) -> Decision:
    progress("estimating the noise again, beside what was found")
    left = scatter(first, found.best, truth, project=True, beside=beside)
    final = left.estimate(first.noise)
    growth = left.growth(final, odds(len(found.p)))
    problem = first.changed(noise=growth.noise if growth.p > 1 / 2 else final.noise)
    again = naming.search(problem, progress, found.best)
    beyond = smooth_judge.judge(problem, again, progress)
    return Decision(problem, replace(again, p=beyond.rivalry.p_effects), growth, beyond)


def scatter(
    problem: Problem, fit: Fit, truth: Truth, *, project: bool, beside: Extension | None = None
) -> noise.Scatter:
    """Return what is left about a fit, or an extension, with all that may act projected out or nothing."""
    settings = fit.settings if beside is None else beside.settings
    residuals = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]

    def columns(drive: Drive, rows: int) -> FloatArray:
        if not project or not problem.terms:
            return np.empty((rows, 0))
        if beside is None:
            return problem.simulated_columns(drive, fit)
        return smooth_fit.simulated_columns(problem, drive, beside)

    projected = [columns(drive, left.size) for drive, left in zip(problem.drives, residuals, strict=True)]
    return noise.Scatter(problem.drives, residuals, projected, truth)

# SPDX-License-Identifier: BSD-3-Clause
"""The critic's story from a recording to a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.critic import explain, gain, naming, noise, sanity, smooth_explain, smooth_fit, smooth_judge
from kurumaisu.critic.drive import Drive, prepare
from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.explain import Criticism
from kurumaisu.critic.extended import write_extended
from kurumaisu.critic.prior import odds
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.report import write_report
from kurumaisu.critic.smooth_fit import Extension
from kurumaisu.critic.smooth_known import informed
from kurumaisu.critic.verdict import write_verdict
from kurumaisu.errors import Error
from kurumaisu.params import follow_commands, load_model
from kurumaisu.types import FloatArray

Progress = Callable[[str], None]


def criticise(recording: Recording, model_file: Path, progress: Progress, *, assume_law: bool = False) -> Criticism:
    """Return the criticism of a model by a recording whose runs have reference poses.

    Without voltages the model is "velocity follows command", unless the recording names a model or assume_law says
    that the robot has the model's voltage law.
    Raise Error when a run has no reference, or nothing that drove the robot.
    """
    model = load_model(model_file)
    if not assume_law and recording.model is None and all(run.voltage is None for run in recording.runs):
        model = follow_commands(model)
    drives = {run.name: informed(prepare(run, model), run) for run in recording.runs}
    train = [drives[name] for name in recording.train]
    test = [drives[name] for name in recording.test]

    wrong = [*recording.invalid, *sanity.suspicions(train, model)]
    if wrong:
        return explain.invalid(recording, model, wrong)

    progress("estimating the noise")
    rough = Problem(train, model, noise.START)
    empty = rough.fit((), {})
    first = Problem(train, model, _scatter(rough, empty, recording.truth, project=True).estimate().noise)
    found = naming.search(first, progress)
    made = _decide(first, found, recording.truth, progress)
    problem, found, beyond = made.problem, made.found, made.beyond
    final = problem.noise

    progress("measuring the gain on drives held out")
    baseline = _scatter(rough, empty, recording.truth, project=False).estimate(final).noise
    splits = gain.folds(train, test)
    anything = splits and (found.best.ids or beyond.extension)
    worth = gain.measure(model, splits, _refit(problem, found, beyond), baseline, final) if anything else None
    if beyond.extension is not None:
        return smooth_explain.criticism(recording, problem, smooth_explain.Outside(found, made.growth, beyond), worth)
    return explain.criticism(recording, problem, found, made.growth, worth, train + test)


@dataclass(frozen=True)
class _Decision:
    """What acts, in a problem whose noise is that about it."""

    problem: Problem
    found: naming.Naming
    growth: noise.Growth
    beyond: smooth_judge.Beyond


def _decide(first: Problem, found: naming.Naming, truth: tuple[float, float] | None, progress: Progress) -> _Decision:
    """Return what acts, by the noise about it.

    Noise that was estimated without a curve has taken it up. So if one may act, the noise is estimated about it; and
    if it then does not win, as if there had never been one.
    """
    hint = smooth_judge.hinted(first, found)
    if hint is not None:
        made = _judged(first, found, hint, truth, progress)
        if made.beyond.extension is not None:
            return made
    return _judged(first, found, None, truth, progress)


def _judged(
    first: Problem,
    found: naming.Naming,
    beside: Extension | None,
    truth: tuple[float, float] | None,
    progress: Progress,
) -> _Decision:
    progress("estimating the noise again, beside what was found")
    scatter = _scatter(first, found.best, truth, project=True, beside=beside)
    final = scatter.estimate(first.noise).noise
    growth = scatter.growth(final, odds(len(found.p)))
    final = growth.noise if growth.p > 1 / 2 else final
    problem = Problem(first.drives, first.model, final, first.terms)
    again = naming.search(problem, progress, found.best)
    beyond = smooth_judge.judge(problem, again, progress)
    return _Decision(problem, replace(again, p=beyond.rivalry.p_effects), growth, beyond)


def _refit(problem: Problem, found: naming.Naming, beyond: smooth_judge.Beyond) -> gain.Refit:
    """Return what fits the extension to other drives."""
    best, extension = found.best, beyond.extension

    def refit(drives: Sequence[Drive]) -> gain.Fitted:
        if extension is not None:
            other = smooth_fit.again(extension, drives, problem)
            return gain.Fitted(other.settings, lambda drive: smooth_fit.doubt(problem, drive, other))
        fit = Problem(drives, problem.model, problem.noise, problem.terms).fit_candidates(best.candidates, best.start)
        return gain.Fitted(fit.settings)

    return refit


def write(criticism: Criticism, model_file: Path, folder: Path) -> None:
    """Write verdict.json, extended.yaml and report.html. Raise Error naming what cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    write_verdict(folder / "verdict.json", criticism.verdict)
    write_report(folder / "report.html", criticism.verdict, criticism.story)
    write_extended(folder / "extended.yaml", model_file, criticism.model, criticism.settings, criticism.story.recording)


def _scatter(
    problem: Problem, fit: Fit, truth: tuple[float, float] | None, *, project: bool, beside: Extension | None = None
) -> noise.Scatter:
    """Return what is left about a fit, or an extension, with all that may act projected out or nothing."""
    settings = fit.settings if beside is None else beside.settings
    residuals = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]

    def columns(drive: Drive, rows: int) -> FloatArray:
        if not project:
            return np.empty((rows, 0))
        if beside is None:
            return problem.simulated_columns(drive, fit)
        return smooth_fit.simulated_columns(problem, drive, beside)

    projected = [columns(drive, left.size) for drive, left in zip(problem.drives, residuals, strict=True)]
    return noise.Scatter(problem.drives, residuals, projected, truth)

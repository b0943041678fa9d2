# SPDX-License-Identifier: BSD-3-Clause
"""The critic's story from a recording to a verdict."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kurumaisu.critic import explain, gain, naming, noise, sanity
from kurumaisu.critic.drive import Drive, driven, prepare
from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.explain import Criticism
from kurumaisu.critic.extended import write_extended
from kurumaisu.critic.laser.merge import with_laser
from kurumaisu.critic.laser.verdicts import criticise as criticise_laser
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.report import write_report
from kurumaisu.critic.verdict import write_verdict
from kurumaisu.errors import Error
from kurumaisu.params import Model, follow_commands, load_model

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
    if not any(driven(run) for run in recording.runs):
        return with_laser(explain.undriven(recording, model), criticise_laser(recording, model, progress))
    drives = {run.name: prepare(run, model) for run in recording.runs}
    train = [drives[name] for name in recording.train]
    test = [drives[name] for name in recording.test]

    wrong = [*recording.invalid, *sanity.suspicions(train, model)]
    if wrong:
        return explain.invalid(recording, model, wrong)

    progress("estimating the noise")
    empty = Problem(train, model, noise.START).fit((), {})
    first = _noise(train, model, empty, recording.truth, project=True)
    found = naming.search(Problem(train, model, first), progress)
    progress("estimating the noise again, beside what was found")
    final = _noise(train, model, found.best, recording.truth, project=True)
    problem = Problem(train, model, final)
    found = naming.search(problem, progress)

    progress("measuring the gain on drives held out")
    baseline = _noise(train, model, empty, recording.truth, project=False)
    splits = gain.folds(train, test)
    worth = gain.measure(model, splits, found.best, baseline, final) if splits and found.best.ids else None
    base = explain.criticism(recording, problem, found, worth, train + test)
    return with_laser(base, criticise_laser(recording, model, progress))


def write(criticism: Criticism, model_file: Path, folder: Path) -> None:
    """Write verdict.json, extended.yaml and report.html. Raise Error naming what cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    write_verdict(folder / "verdict.json", criticism.verdict)
    write_report(folder / "report.html", criticism.verdict, criticism.story)
    write_extended(folder / "extended.yaml", model_file, criticism.model, criticism.settings, criticism.story.recording)


def _noise(
    drives: list[Drive], model: Model, fit: Fit, truth: tuple[float, float] | None, *, project: bool
) -> noise.Noise:
    """Return the noise about a fit, with all effects of the catalogue projected out or none."""
    problem = Problem(drives, model, noise.START)
    residuals = [drive.measured - problem.simulated(drive, fit.settings) for drive in drives]
    columns = [
        problem.simulated_columns(drive, fit) if project else np.empty((residual.size, 0))
        for drive, residual in zip(drives, residuals, strict=True)
    ]
    return noise.estimate(drives, residuals, columns, truth)

# SPDX-License-Identifier: BSD-3-Clause
"""The critic's story from a recording to a verdict."""

from __future__ import annotations

from pathlib import Path

from kurumaisu.critic import explain, gain, next_experiment, noise, sanity, smooth_explain
from kurumaisu.critic.decide import Progress, decide, scatter
from kurumaisu.critic.drive import driven, prepare
from kurumaisu.critic.evidence import Problem
from kurumaisu.critic.explain import Criticism
from kurumaisu.critic.extended import write_extended
from kurumaisu.critic.laser.merge import with_laser
from kurumaisu.critic.laser.verdicts import criticise as criticise_laser
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.report import write_report
from kurumaisu.critic.smooth_known import informed
from kurumaisu.critic.verdict import write_verdict
from kurumaisu.errors import Error
from kurumaisu.params import Model, follow_commands, load_model


def criticise(
    recording: Recording,
    model_file: Path,
    progress: Progress,
    *,
    assume_law: bool = False,
    ids: frozenset[str] | None = None,
) -> Criticism:
    """Return the criticism of a model by a recording whose runs have reference poses.

    Without voltages the model is "velocity follows command", unless the recording names a model or assume_law says
    that the robot has the model's voltage law. ids: the effects that may be named; None for all that are criticised.
    Raise Error when a run has no reference, or nothing that drove the robot.
    """
    model = load_model(model_file)
    if not assume_law and recording.model is None and all(run.voltage is None for run in recording.runs):
        model = follow_commands(model)
    wrong = [*recording.invalid, *sanity.examine(recording, model).invalid]
    if wrong:
        return explain.invalid(recording, model, wrong)
    moved = any(driven(run) for run in recording.runs)
    base = _criticise_base(recording, model, progress, ids) if moved else None
    finding = criticise_laser(recording, model, progress, ids)
    if base is None and finding.refused:
        nothing = "has neither voltages nor commands nor odometry"
        raise Error(f"{recording.runs[0].name}: {nothing}; laser: {finding.refused}")
    return with_laser(base or explain.undriven(recording, model), finding)


def _criticise_base(recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None) -> Criticism:
    drives = {run.name: informed(prepare(run, model), run) for run in recording.runs}
    train = [drives[name] for name in recording.train]
    test = [drives[name] for name in recording.test]

    progress("estimating the noise")
    rough = Problem(train, model, noise.START, ids=ids)
    empty = rough.fit((), {})
    first = rough.changed(noise=scatter(rough, empty, recording.truth, project=True).estimate().noise)
    made = decide(first, recording.truth, progress)

    progress("measuring the gain on drives held out")
    baseline = scatter(rough, empty, recording.truth, project=False).estimate(made.problem.noise).noise
    splits = gain.folds(train, test)
    worth = gain.measure(model, splits, made.refit, baseline, made.problem.noise) if splits and made.something else None
    progress("planning the next drive")
    proposal = next_experiment.propose(made.problem, made.found, next_experiment.drives())
    judge = explain.criticism if made.beyond.extension is None else smooth_explain.criticism
    return judge(recording, made, worth, train + test, proposal)


def write(criticism: Criticism, model_file: Path, folder: Path) -> None:
    """Write verdict.json, extended.yaml and report.html. Raise Error naming what cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    write_verdict(folder / "verdict.json", criticism.verdict)
    write_report(folder / "report.html", criticism.verdict, criticism.story)
    write_extended(folder / "extended.yaml", model_file, criticism.model, criticism.settings, criticism.story.recording)

# SPDX-License-Identifier: BSD-3-Clause
"""The critic's story from a recording to a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import Drive, driven, prepare
from kurumaisu.critic.base.replay import model_of
from kurumaisu.critic.data.elapsed import with_elapsed_time
from kurumaisu.critic.data.long_runs import bounded
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment import proposal as next_experiment
from kurumaisu.critic.heldout import drive_gain, extension_gain
from kurumaisu.critic.judge import excitation, explain, explain_unknown
from kurumaisu.critic.judge.decide import Decision, decide, noise_residuals
from kurumaisu.critic.judge.extended_model import write_extended
from kurumaisu.critic.judge.forecast import forecast_of
from kurumaisu.critic.judge.held_out_pruning import confirmed_part, leave_one_out, untested
from kurumaisu.critic.judge.merge import with_scans
from kurumaisu.critic.judge.reference_point import from_base_link
from kurumaisu.critic.judge.scan_verdict import criticise_scans as look
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.predict import predictions
from kurumaisu.critic.predict.motion import Settings
from kurumaisu.critic.processes.laser_process import criticise_aside
from kurumaisu.critic.report.page import write_report
from kurumaisu.critic.sanity import early_stamps, examination
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.progress import Progress
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.selection import beside_odometry
from kurumaisu.critic.values.verdict import Gain, write_verdict
from kurumaisu.errors import Error
from kurumaisu.params import Model

_UNDRIVEN = extension_gain.Extension(None, (), lambda _: ())


def criticise(
    recording: Recording,
    model_file: Path,
    progress: Progress,
    *,
    assume_law: bool = False,
    ids: frozenset[str] | None = None,
    slam: bool = False,
) -> Criticism:
    """Return the criticism of a model by a recording whose runs have reference poses.

    Without voltages a robot that is asked for more than the model's voltages can say has none: "velocity follows
    command", unless the recording names a model or assume_law says that it has the model's voltage law. ids: the
    effects that may be named; None for all that are criticised. slam: whether SLAM is run with both models on a run
    held out, which takes some seconds.
    Raise Error when a run has no reference, or nothing that drove the robot.
    """
    model = model_of(recording, model_file, assume_law=assume_law)
    whole = replace(recording, runs=tuple(run for run in recording.runs if not _withheld(recording, run)))
    wrong = [*recording.invalid, *examination.examine(whole, model).invalid]
    if wrong:
        return explain.invalid(recording, model, wrong)
    recording = bounded(recording)
    moved = any(driven(run) for run in recording.runs if run.name in recording.train)
    if not moved and all(run.scan is None for run in recording.runs):
        raise Error(f"{recording.runs[0].name}: has neither voltages nor commands nor odometry, and no scans either")
    with criticise_aside(recording, model, model_file, ids) as scans_say:
        whole = with_elapsed_time(recording)
        base, extension = _criticise_base(whole, model, progress, ids) if moved else (None, _UNDRIVEN)
        if base is not None and base.verdict.verdict == "invalid_data":
            return base
        scans = scans_say(progress)
    found = base or explain.undriven(recording, model)
    scans, settings = from_base_link(
        found.verdict.causes, scans, recording, model, lambda moved: look(moved, model, progress, ids)
    )
    found = with_scans(found, scans)
    found = _with_worth(found, whole, replace(extension, scans=settings), progress, slam=slam)
    if not predictions.asked(recording):
        return found
    progress("predicting what the queries ask for")
    every = (*found.settings, *(each for each in settings if each not in found.settings))
    return replace(found, predictions=tuple(predictions.predictions(whole, model, extension.forecast, every)))


def _with_worth(
    found: Criticism, recording: Recording, extension: extension_gain.Extension, progress: Progress, *, slam: bool
) -> Criticism:
    progress("measuring the gain on held-out scans")
    found = extension_gain.with_laser_gain(found, recording, extension)
    if slam:
        progress("running SLAM with both models")
        found = extension_gain.with_slam(found, recording, extension)
    return found


def _withheld(recording: Recording, run: Run) -> bool:
    """Tell whether a run lacks poses because they are to be predicted: gaps in it are no fault."""
    return run.queries is not None and run.name in recording.test


def _drives(recording: Recording, model: Model) -> dict[str, Drive]:
    """Return the drives, without those of withheld runs that have too few poses left to judge by."""
    drives = {}
    for run in filter(driven, recording.runs):
        try:
            drives[run.name] = with_covariates(prepare(run, model), run)
        except Error:
            if not _withheld(recording, run):
                raise
    return drives


def _criticise_base(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None
) -> tuple[Criticism, extension_gain.Extension]:
    drives = _drives(recording, model)
    progress("estimating the noise")
    if all(drives[name].source == "odom" for name in recording.train if name in drives):
        ids = beside_odometry(ids)
    rough, first = _begun(recording, model, drives, ids)
    by = early_stamps.lead(first, progress)
    if by > early_stamps.tolerated_lead([run for run in recording.runs if run.name in drives]):
        return explain.invalid(recording, model, [early_stamps.problem(by)]), _UNDRIVEN
    if by > 0:
        recording = replace(recording, problems=(*recording.problems, early_stamps.note(by)))
        drives = {name: early_stamps.restamped(drive, by) for name, drive in drives.items()}
        rough, first = _begun(recording, model, drives, ids)
    train = list(first.drives)
    test = [drives[name] for name in recording.test if name in drives]
    made = decide(first, recording.truth, progress)

    progress("measuring the gain on held-out drives")
    baseline = (
        noise_residuals(rough, rough.fit((), {}), recording.truth, project=False).estimate(made.problem.noise).noise
    )
    withheld = [drives[run.name] for run in recording.runs if run.name in drives and _withheld(recording, run)]
    names = {drive.name for drive in withheld}
    whole = [drive for drive in test if drive.name not in names]
    splits = drive_gain.with_withheld(drive_gain.folds(train, whole), train, withheld)

    def worth_of(one: Decision) -> Gain:
        return drive_gain.measure(model, splits, one.refit, baseline, one.problem.noise)

    made, held = confirmed_part(made, worth_of(made) if splits and made.something else None, worth_of)
    if whole and len(train) > 1:
        more = [*drive_gain.folds(train, ()), *splits]
        held = leave_one_out(
            made, held, lambda: drive_gain.measure(model, more, made.refit, baseline, made.problem.noise)
        )
    made = replace(made, untested=bool(whole) and untested(made, held, whole))
    progress("planning the next drive")
    scripts = next_experiment.drives()
    proposal = next_experiment.propose(made.problem, made.found, scripts)
    judge = explain.criticism if made.beyond.extension is None else explain_unknown.criticism
    judged = excitation.with_shortcomings(judge(recording, made, held, train + test, proposal), made, train, scripts)
    forecast = forecast_of(made, judged.settings, baseline)

    def refit(name: str) -> Settings:
        others = [drive for drive in train if drive.name != name]
        again = forecast.settings and len(others) in range(1, len(train))
        return tuple(made.refit(others).settings) if again else forecast.settings

    return judged, extension_gain.Extension(forecast, (), refit)


def _begun(
    recording: Recording, model: Model, drives: Mapping[str, Drive], ids: frozenset[str] | None
) -> tuple[Problem, Problem]:
    """Return the problem of the drives to fit, with any noise and with a first estimate of theirs."""
    rough = Problem([drives[name] for name in recording.train if name in drives], model, base_noise.START, ids=ids)
    left = noise_residuals(rough, rough.fit((), {}), recording.truth, project=True)
    return rough, rough.changed(noise=left.estimate().noise)


def write(criticism: Criticism, model_file: Path, folder: Path) -> None:
    """Write verdict.json, extended.yaml, report.html and, if asked for, prediction.csv.

    Raise Error naming what cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    write_verdict(folder / "verdict.json", criticism.verdict)
    write_report(folder / "report.html", criticism.verdict, criticism.story)
    write_extended(folder / "extended.yaml", model_file, criticism.model, criticism.settings, criticism.story.recording)
    if criticism.predictions:
        predictions.write_predictions(folder / predictions.FILE, criticism.predictions)

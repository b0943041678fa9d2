# SPDX-License-Identifier: BSD-3-Clause
"""Drive criticism from a recording to a verdict: what acts on the base, whether it holds, what to drive next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import Drive, driven, prepare, without_spans
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment.proposal import drives as scripted_drives
from kurumaisu.critic.experiment.proposal import propose
from kurumaisu.critic.heldout import drive_gain
from kurumaisu.critic.heldout.extension_gain import Extension
from kurumaisu.critic.judge import excitation, explain, explain_unknown, intervals, multipliers, unresolved
from kurumaisu.critic.judge.decide import Decision, decide, noise_residuals
from kurumaisu.critic.judge.forecast import forecast_of
from kurumaisu.critic.judge.held_out_pruning import confirmed_part, leave_one_out, untested
from kurumaisu.critic.judge.reference_point import is_point
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.sanity import early_stamps
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.progress import Progress
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.selection import beside_odometry, of_turning
from kurumaisu.critic.values.settings import Settings
from kurumaisu.critic.values.verdict import Cause, Gain, RobotTaken
from kurumaisu.errors import Error
from kurumaisu.params import Model

NOTHING = Extension(None, (), lambda _: ())


def criticise_drives(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None
) -> tuple[Criticism, Extension]:
    """Return what the drives of a recording say against a model, and what extends it by that."""
    drives = _drives(recording, model)
    progress("estimating the noise")
    ids = _looked_for(recording, drives, ids)
    rough, first = _begun(recording, model, drives, ids)
    by = early_stamps.lead(first, progress)
    # Of two sensors neither asks the other for anything, so that one may be late.
    sensors = recording.turning and all(drive.source == "odom" for drive in first.drives)
    if by > early_stamps.tolerated_lead([run for run in recording.runs if run.name in drives]) and not sensors:
        return explain.invalid(recording, model, [early_stamps.problem(by)]), NOTHING
    if by > 0:
        note = early_stamps.beside_imu(by) if sensors else early_stamps.note(by)
        recording = replace(recording, problems=(*recording.problems, note))
        drives = {name: [early_stamps.restamped(drive, by) for drive in some] for name, some in drives.items()}
        rough, first = _begun(recording, model, drives, ids)
    train = list(first.drives)
    test = [drive for name in recording.test for drive in drives.get(name, [])]
    made = decide(first, recording.truth, progress)
    # Where only turning was measured, places say what was asked for, in which nothing comes and goes.
    going = None if not recording.placed else unresolved.certain_intermittent(made, [*train, *test])
    if going is not None:
        progress("judging what is left without the moments in which something comes and goes")
        train, test = [going.freed(drive) for drive in train], [going.freed(drive) for drive in test]
        rough, first = rough.changed(drives=tuple(train)), first.changed(drives=tuple(train))
        made = decide(first, recording.truth, progress)
        # What is left of such moments grows with the rates as well: of the noise that says nothing.
        made = replace(made, growth=replace(made.growth, p=0.0))

    progress("measuring the gain on held-out drives")
    left = noise_residuals(rough, rough.fit((), {}), recording.truth, project=False)
    baseline = left.estimate(made.problem.noise).noise
    hidden = [drive for run in recording.runs if withheld(recording, run) for drive in drives.get(run.name, [])]
    made, held = _held_out(made, model, baseline, train, test, hidden)
    progress("planning the next drive")
    scripts = scripted_drives()
    proposal = propose(made.problem, made.found, scripts)
    judge = explain.criticism if made.extension is None else explain_unknown.criticism
    judged = excitation.with_shortcomings(judge(recording, made, held, train + test, proposal), made, train, scripts)
    shares = explain.shares_of(made, turning=recording.turning)
    judged = unresolved.with_remainder(unresolved.with_unresolved(judged, made, held, shares, test))
    judged = unresolved.with_intermittent(judged, going)
    found = multipliers.measured(made.problem, made.found.best, turning=recording.turning)
    taken = RobotTaken(model.robot.kind, assumed=False, multipliers=found)
    judged = replace(judged, verdict=replace(judged.verdict, robot=taken))
    extension = _extension(made, forecast_of(made, judged.settings, baseline), train)
    return judged, replace(extension, points=_points(made, judged.verdict.confounded))


def _points(made: Decision, sets: Sequence[Sequence[str]]) -> tuple[Cause, ...]:
    """Return effects of some sets on what the reference measures, each as if it alone of its set acted."""
    best, out = made.found.best, list[Cause]()
    for group in sets:
        for name in filter(is_point, group):
            fit = made.problem.fit((best.ids - set(group)) | {name}, best.start)
            sizes = intervals.estimates(made.problem, fit, name)
            out.append(Cause(name, made.found.p[name], sizes, 0.0))
    return tuple(out)


def _looked_for(
    recording: Recording, drives: Mapping[str, Sequence[Drive]], ids: frozenset[str] | None
) -> frozenset[str] | None:
    """Return those of these effects, None for all, that such drives can tell of."""
    if all(drive.source == "odom" for name in recording.train for drive in drives.get(name, [])):
        ids = beside_odometry(ids)
    return ids if recording.placed else of_turning(ids)


def _held_out(
    made: Decision,
    model: Model,
    baseline: base_noise.Noise,
    train: Sequence[Drive],
    test: Sequence[Drive],
    hidden: Sequence[Drive],
) -> tuple[Decision, Gain | None]:
    """Return what of a decision drives held out do not refuse, and what that gains; hidden: withheld drives."""
    names = {drive.name for drive in hidden}
    whole = [drive for drive in test if drive.name not in names]
    splits = drive_gain.with_withheld(drive_gain.folds(train, whole), train, hidden)

    def gain_of(one: Decision) -> Gain:
        return drive_gain.measure(model, splits, one.refit, baseline, one.problem.noise)

    made, held = confirmed_part(made, gain_of(made) if splits and made.something else None, gain_of)
    if whole and len(train) > 1:
        more = [*drive_gain.folds(train, ()), *splits]
        held = leave_one_out(
            made, held, lambda: drive_gain.measure(model, more, made.refit, baseline, made.problem.noise)
        )
    return replace(made, untested=bool(whole) and untested(made, held, whole)), held


def _extension(made: Decision, forecast: Forecast, train: Sequence[Drive]) -> Extension:
    """Return what extends the model on drives, which can be fitted again without one of them."""

    def refit(name: str) -> Settings:
        others = [drive for drive in train if drive.name != name]
        again = forecast.settings and len(others) in range(1, len(train))
        return tuple(made.refit(others).settings) if again else forecast.settings

    return Extension(forecast, (), refit)


def withheld(recording: Recording, run: Run) -> bool:
    """Tell whether a run lacks poses because they are to be predicted: gaps in it are no fault."""
    return run.queries is not None and run.name in recording.test


def _drives(recording: Recording, model: Model) -> dict[str, list[Drive]]:
    """Return the drives by run, in pieces where what is between them is set aside.

    Without those of withheld runs that have too few poses left to judge by.
    """
    drives = {}
    for run in filter(driven, recording.runs):
        try:
            drives[run.name] = without_spans(with_covariates(prepare(run, model), run), run.aside)
        except Error:
            if not withheld(recording, run):
                raise
    return drives


def _begun(
    recording: Recording, model: Model, drives: Mapping[str, Sequence[Drive]], ids: frozenset[str] | None
) -> tuple[Problem, Problem]:
    """Return the problem of the drives to fit, with any noise and with a first estimate of theirs."""
    rough = Problem(
        [drive for name in recording.train for drive in drives.get(name, [])], model, base_noise.START, ids=ids
    )
    left = noise_residuals(rough, rough.fit((), {}), recording.truth, project=True)
    return rough, rough.changed(noise=left.estimate().noise)

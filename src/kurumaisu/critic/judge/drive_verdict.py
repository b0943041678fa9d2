# SPDX-License-Identifier: BSD-3-Clause
"""Drive criticism from a recording to a verdict: what acts on the base, whether it holds, what to drive next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import Drive, driven, prepare, without_spans
from kurumaisu.critic.engine.catalogue import SHOWS, Term, catalogue
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.experiment import design
from kurumaisu.critic.experiment.design import DECIDED, propose
from kurumaisu.critic.experiment.design import drives as scripted_drives
from kurumaisu.critic.heldout import drive_gain
from kurumaisu.critic.heldout.materiality import CERTAIN, NO_NOISE, confirmed, expected_nats, holds
from kurumaisu.critic.heldout.slam_gain import Extension
from kurumaisu.critic.judge import explain, explain_unknown, intervals, multipliers, unresolved
from kurumaisu.critic.judge.decide import Decision, about_curve, about_fit, decide, noise_residuals
from kurumaisu.critic.judge.reference_faults import is_point
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.sanity import early_stamps
from kurumaisu.critic.search import search
from kurumaisu.critic.values.criticism import UNRESOLVED, Criticism, Progress, Settings
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.selection import beside_odometry, of_turning
from kurumaisu.critic.values.verdict import Cause, Gain, NextExperiment, RobotTaken
from kurumaisu.errors import Error
from kurumaisu.experiments import Script
from kurumaisu.params import Model

NOTHING = Extension(None, (), lambda _: ())
_FEW = 0.5  # share of the catalogue below which what could be seen is too little to say that nothing is missing
_REST = 1e-3  # [m/s], [rad/s] inputs below are none
_SHORT = 15.0  # [s] in all: too little to tell effects from noise
_LISTED = 6
_TRIED = 2  # smaller sets, the likeliest first: each is fitted to all folds
_MET = 3.0  # [nat] that drives held out must be able to tell for their silence to say anything


def criticise_drives(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None
) -> tuple[Criticism, Extension]:
    """Return what the drives of a recording say against a model, and what extends it by that."""
    drives = _drives(recording, model)
    progress("estimating the noise")
    if all(drive.source == "odom" for name in recording.train for drive in drives.get(name, [])):
        ids = beside_odometry(ids)
    ids = ids if recording.placed else of_turning(ids)
    rough, first = _begun(recording, model, drives, ids)
    found = search.search(first, progress)
    by = early_stamps.lead(first, found, progress)
    # Of two sensors neither asks the other for anything, so that one may be late.
    sensors = recording.turning and all(drive.source == "odom" for drive in first.drives)
    if by > early_stamps.tolerated_lead([run for run in recording.runs if run.name in drives]) and not sensors:
        return explain.invalid(recording, model, [early_stamps.problem(by)]), NOTHING
    if by > 0:
        recording = replace(recording, problems=(*recording.problems, early_stamps.note(by, imu=sensors)))
        drives = {name: [early_stamps.restamped(drive, by) for drive in some] for name, some in drives.items()}
        rough, first = _begun(recording, model, drives, ids)
        found = search.search(first, progress)
    train = list(first.drives)
    test = [drive for name in recording.test for drive in drives.get(name, [])]
    made = decide(first, found, recording.truth, progress)
    # Where only turning was measured, places say what was asked for, in which nothing comes and goes.
    made, going = unresolved.certain_intermittent(made, [*train, *test]) if recording.placed else (made, None)
    if going is not None:
        progress("judging what is left without the moments in which something comes and goes")
        train, test = [going.freed(drive) for drive in train], [going.freed(drive) for drive in test]
        rough, first = rough.changed(drives=tuple(train)), first.changed(drives=tuple(train))
        made = decide(first, search.search(first, progress), recording.truth, progress)
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
    judged = with_shortcomings(judge(recording, made, held, train + test, proposal), made, train, scripts)
    shares = explain.shares_of(made, turning=recording.turning)
    judged = unresolved.with_remainder(unresolved.with_unresolved(judged, made, held, shares, test))
    judged = unresolved.with_intermittent(judged, going)
    measured = None
    # What nobody measured may be what is wrong where nothing explains it: nobody should paste numbers from that.
    checked = recording.turning or all(run.pose_source == "measured" for run in recording.runs)
    if checked or all(one.covariate != UNRESOLVED for one in judged.verdict.unknown):
        measured = multipliers.measured(made.problem, made.found.best, turning=recording.turning)
    taken = RobotTaken(model.robot.kind, assumed=False, multipliers=measured)
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


def forecast_of(made: Decision, settings: Settings, baseline: Noise) -> Forecast:
    """Return what predicts motion: what extends the model by the verdict; without that the model in its own noise.

    settings: of the criticism; baseline: noise about the model as it was.
    """
    problem, best, extension = made.problem, made.found.best, made.extension
    given = {setting.id for setting in settings}
    if extension is not None and extension.curve.id in given:
        return Forecast(problem.model, extension.settings, problem.noise, about_curve(extension))
    if best.ids and best.ids <= given:
        return Forecast(problem.model, best.settings, problem.noise, about_fit(problem, best))
    return Forecast(problem.model, (), baseline)


def with_shortcomings(
    criticism: Criticism, made: Decision, drives: Sequence[Drive], scripts: Sequence[Script]
) -> Criticism:
    """Return the criticism, and where nothing was found because little could show, what to drive for it."""
    if criticism.verdict.verdict != "none" or (made.something and made.found.enough):
        return criticism
    problem = made.problem
    ids = sorted({term.id for term in catalogue(problem.model, problem.ids)})
    unseen = [name for name in ids if name not in {candidate.id for candidate in problem.candidates}]
    if made.found.enough and len(unseen) <= _FEW * len(ids):
        return criticism
    wanted = unseen if made.found.enough else ids
    best = _supplier(problem.model, scripts, wanted)
    why = shortcomings(drives, enough=made.found.enough)
    listed = ", ".join(wanted[:_LISTED]) + (f" and {len(wanted) - _LISTED} more" if len(wanted) > _LISTED else "")
    some = f"None of the {len(ids)} effects can" if wanted == ids else f"{len(wanted)} of {len(ids)} effects cannot"
    verb = "detected" if made.found.enough else "named"
    sentence, headline = f"{some} be {verb} in this recording: {listed}.", f"{some} be {verb}, because {why}."
    next_drive = criticism.story.next_drive
    if best is not None:
        next_drive = (
            f"Run the experiment {best.id} ({best.seconds:.0f} s). It detects {len(best.separates)} of them at "
            f"their usual sizes."
        )
    story = replace(
        criticism.story,
        headline=headline,
        unexplained=(sentence, *criticism.story.unexplained),
        next_drive=next_drive,
        details=(*criticism.story.details, sentence, *([next_drive] if next_drive else [])),
    )
    return replace(criticism, story=story, verdict=replace(criticism.verdict, next_experiment=best))


def shortcomings(drives: Sequence[Drive], *, enough: bool) -> str:
    """Return in words what drives lack; enough: there are more data than the catalogue could fit."""
    ahead = max(float(np.abs(drive.v).max()) for drive in drives)
    turn = max(float(np.abs(drive.w).max()) for drive in drives)
    seconds = sum(float(drive.times[-1] - drive.times[0]) for drive in drives)
    if max(ahead, turn) < _REST:
        return "the chair was never commanded to move"
    if seconds < _SHORT:
        return f"only {seconds:.1f} s were recorded"
    if not enough:
        count = sum(len(drive.times) - 1 for drive in drives)
        return f"{count} intervals between poses are too few to tell effects from noise"
    if turn < _REST:
        return "the chair was never commanded to turn"
    if ahead < _REST:
        return "the chair was commanded only to turn, never to drive"
    return "the inputs hardly change"


def _supplier(model: Model, scripts: Sequence[Script], wanted: Sequence[str]) -> NextExperiment | None:
    """Return the script that shows most of these effects, the shorter one of two; None where none shows any."""
    terms = catalogue(model, frozenset(wanted))
    options = []
    for script in scripts:
        if design.possible(script, model):
            sizes = _sizes(Problem([design.planned(script, model, ())], model, base_noise.START, ()), terms)
            shown = tuple(name for name in wanted if sizes[name] >= SHOWS)
            nats = float(np.mean([min(0.5 * sizes[name] ** 2, DECIDED) for name in wanted]))
            options.append((len(shown), -script.seconds, NextExperiment(script.name, script.seconds, nats, shown)))
    best = max(options, key=lambda option: option[:2], default=None)
    return best[2] if best is not None and best[0] else None


def _sizes(problem: Problem, terms: Sequence[Term]) -> dict[str, float]:
    """Return by effect how large it shows, whitened, when its parameters take their usual size one by one."""
    here = problem.residual((), np.empty(0))
    sizes: dict[str, float] = {}
    for term in terms:
        p = term.parameter
        sign = 1.0 if term.null + p.scale <= p.upper else -1.0
        moved = problem.residual([term], np.array([term.null + sign * p.scale])) - here
        sizes[term.id] = max(sizes.get(term.id, 0.0), float(np.linalg.norm(moved)))
    return sizes


def confirmed_part(
    made: Decision, gain: Gain | None, measure: Callable[[Decision], Gain]
) -> tuple[Decision, Gain | None]:
    """Return a decision with what it is worth, or that of what is confirmed in its place.

    That is a smaller set which keeps what is named, or one of all without one effect, where all together are beyond
    doubt: one that is wrong must not hide the others. For a curve of which nobody would be told, the catalogue's own.
    """
    found = made.found
    if gain is None:
        return made, gain
    if made.extension is not None:
        told = explain_unknown.is_reported(made, gain)
        if told and not made.extension.fit.ids:
            return made, gain
        return _without_curves(made, gain, measure, gain.log_density_per_sample.gain if told else -np.inf)
    if holds(gain, found.nats(found.best)):
        return made, gain
    smaller = [fit for fit in found.fits if fit.ids and set(found.named) <= fit.ids < found.best.ids]
    for fit in smaller[:_TRIED]:
        other = _with_best(made, fit)
        gained = measure(other)
        if confirmed(gained, found.nats(fit)):
            return other, gained
    return _without_one(made, gain, measure)


def leave_one_out(made: Decision, held: Gain | None, measure: Callable[[], Gain]) -> Gain | None:
    """Return what effects are worth with each drive to fit left out in turn, too, if that confirms them.

    Only where drives held out decide nothing: nobody may have driven so as to meet what acts, such as a threshold.
    """
    if held is None or not _unconfirmed(made, held) or held.log_density_per_sample.hi90 < 0:
        return held
    again = measure()
    return again if confirmed(again, made.found.nats(made.found.best)) else held


def untested(made: Decision, held: Gain | None, drives: Sequence[Drive]) -> bool:
    """Tell whether drives held out can neither confirm nor refute effects that are certain: they hardly meet them.

    held: what the effects gain on these drives. What would be surprised there by more than chance is refuted.
    """
    if held is None or not _unconfirmed(made, held) or held.log_density_per_sample.hi90 <= 0:
        return False
    return expected_nats(made.problem, drives, made.found.best.settings, ()) < _MET


def _without_one(made: Decision, gain: Gain, measure: Callable[[Decision], Gain]) -> tuple[Decision, Gain]:
    """Return a decision without the one of its effects that leaves most, where that is confirmed beyond doubt."""
    found, best = made.found, made.found.best
    fewer = [fit for fit in found.fits if fit.ids and len(best.candidates - fit.candidates) == 1]
    fewer = [fit for fit in fewer if fit.candidates < best.candidates and found.nats(fit) >= NO_NOISE]
    tried = [(fit, measure(_with_best(made, fit))) for fit in fewer]
    fit, gained = max(tried, key=lambda one: one[1].log_density_per_sample.gain, default=(best, gain))
    return (_with_best(made, fit), gained) if confirmed(gained, found.nats(fit)) else (made, gain)


def _unconfirmed(made: Decision, held: Gain) -> bool:
    """Tell whether effects are certain by the drives they were fitted to, and not confirmed by those held out."""
    nats = made.found.nats(made.found.best)
    return made.extension is None and nats >= CERTAIN and not confirmed(held, nats)


def _without_curves(
    made: Decision, gain: Gain, measure: Callable[[Decision], Gain], least: float
) -> tuple[Decision, Gain]:
    """Return what acts if no curve does, where that is confirmed: a curve that is not must not hide it.

    least: per sample, what it must be worth besides [nat]: a curve shares in what the effects beside it are worth.
    """
    other = replace(made, extension=None)
    if not other.something:
        return made, gain
    gained = measure(other)
    held = confirmed(gained, other.found.nats(other.found.best)) and gained.log_density_per_sample.gain >= least
    return (other, gained) if held else (made, gain)


def _with_best(made: Decision, fit: Fit) -> Decision:
    """Return the decision with another set as the best, and the sets of rivals that its effects are in."""
    found = made.found
    fits = (fit, *(other for other in found.fits if other is not fit))
    groups = tuple(group for group in found.confounded if fit.ids & set(group))
    return replace(made, found=replace(found, fits=fits, confounded=groups))

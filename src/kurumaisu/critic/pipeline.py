# SPDX-License-Identifier: BSD-3-Clause
"""The critic's story from a recording to a verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from kurumaisu.critic.base.covariates import with_past
from kurumaisu.critic.base.drive import driven
from kurumaisu.critic.base.replay import model_of
from kurumaisu.critic.data.excerpt import bounded, with_elapsed_time
from kurumaisu.critic.heldout import scan_gain
from kurumaisu.critic.heldout.slam_gain import Extension, with_scan_gain, with_slam
from kurumaisu.critic.judge import explain
from kurumaisu.critic.judge.drive_verdict import NOTHING, criticise_drives, withheld
from kurumaisu.critic.judge.explain import extended_text
from kurumaisu.critic.judge.merge import confirmed_scans, with_scans
from kurumaisu.critic.judge.multipliers import with_robot
from kurumaisu.critic.judge.reference_faults import by_commands, by_its_clock, from_base_link, mountings, ruled_out
from kurumaisu.critic.judge.scan_verdict import criticise_scans, scan_findings
from kurumaisu.critic.predict import predictions
from kurumaisu.critic.processes.laser_process import criticise_in_own_process
from kurumaisu.critic.ranges.scans.gathering import with_sweep_time
from kurumaisu.critic.report.page import report_page
from kurumaisu.critic.sanity import examination, masks
from kurumaisu.critic.values.criticism import Criticism, LaserFinding, Progress
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.selection import those
from kurumaisu.critic.values.verdict import Cause, verdict_text
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model
from kurumaisu.whole_files import write_whole


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

    Which robot it is of: see model_of. ids: the effects that may be named; None for all that are criticised. slam:
    whether SLAM is run with both models on a run held out, which takes some seconds.
    Raise Error when a run has no reference, nothing that drove the robot, or voltages of one that has none.
    """
    model = model_of(recording, model_file, assume_law=assume_law)
    recording = masks.set_aside(recording, model)
    whole = replace(recording, runs=tuple(run for run in recording.runs if not withheld(recording, run)))
    wrong = [*recording.invalid, *examination.examine(whole, model).invalid]
    if wrong:
        return with_robot(explain.invalid(recording, model, wrong), recording)
    recording = with_sweep_time(bounded(recording), model)
    moved = any(driven(run) for run in recording.runs if run.name in recording.train)
    if not moved and all(run.scan is None for run in recording.runs):
        raise Error(f"{recording.runs[0].name}: has neither voltages nor commands nor odometry, and no scans either")
    scanned = with_past(recording, model)
    with criticise_in_own_process(scanned, model, model_file, ids) as scans_say:
        whole = with_elapsed_time(recording)
        base, extension = criticise_drives(whole, model, progress, ids) if moved else (None, NOTHING)
        if base is not None and base.verdict.verdict == "invalid_data":
            return with_robot(base, recording)
        findings = scans_say(progress)
        scans = next(findings)
        if base is not None and extension.points:
            base, extension = _beside_scans(base, extension, scans, whole, model, progress, ids)
        found = base or explain.undriven(recording, model)
        told = (scans, findings)
        there, stamped, settings = _as_seen(found.verdict.causes, told, scanned, model, progress, ids)
    forecast = extension.forecast
    if forecast is not None and stamped is not scanned:
        forecast = replace(forecast, settings=by_commands(forecast.settings, model))
    stamped = with_elapsed_time(stamped)
    progress("measuring the gain on held-out scans")
    beside = tuple(each for each in settings if each not in there.settings)
    scans, worth = confirmed_scans(there, lambda told: scan_gain.measure(stamped, model, forecast, (*told, *beside)))
    settings = (*scans.settings, *beside)
    found = with_scan_gain(with_scans(found, scans), worth)
    if slam:
        progress("running SLAM with both models")
        found = with_slam(found, stamped, replace(extension, forecast=forecast, scans=settings))
    found = with_robot(found, recording)
    if not predictions.asked(recording):
        return found
    progress("predicting what the queries ask for")
    every = (*found.settings, *(each for each in settings if each not in found.settings))
    ranges = list(predictions.ranges(stamped, model, forecast, every))
    return replace(found, predictions=tuple(predictions.predictions(whole, extension.forecast, ranges)))


def _as_seen(
    causes: Sequence[Cause],
    told: tuple[LaserFinding, Iterator[LaserFinding]],
    recording: Recording,
    model: Model,
    progress: Progress,
    ids: frozenset[str] | None,
) -> tuple[LaserFinding, Recording, tuple[EffectSetting, ...]]:
    """Return what scans say from where they are taken, by causes in the base, and when; the recording; all that acts.

    told: what they say by their mean readings, and what they go on to say.
    """
    scans, findings = told

    def again(moved: Recording) -> LaserFinding:
        return criticise_scans(moved, model, progress, ids)

    seen, stamped = by_its_clock(causes, scans, recording, model, again)
    there, settings = from_base_link(causes, seen, stamped, model, again)
    if there is scans:  # not only the mean readings, but how they scatter: where they are seen from is settled
        there = next(findings)
        settings = there.settings
    return there, stamped, settings


def _beside_scans(
    base: Criticism,
    extension: Extension,
    scans: LaserFinding,
    recording: Recording,
    model: Model,
    progress: Progress,
    ids: frozenset[str] | None,
) -> tuple[Criticism, Extension]:
    """Return what the drives say, without what the scans refute of their sets."""

    def mounted(there: Recording) -> LaserFinding:
        return next(scan_findings(there, model, progress, mountings(model)))

    told = ruled_out(extension.points, base.verdict.confounded, scans, recording, model, mounted)
    if not told:
        return base, extension
    progress("judging the drives again, without what the scans refute")
    base, extension = criticise_drives(recording, model, progress, those(ids) - told.keys())
    words = (f"{name} does not act: {why}." for name, why in told.items())
    return replace(base, story=replace(base.story, details=(*base.story.details, *words))), extension


def write(criticism: Criticism, model_file: Path, folder: Path) -> None:
    """Write verdict.json, extended.yaml, report.html and, if asked for, prediction.csv: all of them or none.

    Raise Error naming what cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    story = criticism.story
    contents = {
        folder / "extended.yaml": extended_text(model_file, criticism.model, criticism.settings, story.recording),
        folder / "report.html": report_page(criticism.verdict, story),
        folder / "verdict.json": verdict_text(criticism.verdict),
    }
    predicted = folder / predictions.FILE
    if criticism.predictions:
        contents[predicted] = predictions.prediction_table(criticism.predictions)
    write_whole(contents, gone=[] if criticism.predictions else [predicted])

# SPDX-License-Identifier: BSD-3-Clause
"""Turn what the search found into a verdict and the words and figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import scipy

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import Drive, prepare
from kurumaisu.critic.base.restarted_path import PICTURE, RESTART, restarted_path
from kurumaisu.critic.engine import search, uncertain_effects
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.experiment.proposal import Proposal
from kurumaisu.critic.heldout.drive_gain import CHANNELS
from kurumaisu.critic.heldout.materiality import (
    FELT,
    MATERIAL,
    NO_NOISE,
    confirmed,
    share_of_noise,
    share_of_way,
    simulates_nearer,
)
from kurumaisu.critic.judge import intervals, misfit, sentences
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.extended_model import process_noise
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.story import Misfit, NoiseParameter, Overlay, Story
from kurumaisu.critic.values.verdict import Cause, Estimate, Gain, Kind, Verdict
from kurumaisu.critic.values.version import version
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

# At usual rates, from which growing noise is named: alone, where less is no matter, and beside something else, which in
# another form than ours leaves residuals that grow with the rates, too.
_GROWTH_ALONE, _GROWTH_BESIDE = 0.2, 0.4


def invalid(recording: Recording, model: Model, problems: Sequence[str]) -> Criticism:
    """Return the criticism of data that must be mended before anything is fitted."""
    notes = tuple(note for note in recording.problems if note not in problems)
    verdict = Verdict("invalid_data", problems=(*problems, *notes))
    story = Story(
        recording=recording.name,
        model=model.name,
        headline=sentences.wrong_data(problems),
        details=tuple(problems),
        pose_source=_pose_source(recording),
        provenance=_provenance(recording),
        overlays=overlays(recording, model),
    )
    return Criticism(verdict, story, model, ())


def undriven(recording: Recording, model: Model) -> Criticism:
    """Return the criticism of drives of which nobody knows what drove them: nothing is said of the base."""
    story = Story(
        recording=recording.name,
        model=model.name,
        headline="These scans show no effect that the model lacks.",
        details=("base not criticised: no voltages, commands or odometry were recorded.",),
        pose_source=_pose_source(recording),
        provenance=_provenance(recording),
    )
    return Criticism(Verdict("none", problems=recording.problems), story, model, ())


def criticism(
    recording: Recording,
    made: Decision,
    gain: Gain | None,
    drives: Sequence[Drive],
    proposal: Proposal,
) -> Criticism:
    """Return the criticism after a search; gain: the gain on held-out drives, None when nothing was found."""
    problem, found, growth = made.problem, made.found, made.growth
    best = found.best
    shares = {name: share_of_way(problem, best.settings, _without(best, name)) for name in sorted(best.ids)}
    nats = found.nats(best)
    # What is no noise by far, but other from drive to drive, brings surprises; then it must simulate them better.
    held = confirmed(gain, nats) or (nats >= NO_NOISE and simulates_nearer(gain, tuple(CHANNELS)))
    gains = found.enough and (held or made.untested)
    felt = {name: share_of_noise(problem, best.settings, _without(best, name)) for name in shares}
    matters = {name for name in shares if gains and (shares[name] >= MATERIAL or felt[name] >= FELT)}
    told = tuple(group for group in found.confounded if not best.ids & set(group) or matters & set(group))
    if nats >= NO_NOISE and matters and not (told or matters & set(found.named)):
        told = (_open(found),)
    found = replace(found, confounded=told)
    kind = _kind(found, matters)
    fitted = {
        name: uncertain_effects.widened_intervals(found, name, intervals.estimates(problem, best, name))
        for name in sorted(best.ids)
    }
    causes = tuple(_cause(problem, found, name, fitted[name]) for name in found.named if name in matters)
    # Odometry as input is itself measured, and errs more the faster the robot moves: no finding about the robot.
    asked = problem.ids is None or process_noise(problem).id in problem.ids
    least = _GROWTH_BESIDE if made.something else _GROWTH_ALONE
    sure = growth.p >= search.NAMED and growth.noise.growth >= least
    if asked and sure and all(drive.source != "odom" for drive in drives):
        kind, causes = "named", (*causes, Cause(process_noise(problem).id, growth.p, {}, growth.gain_nats))
    settings = best.settings if kind in ("named", "confounded") else ()
    verdict = Verdict(
        kind,
        causes=causes,
        confounded=found.confounded if kind != "none" else (),
        problems=recording.problems,
        next_experiment=proposal.experiment,
        gain=gain,
    )
    story = Story(
        recording=recording.name,
        model=problem.model.name,
        headline=sentences.headline(verdict, found, matters, shares),
        details=(
            *sentences.details(problem, found, drives, fitted, shares, matters),
            *((sentences.UNTESTED,) if matters and not held else ()),
        ),
        pose_source=_pose_source(recording),
        provenance=_provenance(recording),
        overlays=overlays(recording, problem.model, settings or None),
        misfits=_misfits(problem, found),
        rivals=sentences.rivals(found),
        noise=_noise(problem),
        unexplained=(*sentences.suspects(found), *misfit.remaining(problem, best)),
        next_drive=proposal.sentence,
    )
    return Criticism(verdict, story, problem.model, (*settings, process_noise(problem)))


def _without(fit: Fit, name: str) -> tuple[EffectSetting, ...]:
    return tuple(setting for setting in fit.settings if setting.id != name)


def _open(found: SearchResult) -> tuple[str, ...]:
    """Return the effects of the best set, or the one with its likeliest rival: something acts, though none is certain.

    Curves in no catalogue have the rest of the probability, but none of them enough to be told.
    """
    best = found.best.ids
    rival = max(sorted(set(found.p) - best), key=lambda name: found.p[name], default=None)
    return tuple(sorted(best if len(best) > 1 or rival is None else best | {rival}))


def _kind(found: SearchResult, matters: set[str]) -> Kind:
    if not matters:
        return "none"
    return "named" if matters & set(found.named) else "confounded" if found.confounded else "none"


def _cause(problem: Problem, found: SearchResult, name: str, parameters: dict[str, Estimate]) -> Cause:
    rest = {candidate for candidate in found.best.candidates if candidate.id != name}
    without = problem.fit_candidates(rest, found.best.start)
    return Cause(name, min(found.p[name], 1.0), parameters, found.best.score - without.score)


def _noise(problem: Problem) -> tuple[NoiseParameter, ...]:
    n = problem.noise
    rows: tuple[tuple[str, float, str], ...] = (
        ("reference position, each axis", n.position_sd, "m"),
        ("reference heading", n.heading_sd, "rad"),
        ("forward speed", n.sd_v, "m/s"),
        ("sideways speed", n.sd_lateral, "m/s"),
        ("yaw rate", n.sd_w, "rad/s"),
        ("time constant of the noise of the rates", n.tau, "s"),
    )
    if n.slow_v or n.slow_lateral or n.slow_w:
        rows += (
            ("forward speed, slow part", n.slow_v, "m/s"),
            ("sideways speed, slow part", n.slow_lateral, "m/s"),
            ("yaw rate, slow part", n.slow_w, "rad/s"),
            ("time constant of the slow part", n.slow_tau, "s"),
        )
    if n.lasting:
        rows += (
            ("reference position, slowly varying part", n.lasting * n.position_sd, "m"),
            ("reference heading, slowly varying part", n.lasting * n.heading_sd, "rad"),
            ("time constant of the slowly varying part", n.lasting_tau, "s"),
        )
    return tuple(NoiseParameter(name, value, float("nan"), float("nan"), unit) for name, value, unit in rows)


def _misfits(problem: Problem, found: SearchResult) -> tuple[Misfit, ...]:
    """Return a figure per effect of the best set; where that is empty, of the effect that comes nearest, if any."""
    fit = found.best if found.best.ids else next((fit for fit in found.fits if fit.ids), found.best)
    return misfit.figures(problem, fit.settings, sorted(fit.ids))


def overlays(
    recording: Recording, model: Model, settings: Sequence[EffectSetting] | None = None
) -> tuple[Overlay, ...]:
    """Return a picture of every run that is whole enough for one; settings: what extends the model, if anything."""
    drawn = []
    for run in recording.runs:
        with suppress(Error):
            drawn.append(_overlay(run, model, settings, held_out=run.name in recording.test))
    return tuple(drawn)


def _overlay(run: Run, model: Model, settings: Sequence[EffectSetting] | None, *, held_out: bool) -> Overlay:
    drive = with_covariates(prepare(run, model, PICTURE), run)
    baseline, off = _restarted(drive, replay.path(drive, model, ()))
    extended, off_extended = None, None
    if settings is not None:
        extended, off_extended = _restarted(drive, replay.path(drive, model, settings))
    path = drive.poses[:, :2]
    return Overlay(drive.name, path, baseline, extended, held_out, RESTART, off, off_extended, drive.times)


def _restarted(drive: Drive, path: FloatArray) -> tuple[FloatArray, float | None]:
    """Return a simulated path (n, 2) in pieces that begin at measured poses, nan between, and how far off they end."""
    pieces, off = [], []
    for rows, poses in restarted_path(drive, path):
        pieces += [poses[:, :2], np.full((1, 2), np.nan)]
        if drive.times[rows][-1] - drive.times[rows][0] > RESTART / 2:
            off.append(np.sum((poses[-1] - drive.poses[rows][-1])[:2] ** 2))
    return np.concatenate(pieces)[:-1], float(np.sqrt(np.mean(off))) if off else None


def _pose_source(recording: Recording) -> str:
    return "; ".join(dict.fromkeys(run.pose_source for run in recording.runs))


def _provenance(recording: Recording) -> dict[str, str]:
    return {
        "runs fitted": ", ".join(recording.train),
        "runs held out": ", ".join(recording.test) or "each in turn",
        "an effect is named": f"from a probability of {search.NAMED:g} on",
        "kurumaisu, numpy, scipy": f"{version()}, {np.__version__}, {scipy.__version__}",
    }

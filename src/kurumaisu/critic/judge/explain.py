# SPDX-License-Identifier: BSD-3-Clause
"""Turn what the search found into a verdict and the words and figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment.proposal import Proposal
from kurumaisu.critic.heldout.materiality import NO_NOISE, holds, matters, share_of_noise, share_of_way
from kurumaisu.critic.imu.turning_only import EXPLAINED, beyond_imu
from kurumaisu.critic.judge import intervals, misfit, sentences
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.extended_model import process_noise
from kurumaisu.critic.judge.overlays import overlays
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.policy import NAMED
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.story import Misfit, NoiseParameter, Story
from kurumaisu.critic.values.verdict import Cause, Estimate, Gain, Kind, Verdict
from kurumaisu.critic.values.version import version
from kurumaisu.params import EffectSetting, Model

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
    problem = made.problem
    held, shares, matters = _materiality(made, gain, turning=recording.turning)
    found = replace(made.found, confounded=_told_sets(made.found, matters))
    fitted = {name: intervals.estimates(problem, found.best, name) for name in sorted(found.best.ids)}
    causes = tuple(_cause(problem, found, name, fitted[name]) for name in found.named if name in matters)
    growth = _growing_noise(made, drives)
    kind = _kind(found, matters) if growth is None else "named"
    settings = found.best.settings if kind in ("named", "confounded") else ()
    verdict = Verdict(
        kind,
        causes=causes if growth is None else (*causes, growth),
        confounded=found.confounded if kind != "none" else (),
        problems=recording.problems,
        next_experiment=proposal.experiment,
        gain=gain,
    )
    details = sentences.details(problem, found, drives, fitted, shares, matters)
    story = Story(
        recording=recording.name,
        model=problem.model.name,
        headline=sentences.headline(verdict, found, matters, shares),
        details=(*details, *((sentences.UNTESTED,) if matters and not held else ())),
        pose_source=_pose_source(recording),
        provenance=_provenance(recording),
        overlays=overlays(recording, problem.model, settings or None),
        misfits=_misfits(problem, found),
        rivals=sentences.rivals(found),
        noise=_noise(problem),
        unexplained=(*sentences.suspects(found), *misfit.remaining(problem, found.best)),
        next_drive=proposal.sentence,
    )
    return Criticism(verdict, story, problem.model, (*settings, process_noise(problem)))


def shares_of(made: Decision, *, turning: bool) -> dict[str, float]:
    """Return by which share each effect that was found moves the robot, by its id; turning: as of _materiality."""
    problem, best = made.problem, made.found.best
    shares = {name: share_of_way(problem, best.settings, without(best.settings, name)) for name in sorted(best.ids)}
    return beyond_imu(shares) if turning else shares


def _materiality(made: Decision, gain: Gain | None, *, turning: bool) -> tuple[bool, dict[str, float], set[str]]:
    """Return whether held-out drives confirm what was found, how far each effect moves the chair, and which matter.

    turning: only that was measured, by an imu, of which the scale is not known.
    """
    problem, best = made.problem, made.found.best
    held = holds(gain, made.found.nats(best))
    gains = made.found.enough and (held or made.untested)
    shares = shares_of(made, turning=turning)
    felt = {name: share_of_noise(problem, best.settings, without(best.settings, name)) for name in shares}
    felt = {name: 0.0 if shares[name] == EXPLAINED else size for name, size in felt.items()}
    return held, shares, {name for name in shares if gains and matters(shares[name], felt[name])}


def _told_sets(found: SearchResult, matters: set[str]) -> tuple[tuple[str, ...], ...]:
    """Return the sets of which one effect acts, of those that matter; the best one where something must act."""
    best = found.best.ids
    told = tuple(group for group in found.confounded if not best & set(group) or matters & set(group))
    if found.nats(found.best) >= NO_NOISE and matters and not (told or matters & set(found.named)):
        return (_open(found),)
    return told


def _growing_noise(made: Decision, drives: Sequence[Drive]) -> Cause | None:
    """Return the noise of the rates as a cause, where it grows with them for sure.

    Odometry as input is itself measured, and errs more the faster the robot moves: no finding about the robot.
    """
    problem, growth = made.problem, made.growth
    name = process_noise(problem).id
    least = _GROWTH_BESIDE if made.something else _GROWTH_ALONE
    sure = growth.p >= NAMED and growth.noise.growth >= least
    if (problem.ids is not None and name not in problem.ids) or not sure:
        return None
    if any(drive.source == "odom" for drive in drives):
        return None
    return Cause(name, growth.p, {}, growth.gain_nats)


def without(settings: Sequence[EffectSetting], name: str) -> tuple[EffectSetting, ...]:
    """Return settings without an effect."""
    return tuple(setting for setting in settings if setting.id != name)


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


def _pose_source(recording: Recording) -> str:
    return "; ".join(dict.fromkeys(run.pose_source for run in recording.runs))


def _provenance(recording: Recording) -> dict[str, str]:
    return {
        "runs fitted": ", ".join(recording.train),
        "runs held out": ", ".join(recording.test) or "each in turn",
        "least probability of a named cause": f"{NAMED:g}",
        "kurumaisu, numpy, scipy": f"{version()}, {np.__version__}, {scipy.__version__}",
    }

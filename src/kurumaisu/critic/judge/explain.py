# SPDX-License-Identifier: BSD-3-Clause
"""Turn what the search found into a verdict and the words and figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy
import yaml

from kurumaisu import effects
from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment.design import Proposal
from kurumaisu.critic.heldout.materiality import NO_NOISE, holds, matters, share_of_noise, share_of_way
from kurumaisu.critic.judge import intervals, misfit, sentences
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.misfit import overlays
from kurumaisu.critic.judge.turning_only import EXPLAINED, beyond_imu
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.policy import NAMED
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.story import NoiseParameter, Story
from kurumaisu.critic.values.verdict import Cause, Estimate, Gain, Kind, Verdict
from kurumaisu.critic.values.version import version
from kurumaisu.params import EffectSetting, Model, read_model
from kurumaisu.settings import Section, parsed

# At usual rates, from which growing noise is named: alone, where less is no matter, and beside something else, which in
# another form than ours leaves residuals that grow with the rates, too.
_GROWTH_ALONE, _GROWTH_BESIDE = 0.2, 0.4
_WIDE = {"min": -100.0, "max": 100.0, "resolution": 0.0}  # [V]


def invalid(recording: Recording, model: Model, problems: Sequence[str]) -> Criticism:
    """Return the criticism of data that must be mended before anything is fitted."""
    notes = tuple(note for note in recording.problems if note not in problems)
    verdict = Verdict("invalid_data", problems=(*problems, *notes))
    story = replace(
        _story(recording, model),
        headline=sentences.wrong_data(problems),
        details=tuple(problems),
        overlays=overlays(recording, model),
    )
    return Criticism(verdict, story, model, ())


def undriven(recording: Recording, model: Model) -> Criticism:
    """Return the criticism of drives of which nobody knows what drove them: nothing is said of the base."""
    story = replace(
        _story(recording, model),
        headline="These scans show no effect that the model lacks.",
        details=("base not criticised: no voltages, commands or odometry were recorded.",),
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
    kind: Kind = "confounded" if found.confounded and matters else "none"
    if growth is not None or matters & set(found.named):
        kind = "named"
    settings = found.best.settings if kind in ("named", "confounded") else ()
    verdict = Verdict(
        kind,
        causes=causes if growth is None else (*causes, growth),
        confounded=found.confounded if kind != "none" else (),
        problems=recording.problems,
        next_experiment=proposal.experiment,
        gain=gain,
    )
    # Where the best set is empty, the effect that comes nearest, if any.
    shown = found.best if found.best.ids else next((fit for fit in found.fits if fit.ids), found.best)
    details = sentences.details(problem, found, drives, fitted, shares, matters)
    story = replace(
        _story(recording, problem.model),
        headline=sentences.headline(verdict, found, matters, shares),
        details=(*details, *((sentences.UNTESTED,) if matters and not held else ())),
        overlays=overlays(recording, problem.model, settings or None),
        misfits=misfit.figures(problem, shown.settings, sorted(shown.ids)),
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
    return tuple(NoiseParameter(*row) for row in rows)


def _story(recording: Recording, model: Model) -> Story:
    """Return what is told of a recording, whatever is found."""
    provenance = {
        "runs fitted": ", ".join(recording.train),
        "runs held out": ", ".join(recording.test) or "each in turn",
        "least probability of a named cause": f"{NAMED:g}",
        "kurumaisu, numpy, scipy": f"{version()}, {np.__version__}, {scipy.__version__}",
    }
    source = "; ".join(dict.fromkeys(run.pose_source for run in recording.runs))
    return Story(recording.name, model.name, "", (), source, provenance)


def process_noise(problem: Problem) -> EffectSetting:
    """Return the estimated noise of the rates as the effect that the simulator draws it from.

    That effect has one colour: both are taken into its size, as they were on average.
    """
    (random,) = (effect for effect in effects.BASE if effect.random)
    noise = problem.noise
    sd_v, sd_w = np.hypot([noise.sd_v, noise.sd_w], [noise.slow_v, noise.slow_w])
    share = noise.slow_w**2 / (noise.slow_w**2 + noise.sd_w**2)  # of the variance of the yaw rate
    tau = (1 - share) * noise.tau + share * noise.slow_tau  # keeps how far the heading wanders
    values = {"sd_v": float(sd_v), "sd_w": float(sd_w), "tau": tau, "growth": noise.growth}
    return EffectSetting(random.id, {p.name: min(values[p.name], p.upper) for p in random.parameters})


def extended_text(original: Path, model: Model, settings: Sequence[EffectSetting], recording: str) -> str:
    """Return the model file `original` with these effects in place of its own of the same id; it can be loaded.

    model: as criticised; where its voltages are the commands themselves, the file gets that law.
    Raise Error when the file cannot be read, or the text is no model.
    """
    content = parsed(read_text(original, MOST_TEXT), str(original))
    given = {setting.id for setting in settings}
    content["effects"] = [own for own in content["effects"] if own["id"] not in given]
    content["effects"] += [{"id": s.id, "parameters": dict(s.parameters)} for s in settings]
    if model.law_name not in content["voltage_laws"]:
        content["name"] = model.name
        content["voltage_law"] = model.law_name
        content["voltage_laws"][model.law_name] = {
            "translation": _axis(model.translation),
            "steering": _axis(model.steering),
        }
        # The bands are in the volts of the file's own law.
        content["voltages"] |= {"translation": dict(_WIDE), "steering": dict(_WIDE)}
    if not model.robot.voltages:
        content["robot"] = model.robot.said
        content["chassis"]["track"] = model.chassis.track
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110)
    where = f"{original} with what was found"
    read_model(Section(parsed(text, where), where))
    return f"# {original.name} and what the critic found in {' '.join(recording.split())}.\n{text}"


def _axis(law: object) -> dict[str, dict[str, float]]:
    return {
        side: {"slope": getattr(law, side).slope, "intercept": getattr(law, side).intercept}
        for side in ("positive", "negative")
    }

# SPDX-License-Identifier: BSD-3-Clause
"""Turn what the search found into a verdict and the words and figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from kurumaisu import effects
from kurumaisu.critic import misfit, naming, replay
from kurumaisu.critic.drive import Drive, prepare
from kurumaisu.critic.evidence import Fit, Problem, Term
from kurumaisu.critic.extended import process_noise
from kurumaisu.critic.material import HORIZON, MATERIAL, moved_share
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.recording import Recording, Run
from kurumaisu.critic.story import Misfit, Noise, Overlay, Rival, Story
from kurumaisu.critic.verdict import Cause, Estimate, Gain, Kind, Verdict
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_MINUTE = 60.0  # [s]
_PICTURE = 0.1  # [s] between the poses drawn
_NORMAL90 = 1.645  # half width of a 90 % interval, in standard deviations
_RIVALS_SHOWN = 4  # of those with other causes, and of those with more or fewer


@dataclass(frozen=True)
class Criticism:
    """Everything that the critic has to say. settings: what extends the model."""

    verdict: Verdict
    story: Story
    model: Model
    settings: tuple[EffectSetting, ...]


def invalid(recording: Recording, model: Model, problems: Sequence[str]) -> Criticism:
    """Return the criticism of data that must be mended before anything is fitted."""
    notes = tuple(note for note in recording.problems if note not in problems)
    verdict = Verdict("invalid_data", problems=(*problems, *notes))
    story = Story(
        recording=recording.name,
        model=model.name,
        headline="The data are wrong, so nothing was fitted.",
        details=tuple(problems),
        pose_source=_pose_source(recording),
        provenance=_provenance(),
        overlays=tuple(_overlay(run, model, None, held_out=False) for run in recording.runs),
    )
    return Criticism(verdict, story, model, ())


def criticism(
    recording: Recording, problem: Problem, found: Naming, worth: Gain | None, drives: Sequence[Drive]
) -> Criticism:
    """Return the criticism after a search; worth: the gain on held-out drives, None when nothing was found."""
    best = found.best
    shares = {name: moved_share(problem, best.settings, _without(best, name)) for name in sorted(best.ids)}
    gains = worth is not None and worth.log_density_per_sample.lo90 > 0
    matters = {name for name, share in shares.items() if gains and share >= MATERIAL}
    kind = _kind(found, matters)
    causes = tuple(_cause(problem, found, name) for name in found.named if name in matters)
    settings = best.settings if kind in ("named", "confounded") else ()
    verdict = Verdict(
        kind,
        causes=causes,
        confounded=found.confounded if kind != "none" else (),
        problems=recording.problems,
        gain=worth,
    )
    story = Story(
        recording=recording.name,
        model=problem.model.name,
        headline=_headline(verdict, best, found.p),
        details=_details(problem, found, drives, shares, matters),
        pose_source=_pose_source(recording),
        provenance=_provenance(),
        overlays=tuple(
            _overlay(run, problem.model, settings or None, held_out=run.name in recording.test)
            for run in recording.runs
        ),
        misfits=_misfits(problem, found),
        rivals=_rivals(found),
        noise=_noise(problem),
        unexplained=(*_suspects(found), *misfit.remaining(problem, best)),
    )
    return Criticism(verdict, story, problem.model, (*settings, process_noise(problem.noise)))


def _without(fit: Fit, name: str) -> tuple[EffectSetting, ...]:
    return tuple(setting for setting in fit.settings if setting.id != name)


def _kind(found: Naming, matters: set[str]) -> Kind:
    if not matters:
        return "none"
    return "named" if matters & set(found.named) else "confounded" if found.confounded else "none"


def _cause(problem: Problem, found: Naming, name: str) -> Cause:
    without = problem.fit(found.best.ids - {name}, {})
    parameters = {
        term.parameter.name: _estimate(problem.model, term, value, sd)
        for term, value, sd in zip(found.best.terms, found.best.values, found.best.sds, strict=True)
        if term.id == name
    }
    return Cause(name, min(found.p[name], 1.0), parameters, found.best.score - without.score)


def _estimate(model: Model, term: Term, value: float, sd: float) -> Estimate:
    unit = term.parameter.unit
    if unit == "V" and model.law_name == "identity":
        unit = "V (1 V stands for 1 m/s or 1 rad/s)"
    low, high = value - _NORMAL90 * sd, value + _NORMAL90 * sd
    return Estimate(float(value), max(low, term.parameter.lower), min(high, term.parameter.upper), unit)


def _headline(verdict: Verdict, best: Fit, p: dict[str, float]) -> str:
    if verdict.verdict == "named":
        text = "; ".join(_sentence(cause.id) for cause in verdict.causes)
        return f"{text[0].upper()}{text[1:]} ({', '.join(cause.id for cause in verdict.causes)})."
    if verdict.verdict == "confounded":
        group = " or ".join(verdict.confounded[0])
        return f"Something is missing in the model, but these drives cannot tell which: {group}."
    if best.ids:
        return f"Nothing that matters: {', '.join(sorted(best.ids))} is detectable, but too small to gain anything."
    nearest = max(p, key=lambda name: p[name])
    if p[nearest] >= naming.RIVAL:
        return f"Nothing can be named: noise explains these drives as well. The nearest suspect is {nearest}."
    return "Nothing is missing in the model that these drives could show."


def _sentence(name: str) -> str:
    return effects.by_id(name).sentence


def _details(
    problem: Problem, found: Naming, drives: Sequence[Drive], shares: dict[str, float], matters: set[str]
) -> tuple[str, ...]:
    seconds = sum(float(drive.times[-1] - drive.times[0]) for drive in drives)
    details = [
        f"{len(drives)} drive{'s' * (len(drives) > 1)}, {seconds:.0f} s, replayed from the {drives[0].source} channel.",
    ]
    for term, value, sd in zip(found.best.terms, found.best.values, found.best.sds, strict=True):
        e = _estimate(problem.model, term, value, sd)
        weight = "" if term.id in matters else ": detectable, but it does not matter"
        details.append(
            f"{term.id}: {term.parameter.name} {e.estimate:.3g} {e.unit}, 90 % {e.lo90:.3g} to {e.hi90:.3g}; within "
            f"{HORIZON:g} s it moves the chair by {shares[term.id]:.1%} of its way or turn{weight}."
        )
    wander = np.degrees(problem.noise.sd_w * np.sqrt(2 * problem.noise.tau * _MINUTE))
    details.append(f"The yaw rate fluctuates at random: the heading wanders by {wander:.1f} deg (sd) in a minute.")
    alarm = f"{found.false_alarm:.1%}" if found.false_alarm > 0 else f"less than {1 / naming.NULLS:.2%}"
    details.append(f"Noise alone would look as much like some effect in {alarm} of drives like these.")
    return tuple(details)


def _suspects(found: Naming) -> tuple[str, ...]:
    """Return a sentence on the effects that may act, for all that these drives show."""
    some = sorted((name for name in found.p if naming.RIVAL <= found.p[name] < naming.NAMED), key=lambda n: -found.p[n])
    if not some:
        return ()
    listed = ", ".join(f"{name} ({found.p[name]:.2f})" for name in some)
    return (f"Not certain enough to be named (probability): {listed}. More drives that excite them would decide.",)


def _rivals(found: Naming) -> tuple[Rival, ...]:
    """Return sets with other causes and sets with more or fewer, the best of each kind, by their evidence."""
    best = found.best
    swapped = [fit for fit in found.fits if not (fit.ids >= best.ids or fit.ids < best.ids)]
    others = [fit for fit in found.fits if fit.ids > best.ids or fit.ids < best.ids]
    shown = sorted(swapped[:_RIVALS_SHOWN] + others[:_RIVALS_SHOWN], key=lambda fit: -fit.score)
    return tuple(_rival(fit, best) for fit in shown)


def _rival(fit: Fit, best: Fit) -> Rival:
    likelihood = fit.log_likelihood - best.log_likelihood
    if fit.score > best.score:
        why = f"fits better by {likelihood:.1f} nats, too little for one more effect, which is rare beforehand"
    elif fit.ids > best.ids:
        why = f"fits better by {likelihood:.1f} nats, less than another effect costs"
    elif fit.ids < best.ids or likelihood < 0:
        why = f"leaves {-likelihood:.1f} nats unexplained"
    else:
        why = f"fits better by {likelihood:.1f} nats, but needs more effects"
    return Rival(" + ".join(sorted(fit.ids)) or "no effect", fit.score - best.score, why)


def _noise(problem: Problem) -> tuple[Noise, ...]:
    n = problem.noise
    rows = (
        ("reference position, each axis", n.position_sd, "m"),
        ("reference heading", n.heading_sd, "rad"),
        ("forward speed", n.sd_v, "m/s"),
        ("sideways speed", n.sd_lateral, "m/s"),
        ("yaw rate", n.sd_w, "rad/s"),
        ("time constant of the rates' noise", n.tau, "s"),
    )
    return tuple(Noise(name, value, float("nan"), float("nan"), unit) for name, value, unit in rows)


def _misfits(problem: Problem, found: Naming) -> tuple[Misfit, ...]:
    """Return a figure per effect of the best set; where that is empty, of the effect that comes nearest."""
    fit = found.best if found.best.ids else next(fit for fit in found.fits if fit.ids)
    return misfit.figures(problem, fit.settings, sorted(fit.ids))


def _overlay(run: Run, model: Model, settings: Sequence[EffectSetting] | None, *, held_out: bool) -> Overlay:
    drive = prepare(run, model, _PICTURE)

    def seen(extra: Sequence[EffectSetting]) -> FloatArray:
        return replay.path(drive, model, extra)[:, :2]

    extended = None if settings is None else seen(settings)
    return Overlay(drive.name, drive.poses[:, :2], seen(()), extended, held_out)


def _pose_source(recording: Recording) -> str:
    return "; ".join(dict.fromkeys(run.pose_source for run in recording.runs))


def _provenance() -> dict[str, str]:
    return {
        "named from": f"posterior {naming.NAMED:g}",
        "numpy, scipy": f"{np.__version__}, {scipy.__version__}",
    }

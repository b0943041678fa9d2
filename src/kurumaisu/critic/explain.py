# SPDX-License-Identifier: BSD-3-Clause
"""Turn what the search found into a verdict and the words and figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from kurumaisu import effects
from kurumaisu.critic import misfit, naming, replay
from kurumaisu.critic.drive import Drive
from kurumaisu.critic.evidence import Fit, Problem, Term
from kurumaisu.critic.extended import process_noise
from kurumaisu.critic.naming import Naming
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.story import Noise, Overlay, Rival, Story
from kurumaisu.critic.verdict import Cause, Estimate, Gain, Kind, Verdict
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_MATERIAL = 0.005  # share of the rms rate that an effect must move to matter to a driver
_NORMAL90 = 1.645  # half width of a 90 % interval, in standard deviations
_RIVALS_SHOWN = 8


@dataclass(frozen=True)
class Criticism:
    """Everything that the critic has to say. settings: what extends the model."""

    verdict: Verdict
    story: Story
    model: Model
    settings: tuple[EffectSetting, ...]


def invalid(recording: Recording, model: Model, problems: Sequence[str], drives: Sequence[Drive]) -> Criticism:
    """Return the criticism of data that must be mended before anything is fitted."""
    verdict = Verdict("invalid_data", problems=tuple(problems))
    story = Story(
        recording=recording.name,
        model=model.name,
        headline="The data are wrong, so nothing was fitted.",
        details=tuple(problems),
        pose_source=_pose_source(recording),
        provenance=_provenance(),
        overlays=tuple(_overlay(drive, model, None, held_out=False) for drive in drives),
    )
    return Criticism(verdict, story, model, ())


def criticism(
    recording: Recording, problem: Problem, found: Naming, worth: Gain | None, drives: Sequence[Drive]
) -> Criticism:
    """Return the criticism after a search; worth: the gain on held-out drives, None when nothing was found."""
    best = found.best
    share = moved_share(problem, best)
    material = worth is not None and worth.log_density_per_sample.lo90 > 0 and share >= _MATERIAL
    kind = _kind(found, material)
    causes = tuple(_cause(problem, found, name) for name in found.named) if kind in ("named", "confounded") else ()
    settings = best.settings if kind in ("named", "confounded") else ()
    verdict = Verdict(
        kind,
        causes=causes,
        confounded=found.confounded if kind == "confounded" or causes else (),
        gain=worth,
    )
    held_out = set(recording.test)
    story = Story(
        recording=recording.name,
        model=problem.model.name,
        headline=_headline(verdict, best, material),
        details=_details(problem, found, drives, share),
        pose_source=_pose_source(recording),
        provenance=_provenance(),
        overlays=tuple(
            _overlay(drive, problem.model, settings or None, held_out=drive.name in held_out) for drive in drives
        ),
        misfits=misfit.figures(problem, best.settings, sorted(best.ids)),
        rivals=_rivals(found),
        noise=_noise(problem),
        unexplained=misfit.remaining(problem, best),
    )
    return Criticism(verdict, story, problem.model, (*settings, process_noise(problem.noise)))


def moved_share(problem: Problem, fit: Fit) -> float:
    """Return how much a fit changes the rates: rms of the change over rms of the rate, the larger of v and w."""
    shares = []
    for channel in range(2):
        change = size = 0.0
        for drive in problem.drives:
            without = replay.rates(drive, problem.model, ())[channel]
            change += float(np.sum((replay.rates(drive, problem.model, fit.settings)[channel] - without) ** 2))
            size += float(np.sum(without**2))
        shares.append(np.sqrt(change / size) if size > 0 else 0.0)
    return float(max(shares))


def _kind(found: Naming, material: bool) -> Kind:
    if not found.best.ids or not material:
        return "none"
    if found.named and len(found.named) == len(found.best.ids):
        return "named"
    return "confounded" if found.confounded else "named" if found.named else "none"


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


def _headline(verdict: Verdict, best: Fit, material: bool) -> str:
    if verdict.verdict == "named":
        said = [_sentence(cause.id) for cause in verdict.causes]
        text = "; ".join(said)
        return f"{text[0].upper()}{text[1:]} ({', '.join(cause.id for cause in verdict.causes)})."
    if verdict.verdict == "confounded":
        group = " or ".join(verdict.confounded[0])
        return f"Something is missing in the model, but these drives cannot tell which: {group}."
    if best.ids and not material:
        return f"Nothing that matters: {', '.join(sorted(best.ids))} is detectable, but too small to gain anything."
    return "Nothing is missing in the model that these drives could show."


def _sentence(name: str) -> str:
    return effects.by_id(name).sentence


def _details(problem: Problem, found: Naming, drives: Sequence[Drive], share: float) -> tuple[str, ...]:
    seconds = sum(float(drive.times[-1] - drive.times[0]) for drive in drives)
    details = [
        f"{len(drives)} drive{'s' * (len(drives) > 1)}, {seconds:.0f} s, replayed from the {drives[0].source} channel.",
    ]
    for term, value, sd in zip(found.best.terms, found.best.values, found.best.sds, strict=True):
        e = _estimate(problem.model, term, value, sd)
        details.append(
            f"{term.id}: {term.parameter.name} {e.estimate:.3g} {e.unit}, 90 % {e.lo90:.3g} to {e.hi90:.3g}."
        )
    if found.best.ids:
        details.append(f"It moves the rates by {share:.1%} of their size (rms).")
    alarm = f"{found.false_alarm:.1%}" if found.false_alarm > 0 else f"less than {1 / naming.NULLS:.2%}"
    details.append(f"Noise alone would look as much like some effect in {alarm} of drives like these.")
    return tuple(details)


def _rivals(found: Naming) -> tuple[Rival, ...]:
    rivals = []
    for fit in found.fits[1 : 1 + _RIVALS_SHOWN]:
        nats = fit.score - found.best.score
        likelihood = fit.log_likelihood - found.best.log_likelihood
        if fit.ids > found.best.ids:
            why = f"fits better by {likelihood:.1f} nats, less than another effect costs"
        elif fit.ids < found.best.ids:
            why = f"leaves {-likelihood:.1f} nats unexplained"
        else:
            why = f"fits worse by {-likelihood:.1f} nats" if likelihood < 0 else "fits as well with more effects"
        rivals.append(Rival(" + ".join(sorted(fit.ids)) or "no effect", nats, why))
    return tuple(rivals)


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


def _overlay(drive: Drive, model: Model, settings: Sequence[EffectSetting] | None, *, held_out: bool) -> Overlay:
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

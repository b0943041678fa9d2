# SPDX-License-Identifier: BSD-3-Clause
"""Verdict, words and figure for what is outside the catalogue."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.experiment.design import Proposal
from kurumaisu.critic.heldout.materiality import (
    HORIZON,
    MATERIAL,
    NO_NOISE,
    STRONG_CURVE,
    confirmed,
    matters,
    share_of_noise,
    share_of_way,
    simulates_nearer,
)
from kurumaisu.critic.judge import explain
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.explain import process_noise
from kurumaisu.critic.judge.misfit import moments, overlays
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.unknown import sentences, shapes
from kurumaisu.critic.unknown.joint_fit import FitWithCurve, fit_with_curve
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.story import Alternative, Misfit, bins
from kurumaisu.critic.values.verdict import NORMAL90, Gain, Unknown
from kurumaisu.types import BoolArray, FloatArray

_LISTED = 3  # curves that may act, at most
_UNHELD = 0.5  # probability at most of a curve that did not hold
_SEEN_IN = {  # channels of a gain, by the rate or the part of the measured pose
    "v": ("dx",),
    "lateral": ("dy",),
    "w": ("dtheta",),
    "reference_x": ("dx", "dy"),
    "reference_y": ("dx", "dy"),
    "reference_heading": ("dtheta",),
}
_SETTLED = 2.0  # [s] about a pose over which errors of the way level out in a picture
_PLAUSIBLE = 0.02  # posterior from which another curve is listed


def criticism(
    recording: Recording, made: Decision, gain: Gain | None, drives: Sequence[Drive], proposal: Proposal
) -> Criticism:
    """Return the criticism of drives in which a curve explains more than the catalogue."""
    problem, found, extension = made.problem, made.found, made.extension
    assert extension is not None
    # What acts beside the curve is judged with the curve in the model.
    curved = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    fit = curved.fit_candidates(extension.fit.candidates, extension.fit.start)
    inner = replace(found, fits=(fit, *found.fits), confounded=())
    beside = explain.criticism(recording, replace(made, problem=curved, found=inner), gain, drives, proposal)
    share, felt = _shares(made)
    words = _sentences(extension, made.lead, share)
    if not _confirmed(made, gain) or not matters(share, felt):
        small = f"{words} It is too small to matter, or was not confirmed on held-out data."
        story = replace(beside.story, unexplained=(small, *beside.story.unexplained))
        kept = replace(beside, story=story, model=problem.model)
        return _unconfirmed(kept, problem, made, gain) if share >= MATERIAL else kept
    verdict = replace(beside.verdict, verdict="unknown", unknown=tuple(_unknowns(problem, found)))
    settings = (*extension.settings, process_noise(problem))
    story = replace(
        beside.story,
        headline=sentences.headline(extension),
        details=(words, *beside.story.details),
        overlays=overlays(recording, problem.model, extension.settings),
        misfits=(figure(problem, extension), *(beside.story.misfits if fit.ids else ())),
        rivals=tuple(_rivals(made)),
    )
    return Criticism(verdict, story, problem.model, settings)


def _unconfirmed(kept: Criticism, problem: Problem, made: Decision, gain: Gain | None) -> Criticism:
    """Return a criticism of what did not hold on data held out, as unknown where it cannot be noise.

    It follows more than one thing, or none that is known: the curves only say where to look, and extend nothing.
    """
    extension = made.extension
    assert extension is not None
    if gain is None or not _no_noise(made):
        return kept
    curves = tuple(replace(one, p=min(one.p, _UNHELD)) for one in _unknowns(problem, made.found))
    headline = f"{sentences.headline(extension)} Held-out data do not confirm this: it is not the whole explanation."
    verdict = replace(kept.verdict, verdict="unknown", unknown=curves)
    return replace(kept, verdict=verdict, story=replace(kept.story, headline=headline))


def is_reported(made: Decision, gain: Gain | None) -> bool:
    """Tell whether a curve is told of: it matters, and held on data held out, or what it draws cannot be noise."""
    share, felt = _shares(made)
    return (_confirmed(made, gain) and matters(share, felt)) or (_no_noise(made) and share >= MATERIAL)


def _shares(made: Decision) -> tuple[float, float]:
    """Return how far the curve moves the chair, and what it is beside the noise."""
    extension = made.extension
    assert extension is not None
    settings, without = extension.settings, extension.fit.settings
    return share_of_way(made.problem, settings, without), share_of_noise(made.problem, settings, without)


def _confirmed(made: Decision, gain: Gain | None) -> bool:
    assert made.extension is not None
    channel = made.extension.curve.channel
    seen = _SEEN_IN[channel if channel in effects.REFERENCE_CHANNELS else effects.CHANNELS[channel].rate]
    nats = made.lead
    return confirmed(gain, nats, free=True) or (nats >= STRONG_CURVE and simulates_nearer(gain, seen))


def _no_noise(made: Decision) -> bool:
    best = made.found.curves[0]
    return made.found.nats(best.fit) + best.nats >= NO_NOISE


def figure(problem: Problem, extension: FitWithCurve) -> Misfit:
    """Return the residual without the curve over the covariate, and the curve with its band."""
    _, covariate, unit = sentences.covariate(extension.curve)
    x, residual, left, use = (
        np.concatenate(parts)
        for parts in zip(*(_samples(problem, drive, extension) for drive in problem.drives), strict=True)
    )
    at_all = moments(problem.drives)
    x, residual, left = x[use], residual[use], left[use]
    at = shapes.grid(extension.drawn)
    mean, sd = shapes.band(extension.drawn, at)
    return Misfit(
        channel=sentences.CHANNEL_NAMES[extension.curve.channel],
        unit=sentences.unit_of(extension.curve.channel),
        covariate_name=covariate,
        covariate_unit=unit,
        covariate=x,
        residual=residual,
        bins=bins(x, residual),
        explained_by=f"not in the catalogue, {sentences.followed(extension.curve)}",
        curve=np.column_stack([at, mean]),
        after=bins(x, left),
        band=np.column_stack([at, mean - NORMAL90 * sd, mean + NORMAL90 * sd]),
        moments=replace(at_all, run=at_all.run[use], t=at_all.t[use], places=at_all.places[use]),
    )


def _samples(
    problem: Problem, drive: Drive, extension: FitWithCurve
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return covariate and residual rate without and with the curve, per increment, and which of them count.

    That are those in which the chair moves on.
    """
    if extension.curve.channel in effects.REFERENCE_CHANNELS:
        return _measured_samples(problem, drive, extension)
    into = effects.CHANNELS[extension.curve.channel]
    channel = ("v", "lateral", "w").index(into.rate)
    motion = replay.motion(drive, problem.model, extension.fit.settings)
    basis = extension.curve.basis
    # A constant follows nothing, and is drawn over the time.
    values = effects.Follower("time", 0.0).values(motion) if basis.size == 1 else basis.samples(motion)
    middle = np.clip(((drive.times[1:] + drive.times[:-1]) / 2 - drive.start) / GRID, 0, len(values) - 1).astype(int)
    dt = np.diff(drive.times)
    residual, left = (
        (drive.measured - problem.simulated(drive, settings))[:, channel] / dt
        for settings in (extension.fit.settings, extension.settings)
    )
    x = values[middle]
    if "period" in basis.constants:
        x = np.mod(x, basis.constants["period"])
    use = np.isfinite(x) & motion.moving[middle]
    if into.by:  # a share of a rate: of a small one nothing can be said
        rates = effects.factor(into, motion)[middle]
        use &= np.abs(rates) > 0.3 * np.abs(rates).max()
        residual, left = (each / np.where(use, rates, 1.0) for each in (residual, left))
    return x, residual, left, use


def _measured_samples(
    problem: Problem, drive: Drive, extension: FitWithCurve
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return the same of an error of the reference, per increment's end: what is left, and the curve with that.

    Nobody knows where the chair was but by the way it took, so what is left is told from its mean of some seconds.
    """
    curve = extension.curve
    motion = replay.motion(drive, problem.model, extension.fit.settings)
    cells = np.minimum(((drive.times[1:] - drive.start) / GRID).astype(int), len(motion.v) - 1)
    x = curve.basis.samples(motion)[cells]
    off = drive.measured - problem.simulated(drive, extension.settings)
    axis, _ = effects.REFERENCE_CHANNELS[curve.channel]
    path = np.cumsum(drive.in_map(off)[:, axis])
    first = np.searchsorted(drive.times[1:], drive.times[1:] - _SETTLED)
    last = np.searchsorted(drive.times[1:], drive.times[1:] + _SETTLED, side="right")
    sums = np.append(0.0, np.cumsum(path))
    left = path - (sums[last] - sums[first]) / (last - first)
    drawn = curve.basis.matrix(x) @ extension.coefficients
    if "period" in curve.basis.constants:
        x = np.mod(x, curve.basis.constants["period"])
    return x, drawn + left, left, np.isfinite(x)


def _sentences(extension: FitWithCurve, lead: float, share: float) -> str:
    curve = extension.curve
    where = f"{sentences.channel(curve)} {sentences.followed(curve)}"
    better = f"explains {lead:.1f} nats more than the best effects of the catalogue"
    return (
        f"Outside the catalogue: {where} ({sentences.shape(extension)}) {better}; "
        f"after {HORIZON:g} s the chair is off by {100 * share:.1f} % of the distance driven or angle turned."
    )


def _unknowns(problem: Problem, found: SearchResult) -> Iterator[Unknown]:
    """Yield the curve, and those that could stand in for it."""
    p = found.p_curves
    seen: set[str] = set()
    for rival in found.curves:
        if rival.form_of or rival.curve.id in seen or len(seen) == _LISTED or (seen and p[rival.curve.id] < _PLAUSIBLE):
            continue
        seen.add(rival.curve.id)
        own = fit_with_curve(problem, rival.fit, rival.curve, rival.evidence.prior)
        name = sentences.covariate(rival.curve)[0]
        yield Unknown(sentences.channel(rival.curve), name, sentences.shape(own), min(p[rival.curve.id], 1.0))


def _rivals(made: Decision) -> Iterator[Alternative]:
    """Yield the best set of the catalogue, and the best other curves."""
    found = made.found
    best = found.curves[0]
    yield Alternative(" + ".join(sorted(found.best.ids)) or "no effect", -made.lead, "the best of the catalogue")
    seen = {best.curve.id}
    for rival in found.curves:
        if not rival.form_of and rival.curve.id not in seen and len(seen) <= _LISTED:
            seen.add(rival.curve.id)
            beside = "".join(f" + {name}" for name in sorted(rival.fit.ids))
            name = f"{sentences.channel(rival.curve)} {sentences.followed(rival.curve)}{beside}"
            behind = found.log_posterior(rival) - found.log_posterior(best)
            yield Alternative(name, behind, "a curve over another quantity explains less")

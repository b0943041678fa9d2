# SPDX-License-Identifier: BSD-3-Clause
"""What acts on the mean readings: found by its line, refitted by simulation, cleared of what only seemed to act."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from kurumaisu import effects
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import BEYOND, BlockComparison, Families, SetWithBlock, without_span
from kurumaisu.critic.ranges.search.confounding import Groups, confounded, merged
from kurumaisu.critic.ranges.search.effect_sets import (
    LINE_ERROR,
    FittedForms,
    FormPosterior,
    FormSearch,
    over_all,
    posterior_of,
)
from kurumaisu.critic.ranges.search.large_effect import vanished_effects
from kurumaisu.critic.ranges.search.misfits import Part
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit, fit_parameters
from kurumaisu.critic.ranges.signals.coefficient_blocks import pose_curves
from kurumaisu.critic.ranges.signals.effect_columns import Form
from kurumaisu.critic.ranges.signals.form_error import (
    FormFamily,
    Shares,
    form_family,
    integrated_out,
    over_shares,
    priors_in,
)
from kurumaisu.critic.unknown.curves import curve_evidence
from kurumaisu.critic.values.policy import UNKNOWN_ODDS
from kurumaisu.effects import Mechanism
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_SETS, _DOUBTED = 60, 8  # likeliest sets, and effects of theirs, whose equations are doubted


def pose_curves_left(fit: ParameterFit, normal: NormalEquations) -> bool:
    """Return whether a curve of the laser's pose explains what fitted effects leave, beside their parameters.

    normal: with noise that was estimated whatever curves act.
    """
    there, beams = fit.assembly, fit.normal.beam_noise
    noise = replace(normal, beam_noise=replace(beams, valid=beams.valid & normal.beam_noise.valid))
    made = list(pose_curves(there.shots, there.marks, there.poses))
    if not made:
        return False
    gram = there.products(noise, [fit.slopes, *(one for _, one in made)], fit.left)
    rest, start = np.arange(fit.slopes.shape[2]), fit.slopes.shape[2]
    share = float(np.log(UNKNOWN_ODDS / len(made)))
    for block, columns in made:
        own = np.arange(start, start + columns.shape[2])
        start = own[-1] + 1
        if curve_evidence(*without_span(gram, own, rest), block.priors).nats + share > BEYOND:
            return True
    return False


@dataclass(frozen=True)
class FurtherEffects:
    """What acts beside a fit: found among the rest, forms as in the whole matrix; groups: sets that look alike."""

    found: FormPosterior
    groups: Groups

    def without(self, gone: frozenset[str]) -> FurtherEffects:
        """Return it without what a refit took back, which stands in for nothing either."""
        left = [fit for fit in self.found.fits if not fit.ids & gone]
        return replace(self, found=posterior_of(left, [name for name in self.found.p if name not in gone]))


def further_effects(
    assembly: Assembly,
    normal: NormalEquations,
    made: MeanEffects,
    refitted: ParameterFit,
) -> FurtherEffects | None:
    """Return what acts beside what was found and refitted; None where nothing does.

    normal: with noise that was estimated whatever else acts.
    """
    fit, others, walls = made.fit, made.others, made.winner is not None
    acting = fit.ids if made.winner is None else made.winner.ids
    known = {_key(form): form for form in assembly.forms if form.id not in acting}
    if not known or not (walls or _promising(made.found, fit)):
        return None
    # Seen anew: how far a chair turns within a delay is told by a path that the loud effect had bent.
    forms, columns = refitted.assembly.marks.forms(frozenset(form.id for form in known.values()))
    rest = [form for form in forms if _key(form) in known]
    # While a delay, say, is not in place, a path through the scans is too smooth beside jumps of the rates. What walls
    # that are off do to whole scans is no noise, as it seemed to be without them.
    beams = refitted.normal.beam_noise
    beams = replace(beams, valid=beams.valid & normal.beam_noise.valid)
    refitted = replace(refitted, normal=replace(refitted.normal if walls else normal, beam_noise=beams))
    # Curves that effects of the fit may follow instead, and what these effects do (k, b) [m].
    parts = [(others[form.id], form, size) for form, size in fit.parts() if form.id in others]
    curves = [(curve, assembly.columns[:, :, form.span] @ size) for curve, form, size in parts]
    starts = np.cumsum([0, *(len(form.columns) for form in rest)])
    moved = [replace(form, start=int(start)) for form, start in zip(rest, starts[:-1], strict=True)]
    weighed = _doubted([columns[:, :, form.span] for form in rest], refitted, curves)
    tried: dict[Shares, tuple[FormPosterior, float]] = {}

    def best(shares: Shares) -> float:
        gram, nats = weighed(shares)
        tried[shares] = FormSearch(moved, gram).run(), nats
        return nats + tried[shares][0].best.score

    # How much an equation misses is as open as what acts.
    if curves:
        over_shares(best)
    else:
        best((0.0, 0.0))
    seen = over_all([found for found, _ in tried.values()], [nats for _, nats in tried.values()])
    if not seen.named and not seen.confounded:
        return None
    names = [*seen.named, *(name for group in seen.confounded for name in group if name in seen.best.ids)]
    groups = merged(seen.confounded, confounded(seen, None, (), np.empty((0, 0)), names))
    back = {form.start: known[_key(form)] for form in moved}
    fits = tuple(replace(one, forms=tuple(back[form.start] for form in one.forms)) for one in seen.fits)
    return FurtherEffects(replace(seen, fits=fits), groups)


def _key(form: Form) -> tuple[object, ...]:
    return (form.id, *form.at.items(), *(column.parameter.name for column in form.columns))


def _promising(found: FormPosterior, fit: FittedForms) -> bool:
    """Return whether one more effect would be likelier if no share of what is there were asked of it."""

    def unasked(one: FittedForms) -> float:
        return one.score + LINE_ERROR * max(len(one.forms) - 1, 0) * one.log_likelihood

    return any(unasked(one) > unasked(fit) for one in found.fits if one.ids > fit.ids)


def _doubted(
    parts: Sequence[NDArray[np.float32]], refitted: ParameterFit, curves: Sequence[tuple[FormFamily, FloatArray]]
) -> Callable[[Shares], tuple[FloatArray, float]]:
    """Return what gives the normal equations of columns and, last, of what the refitted leave, whatever their sizes.

    By the shares of what they do that equations may miss; and how likely the data are by these alone [nat].
    """
    there = refitted.assembly
    left = there.residual - there.marks.together([setting for setting, _ in refitted.settings])
    count = sum(part.shape[2] for part in parts)
    free = [curve.columns(there.shots, there.marks.seen) for curve, _ in curves]
    signals = [change[:, :, np.newaxis] for _, change in curves]
    known = np.concatenate([refitted.slopes, refitted.block], axis=2)
    gram = there.products(refitted.normal, [*parts, known, *free, *signals], left)
    ends = np.cumsum([count, known.shape[2], *(part.shape[2] for part in free)])
    powers = np.diag(gram)[ends[-1] : -1].tolist()
    spans = [slice(low, high) for low, high in pairwise(ends[1:].tolist())]
    families = [(span, curve, power) for span, (curve, _), power in zip(spans, curves, powers, strict=True)]
    drawn, keep = np.arange(count, ends[-1]), np.r_[np.arange(count), len(gram) - 1]

    def weighed(shares: Shares) -> tuple[FloatArray, float]:
        prior = block_diag(np.eye(known.shape[2]), *priors_in(gram, families, shares))
        made = integrated_out(gram, drawn, prior)
        volume = np.linalg.slogdet(np.eye(len(drawn)) + gram[np.ix_(drawn, drawn)] @ prior)[1]
        return made[np.ix_(keep, keep)], -0.5 * float(made[-1, -1] + volume)

    return weighed


def settings_of(assembly: Assembly, fit: FittedForms) -> list[EffectSetting]:
    """Return the fitted effects as a model file has them."""
    out = []
    for form, at in fit.parts():
        effect = effects.by_id(form.id)
        if len(form.columns) > 1 and form.columns[0].beside:
            out.append(EffectSetting(form.id, {**assembly.marks.null(effect), **assembly.marks.joined(form, at)}))
            continue
        values = assembly.marks.null(effect)
        for column, coefficient in zip(form.columns, at.tolist(), strict=True):
            if column.squared:
                values |= _squared(effect, form.at, coefficient)
            else:
                values[column.parameter.name] += column.parameter.scale * coefficient
        shape = {} if form.columns[0].squared else form.at
        values |= shape
        # Two effects that nearly cancel are fitted as sums, which no bound stops.
        within = {p.name: float(np.clip(values[p.name], p.lower, p.upper)) for p in effect.parameters}
        out.append(EffectSetting(form.id, within))
    return out


def _squared(effect: type[Mechanism], signs: Mapping[str, float], coefficient: float) -> dict[str, float]:
    """Return the parameters that act by their squares together, for their common square in units of their scales."""
    size = float(np.sqrt(max(coefficient, 0.0)))
    return {
        p.name: float(np.clip(p.null + signs[p.name] * size * p.scale, p.lower, p.upper))
        for p in effect.parameters
        if p.name in signs
    }


@dataclass(frozen=True)
class MeanEffects:
    """What acts on the mean: the forms' fit; winner: a block beside it, if any, its coefficients and covariance.

    others: curves that what acts may follow instead; more: what of the fit was found when the rest of it was in place.
    """

    weighed: BlockComparison
    fit: FittedForms
    winner: SetWithBlock | None
    coefficients: FloatArray
    covariance: FloatArray
    others: Mapping[str, FormFamily] = field(default_factory=dict)
    more: FurtherEffects | None = None

    @property
    def found(self) -> FormPosterior:
        """The search's result with blocks in the running, before more was found."""
        return self.weighed.found

    @property
    def p(self) -> dict[str, float]:
        """The posterior of each effect."""
        return self.found.p if self.more is None else {**self.found.p, **self.more.found.p}

    @property
    def curve(self) -> bool:
        """Whether a curve acts, which is in no catalogue."""
        return self.winner is not None and self.winner.free.basis is not None

    def with_further(self, assembly: Assembly, normal: NormalEquations, more: FurtherEffects) -> MeanEffects:
        """Return the same with what acts beside it."""
        one, other = self.fit, more.found.best
        fit = FittedForms(
            (*one.forms, *other.forms),
            np.concatenate([one.coefficients, other.coefficients]),
            np.concatenate([one.sds, other.sds]),
            one.log_likelihood + other.log_likelihood,
            one.score + other.score,
        )
        return replace(self, fit=fit, others=form_families(assembly, normal, [fit]), more=more)

    def parts(self) -> list[Part]:
        """Return what acts, one by one."""
        out = [Part(form.id, form.span, size) for form, size in self.fit.parts()]
        return [*out, Part(self.winner.free.id, self.winner.free.span, self.coefficients)] if self.winner else out


def form_families(
    assembly: Assembly, normal: NormalEquations, fits: Sequence[FittedForms], most: int | None = None
) -> dict[str, FormFamily]:
    """Return what the equations of the effects of some fits may miss, of the first ones if these are many.

    Of those on readings: geometry has one form, and what moves a laser on the robot is sought as curves of its pose.
    """
    out: dict[str, FormFamily] = {}
    for fit in fits:
        for form, size in fit.parts():
            if form.id not in out and _on_readings(form.id) and (most is None or len(out) < most):
                change = assembly.columns[:, :, form.span] @ size
                found = form_family(change, assembly.shots, assembly.marks.seen, normal.beam_noise.valid)
                if found is not None:
                    out[form.id] = found
    return out


def _on_readings(name: str) -> bool:
    return issubclass(effects.by_id(name), effects.ReadingEffect)


def with_doubt(assembly: Assembly, normal: NormalEquations, found: FormPosterior) -> tuple[NormalEquations, Families]:
    """Return the normal equations of all columns, and last of what the equations of the likeliest effects may miss."""
    families = form_families(assembly, normal, found.fits[:_SETS], _DOUBTED)
    spans, start = {}, assembly.columns.shape[2]
    for name, family in families.items():
        spans[name] = slice(start, start + family.size), family
        start += family.size
    return assembly.with_families(list(families.values())).full(normal), spans


def mean_effects(
    assembly: Assembly, normal: NormalEquations, found: FormPosterior, families: Families, *, posed: bool
) -> MeanEffects:
    """Return what acts by a search, with blocks in the running.

    families: what equations may miss, by effect; posed: whether curves of the laser's pose are in the running.
    """
    free = [each for each in assembly.free if posed or each.pose is None]
    weighed = block_evidence.compare_blocks(found, free, normal.gram, families)
    winner = weighed.winner
    if winner is None:
        others = form_families(assembly, normal, [weighed.fit])
        return MeanEffects(weighed, weighed.fit, None, np.empty(0), np.empty((0, 0)), others)
    fit, coefficients, covariance = block_evidence.fit_with_block(winner, normal.gram)
    return MeanEffects(weighed, fit, winner, coefficients, covariance, form_families(assembly, normal, [fit]))


def refitted(
    assembly: Assembly, normal: NormalEquations, made: MeanEffects, truth: tuple[float, float] | None
) -> ParameterFit:
    """Return what acts, refitted by simulation; truth: known sd of the reference [m, rad]."""
    settings = settings_of(assembly, made.fit)
    return fit_parameters(assembly, normal, made.fit.forms, settings, made.winner, made.others, truth)


def settled(
    assembly: Assembly, normal: NormalEquations, made: MeanEffects, fit: ParameterFit, truth: tuple[float, float] | None
) -> tuple[MeanEffects, ParameterFit]:
    """Return what acts without what its refit takes back, and with what acts beside it, refitted."""
    while made.winner is None or made.winner.free.basis is None:
        gone = vanished_effects(assembly, made.fit, fit) if made.winner is None else frozenset()
        if gone:
            more = None if made.more is None else made.more.without(gone)
            made = replace(made, fit=made.fit.without(gone), more=more)
        elif made.more is None and (more := further_effects(assembly, normal, made, fit)):
            made = made.with_further(assembly, normal, more)
        else:
            break
        fit = refitted(assembly, normal, made, truth)
    return made, fit


def gain_of(made: MeanEffects, name: str) -> float:
    """Return the log evidence of the best set over the best one without an effect [nat]."""
    more = made.more.found if made.more is not None else None
    if more is not None and name in more.best.ids:
        sets = [(fit.ids, fit.score) for fit in more.fits]
    else:
        # A curve that does not lead by enough is out of the running here, too, as it is where p comes from.
        running = [rival for rival in made.weighed.rivals if made.curve or rival.free.basis is None]
        sets = [(fit.ids, fit.score) for fit in made.found.fits]
        sets += [(rival.fit.ids | {rival.free.id}, rival.log_posterior) for rival in running]
    own = max((score for ids, score in sets if name in ids), default=-np.inf)
    return float(own - max((score for ids, score in sets if name not in ids), default=-np.inf))

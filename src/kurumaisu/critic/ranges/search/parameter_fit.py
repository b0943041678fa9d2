# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of what acts, with their intervals: Gauss-Newton steps about the fit, in the very parameters.

A search adds up columns that were taken where no effect acts, for shapes from a grid. Far from there readings do not
follow a delay or a mounting in proportion; poses have been moved to where such an effect had seemed to put the chair;
and a size is only as sure as the shape that it belongs to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from kurumaisu import effects
from kurumaisu.critic.ranges.noise.scan_noise import estimate, with_lasting_common_mode
from kurumaisu.critic.ranges.search.block_evidence import SetWithBlock
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.signals.effect_columns import Form
from kurumaisu.critic.ranges.signals.form_error import FormFamily, beam_family
from kurumaisu.critic.unknown.bases import root_of
from kurumaisu.critic.values.policy import FORM_ERROR, FORM_WAYS
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_STEPS = 2
_ROUNDS = 8  # times, at most, that the scans are seen anew with what moves their beams
_SETTLED = 0.5  # sds by which a parameter may still move between two of them
STRONG = 1.0  # rms of what acts, in sds of single readings, from which scans are seen anew with it
_STEP = 0.05  # of a finite difference, in units of the larger of a parameter and its scale
_SHAPE = 1.0  # prior sd of what only shapes an effect, in the same units
_SIZE = 100.0  # and of its size


@dataclass(frozen=True)
class _Free:
    """A parameter that is fitted: which effect's, its prior sd, and the step of its difference."""

    index: int
    parameter: Parameter
    prior: float
    step: float


@dataclass(frozen=True)
class ParameterFit:
    """Settings of what acts on the mean, with the sds of what was fitted; where that was, and what it leaves.

    assembly: the scans as they are seen with these effects, where any of them moves beams; normal: the noise there, as
    far as it was estimated anew; block (k, b, m) [m]: what acts besides, per prior sd of each of its coefficients;
    left (k, b) [m]: of the residual there; missed (k, b, n) [m]: what equations that are only nearly right may have
    wrong in it, 1 sd; slopes (k, b, p) [m]: how the mean follows what was fitted, per prior sd of each.
    """

    settings: tuple[tuple[EffectSetting, dict[str, float]], ...]
    assembly: Assembly
    normal: NormalEquations
    block: FloatArray
    left: FloatArray
    missed: FloatArray
    slopes: FloatArray


def fit_parameters(
    assembly: Assembly,
    normal: NormalEquations,
    forms: Sequence[Form],
    settings: Sequence[EffectSetting],
    winner: SetWithBlock | None,
    others: Mapping[str, FormFamily],
    truth: tuple[float, float] | None,
) -> ParameterFit:
    """Return the forms, refitted together.

    winner: a block that acts beside them, whose coefficients are integrated out; others: what some of them may do
    instead, which is not left over either; truth: known sd of the reference.
    """
    if not forms and winner is None:
        none = np.empty((*assembly.residual.shape, 0))
        return ParameterFit((), assembly, normal, none, assembly.residual, none, none)
    at = [dict(setting.parameters) for setting in settings]
    curves = [others[form.id] for form in forms if form.id in others]
    block = np.empty((*assembly.residual.shape, 0))  # in units in which its coefficients have a prior sd of 1
    if winner is not None:
        block = np.asarray(assembly.columns[:, :, winner.free.span] @ root_of(winner.evidence.prior))
        likelihood = assembly.noise_beside(normal.beam_noise, forms, block)
        scan = estimate(likelihood, truth)
        normal = replace(normal, scan_noise=scan, wary=with_lasting_common_mode(likelihood, scan))
    # What is as large as a reading's own scatter has moved poses, and made outliers of readings, as much.
    moving = strength(assembly, normal, assembly.marks.together(_settings(forms, at))) > STRONG or any(
        not issubclass(effects.by_id(form.id), effects.ReadingEffect) for form in forms
    )
    free = [each for i, form in enumerate(forms) for each in _free(i, form, at[i])]
    absent = [EffectSetting(form.id, assembly.marks.null(effects.by_id(form.id))) for form in forms]
    sds, left = np.zeros(len(free)), assembly.residual
    for _ in range(_ROUNDS if moving else 1):
        if moving:
            # Where the chair was, which scans count and how they scatter: all of that was found without the effect.
            # What beams keep beyond an equation is no error of whole scans, of which each has other beams that count.
            assembly = assembly.again(_settings(forms, at)).with_families([*curves, beam_family(assembly.shots)])
            normal = normal if winner is not None else assembly.settle(truth)
        before = _values(free, at)
        for _ in range(_STEPS):
            columns = [_slope(assembly, forms, at, each) for each in free]
            left = assembly.residual - assembly.marks.together(_settings(forms, at))
            step, sds, blocked = _step(assembly, normal, free, (columns, block), left)
            left = left - block @ blocked
            for each, by in zip(free, step.tolist(), strict=True):
                p = each.parameter
                at[each.index][p.name] = float(np.clip(at[each.index][p.name] + by, p.lower, p.upper))
        if np.all(np.abs(_values(free, at) - before) < _SETTLED * sds):
            break
    guessed = [i for i, form in enumerate(forms) if effects.by_id(form.id).empirical]
    signals = _signals(assembly, _settings(forms, at), {i: absent[i] for i in guessed})
    slopes = [_slope(assembly, forms, at, each) for each in free]
    sds = np.hypot(sds, _doubt(assembly, normal, free, (slopes, guessed, signals)) * sds)
    drawn = {i: others[forms[i].id] for i in guessed if forms[i].id in others}
    left = left - _other_curves(
        assembly, normal, (free, slopes, block), (drawn, dict(zip(guessed, signals, strict=True))), left
    )
    out: list[dict[str, float]] = [{} for _ in forms]
    for each, sd in zip(free, sds.tolist(), strict=True):
        out[each.index][each.parameter.name] = sd
    missed = FORM_ERROR * np.nan_to_num(np.stack(signals, axis=-1)) if signals else np.empty((*left.shape, 0))
    ways = np.empty((*left.shape, 0))
    if free:
        ways = np.stack([slope * each.prior for slope, each in zip(slopes, free, strict=True)], axis=-1)
    told = tuple(zip(_settings(forms, at), out, strict=True))
    return ParameterFit(told, assembly, normal, block, left, missed, ways)


def _signals(
    assembly: Assembly, every: Sequence[EffectSetting], absent: Mapping[int, EffectSetting]
) -> list[FloatArray]:
    """Return what some of the effects do to the mean (k, b) [m] beside all others; absent: what they are without."""
    whole = assembly.marks.together(every)
    others = ([without if j == i else one for j, one in enumerate(every)] for i, without in absent.items())
    return [whole - assembly.marks.together(other) for other in others]


def strength(assembly: Assembly, normal: NormalEquations, change: FloatArray) -> float:
    """Return the rms of a change of the readings, in their sds; what no longer meets anything counts as nothing."""
    white = np.nan_to_num(change / assembly.first.sd)[normal.beam_noise.valid]
    return float(np.sqrt(np.mean(white**2))) if white.size else 0.0


def _values(free: Sequence[_Free], at: Sequence[dict[str, float]]) -> FloatArray:
    return np.array([at[each.index][each.parameter.name] for each in free])


def _step(
    assembly: Assembly,
    normal: NormalEquations,
    free: Sequence[_Free],
    parts: tuple[Sequence[FloatArray], FloatArray],
    left: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the step of each free parameter, its sd, and the coefficients of the block; parts: columns of both."""
    columns, block = parts
    gram = assembly.products(normal, [*(column[:, :, np.newaxis] for column in columns), block], left)
    prior = np.r_[np.array([each.prior for each in free]), np.ones(block.shape[2])]
    inverse = np.linalg.inv(gram[:-1, :-1] * np.outer(prior, prior) + np.eye(len(prior)))
    step, sds = prior * (inverse @ (prior * gram[:-1, -1])), prior * np.sqrt(np.diag(inverse))
    count = len(free)
    return step[:count], sds[:count], step[count:]


def _doubt(
    assembly: Assembly,
    normal: NormalEquations,
    free: Sequence[_Free],
    parts: tuple[Sequence[FloatArray], Sequence[int], Sequence[FloatArray]],
) -> FloatArray:
    """Return what other forms of what acts may shift each parameter by, in standard deviations.

    Nobody can refuse a form that differs by FORM_ERROR of what the effect does. At which range or angle a size counts
    is the form's choice, so its own size is in doubt by all of it; what only shapes it, a wavelength say, by the share
    that goes one of the ways in which a form may differ; of others, what is like their own marks passes for them.
    parts: how the mean follows each parameter, which effects are empirical, and what these do.
    """
    slopes, guessed, signals = parts
    if not guessed:
        return np.zeros(len(free))
    gram = assembly.products(normal, [np.stack([*slopes, *signals], axis=-1)], assembly.residual)[:-1, :-1]
    norms = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    count = len(free)
    alike = (gram / np.outer(norms, norms))[:count, count:]
    own = np.array([[each.index == i for i in guessed] for each in free])
    share = np.where(own, alike**2 + (1 - alike**2) / FORM_WAYS, alike**2 / FORM_WAYS)
    return np.asarray(FORM_ERROR * np.sqrt(share @ norms[count:] ** 2))


def _other_curves(
    assembly: Assembly,
    normal: NormalEquations,
    fitted: tuple[Sequence[_Free], Sequence[FloatArray], FloatArray],
    instead: tuple[Mapping[int, FormFamily], Mapping[int, FloatArray]],
    left: FloatArray,
) -> FloatArray:
    """Return what of the rest (k, b) [m] effects would do by other curves than their equations.

    fitted: the parameters, how the mean follows each, and a block beside them; instead: the curves, and what the
    equations do, both by effect.
    """
    (free, slopes, block), (curves, signals) = fitted, instead
    if not curves:
        return np.zeros_like(left)
    parts = [curve.columns(assembly.shots, assembly.marks.seen) for curve in curves.values()]
    known = [*(slope[:, :, np.newaxis] for slope in slopes), block, *(signals[i][:, :, np.newaxis] for i in curves)]
    every = np.concatenate([*known, *parts], axis=2)
    gram = assembly.products(normal, [every], left)
    fixed = len(slopes) + block.shape[2]
    powers = np.diag(gram)[fixed : fixed + len(curves)]
    ends = np.cumsum([fixed + len(curves), *(part.shape[2] for part in parts)])
    places = [np.arange(low, high) for low, high in pairwise(ends)]
    priors = [
        curve.scaled(gram[np.ix_(own, own)], power)
        for curve, own, power in zip(curves.values(), places, powers.tolist(), strict=True)
    ]
    sizes = np.r_[np.array([each.prior for each in free]), np.ones(block.shape[2])]
    use = np.concatenate([np.arange(fixed), *places])
    prior = block_diag(np.diag(sizes**2), *priors)
    inner = np.eye(len(use)) + gram[np.ix_(use, use)] @ prior
    return np.asarray(every[:, :, use] @ (prior @ np.linalg.solve(inner, gram[use, -1])))


def _settings(forms: Sequence[Form], at: Sequence[dict[str, float]]) -> list[EffectSetting]:
    return [EffectSetting(form.id, dict(values)) for form, values in zip(forms, at, strict=True)]


def _free(index: int, form: Form, at: dict[str, float]) -> list[_Free]:
    """Return what of a form is fitted: what acts, and what shapes it."""
    shapes = {*form.at, *(name for column in form.columns for name in column.beside)}
    squares = {name for name, size in form.at.items() if size} if form.columns[0].squared else set()
    acting = {column.parameter.name for column in form.columns} | squares
    out = []
    for p in effects.by_id(form.id).parameters:
        unit = max(abs(at[p.name]), p.scale) if p.name in acting else max(abs(at[p.name]), 0.1 * p.scale)
        if p.name in acting:
            out.append(_Free(index, p, _SIZE * p.scale, _STEP * unit))
        elif p.name in shapes - squares and not form.columns[0].squared:
            out.append(_Free(index, p, _SHAPE * unit, _STEP * unit))
    return out


def _slope(assembly: Assembly, forms: Sequence[Form], at: Sequence[dict[str, float]], free: _Free) -> FloatArray:
    """Return how the mean readings (k, b) follow a parameter, the others as they are."""
    p, here = free.parameter, at[free.index]
    ends = np.clip(here[p.name] + np.array([-free.step, free.step]), p.lower, p.upper)
    effect = effects.by_id(forms[free.index].id)
    low, high = (assembly.marks.change(effect, {**here, p.name: end}) for end in ends.tolist())
    return np.asarray((high - low) / (ends[1] - ends[0]))

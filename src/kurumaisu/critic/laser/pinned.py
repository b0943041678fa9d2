# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of what acts, with their intervals: Gauss-Newton steps about the fit, in the very parameters.

A search adds up columns that were taken where no effect acts, for shapes from a grid. Far from there readings do not
follow a delay or a mounting in proportion; poses have been moved to where such an effect had seemed to put the chair;
and a size is only as sure as the shape that it belongs to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.laser.columns import Form
from kurumaisu.critic.laser.normal import Assembly, Normal
from kurumaisu.critic.laser.rivals import Rival
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_STEPS = 2
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


def pinned(
    assembly: Assembly, normal: Normal, forms: Sequence[Form], settings: Sequence[EffectSetting], winner: Rival | None
) -> list[tuple[EffectSetting, dict[str, float]]]:
    """Return the settings of forms, refitted together, and the sds of the parameters that act or shape, by name.

    winner: a block that acts beside them, whose coefficients are integrated out.
    """
    at = [dict(setting.parameters) for setting in settings]
    if not forms:
        return []
    block = _block(assembly, winner)
    if any(not issubclass(effects.by_id(form.id), effects.ReadingEffect) for form in forms):
        assembly = assembly.again(settings)
    free = [each for i, form in enumerate(forms) for each in _free(i, form, at[i])]
    sds = np.empty(0)
    for _ in range(_STEPS):
        columns = np.stack([_slope(assembly, forms, at, each) for each in free], axis=-1)
        left = assembly.residual - assembly.marks.together(_settings(forms, at))
        gram = assembly.products(normal, np.concatenate([columns, block], axis=2), left)
        prior = np.r_[np.array([each.prior for each in free]), np.ones(block.shape[2])]
        inverse = np.linalg.inv(gram[:-1, :-1] * np.outer(prior, prior) + np.eye(len(prior)))
        step, sds = prior * (inverse @ (prior * gram[:-1, -1])), prior * np.sqrt(np.diag(inverse))
        for each, by in zip(free, step.tolist(), strict=False):
            p = each.parameter
            at[each.index][p.name] = float(np.clip(at[each.index][p.name] + by, p.lower, p.upper))
    out: list[dict[str, float]] = [{} for _ in forms]
    for each, sd in zip(free, sds.tolist(), strict=False):
        out[each.index][each.parameter.name] = sd
    return list(zip(_settings(forms, at), out, strict=True))


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


def _block(assembly: Assembly, winner: Rival | None) -> FloatArray:
    """Return the columns (k, b, m) of a block, in units in which its coefficients have a prior sd of 1."""
    if winner is None:
        return np.empty((*assembly.residual.shape, 0))
    values, vectors = np.linalg.eigh(winner.belief.prior)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(assembly.columns[:, :, winner.free.span] @ root)

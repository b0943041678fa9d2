# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the mean readings beside other forms of one another: what an equation misses is no second cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from kurumaisu import effects
from kurumaisu.critic.ranges.search.block_evidence import SetWithBlock, without_span
from kurumaisu.critic.ranges.search.effect_sets import WEAK_PRIOR, FittedForms, FormPosterior
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.signals.form_error import FormFamily, form_family, integrated_out
from kurumaisu.critic.unknown.curves import curve_evidence
from kurumaisu.critic.values.policy import NAMED
from kurumaisu.critic.values.prior import occam, odds
from kurumaisu.types import FloatArray, IntArray

_SURE = float(np.log(NAMED / (1 - NAMED)))  # [nat] from which an effect is named


def form_families(assembly: Assembly, normal: NormalEquations, fit: FittedForms) -> dict[str, FormFamily]:
    """Return, for each effect of a fit whose equation is the simplest of a family of curves, that family."""
    out, start = {}, 0
    for form in fit.forms:
        stop = start + len(form.columns)
        if effects.by_id(form.id).empirical:
            change = assembly.columns[:, :, form.span] @ fit.coefficients[start:stop]
            found = form_family(change, assembly.shots, assembly.marks.seen, normal.beam_noise.valid)
            if found is not None:
                out[form.id] = found
        start = stop
    return out


def without_spurious(
    assembly: Assembly,
    normal: NormalEquations,
    found: FormPosterior,
    acting: tuple[FittedForms, SetWithBlock | None],
    others: Mapping[str, FormFamily],
) -> tuple[FittedForms, SetWithBlock | None]:
    """Return the effects that act, and the block beside them if any, without what other forms of the rest explain.

    acting: the effects and the block; others: the families of those that have one.
    """
    fit, winner = acting
    while others and len(fit.forms) + (winner is not None) > 1:
        log_odds = _JointGram(assembly, normal, fit, winner, others).log_odds(len(found.p))
        weakest = min(log_odds, key=lambda name: log_odds[name])
        if log_odds[weakest] >= _SURE:
            break
        if winner is not None and weakest == winner.free.id:
            winner = None
            continue
        rest = tuple(form for form in fit.forms if form.id != weakest)
        fewer = next((one for one in found.fits if one.forms == rest), None)
        if fewer is None:
            break
        fit, winner = fewer, None if winner is None else replace(winner, fit=fewer)
    return fit, winner


class _JointGram:
    """Normal equations of effects, of a block, and of the families of curves that they belong to."""

    def __init__(
        self,
        assembly: Assembly,
        normal: NormalEquations,
        fit: FittedForms,
        winner: SetWithBlock | None,
        others: Mapping[str, FormFamily],
    ) -> None:
        self._fit, self._winner = fit, winner
        self._others = {form.id: others[form.id] for form in fit.forms if form.id in others}
        parts = {form.id: assembly.columns[:, :, form.span] for form in fit.forms}
        if winner is not None:
            parts[winner.free.id] = assembly.columns[:, :, winner.free.span]
        columns: list[Any] = [*parts.values()]
        columns += [each.columns(assembly.shots, assembly.marks.seen) for each in self._others.values()]
        ends = np.cumsum([0, *(part.shape[2] for part in columns)])
        places = [np.arange(low, high) for low, high in pairwise(ends)]
        self._own = dict(zip(parts, places, strict=False))
        self._free = dict(zip(self._others, places[len(parts) :], strict=True))
        self._gram = assembly.products(normal, np.concatenate(columns, axis=2), assembly.residual)
        self._forms_of = {form.id: sum(each.id == form.id for each in assembly.forms) for form in fit.forms}

    def log_odds(self, count: int) -> dict[str, float]:
        """Return the log odds [nat] of each effect beside other forms of the rest; count: effects that might act."""
        out = {}
        for name in self._own:
            others = [other for other in self._others if other != name]
            drawn = [(self._free[other], self._prior(other)) for other in others]
            block = self._winner
            if block is not None and name != block.free.id:
                drawn.append((self._own[block.free.id], block.evidence.prior))
            gram = _families_integrated(self._gram, drawn)
            rest = self._columns([form.id for form in self._fit.forms if form.id != name])
            own, b = without_span(gram, self._own[name], rest)
            if block is not None and name == block.free.id:
                nats = curve_evidence(own, b, block.free.priors).nats
            else:
                nats = 0.5 * float(b @ np.linalg.solve(own + WEAK_PRIOR * np.eye(len(own)), b))
                z = float(np.sqrt(max(2 * nats, 0.0)))
                # A direction among several columns is as free as z is large.
                nats -= float(occam(z)) + (len(own) - 1) * np.log(max(z, 1.0)) + np.log(self._forms_of[name])
            out[name] = nats + float(np.log(odds(count)))
        return out

    def _columns(self, names: Sequence[str]) -> IntArray:
        return np.concatenate([np.arange(0), *(self._own[name] for name in names)])

    def _prior(self, name: str) -> FloatArray:
        """Return the covariance of the curves that an effect may follow instead."""
        start = 0
        for form in self._fit.forms:
            size = self._fit.coefficients[start : start + len(form.columns)]
            start += len(form.columns)
            if form.id == name:
                own, free = self._own[name], self._free[name]
                power = float(size @ self._gram[np.ix_(own, own)] @ size)
                return self._others[name].scaled(self._gram[np.ix_(free, free)], power)
        raise KeyError(name)


def _families_integrated(gram: FloatArray, drawn: Sequence[tuple[IntArray, FloatArray]]) -> FloatArray:
    if not drawn:
        return gram
    return integrated_out(gram, np.concatenate([at for at, _ in drawn]), block_diag(*(prior for _, prior in drawn)))

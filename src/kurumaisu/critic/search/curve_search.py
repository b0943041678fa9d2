# SPDX-License-Identifier: BSD-3-Clause
"""Curves over what is known of a drive, beside sets of effects: what is in no catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.engine.catalogue import Candidate, settings_of
from kurumaisu.critic.engine.covariance import orthonormal, without
from kurumaisu.critic.engine.evidence import Beside, Fit, Problem
from kurumaisu.critic.engine.form_error import SHARES
from kurumaisu.critic.unknown.bases import root_of
from kurumaisu.critic.unknown.curves import ALIKE, AS_ALIKE, Curve, CurveEvidence, Design, curve_evidences
from kurumaisu.critic.unknown.curves import columns as columns_of
from kurumaisu.critic.unknown.step_curves import fine_curves, gains_over_own_rate, step_curves
from kurumaisu.critic.values.policy import UNKNOWN_ODDS
from kurumaisu.types import FloatArray

_DRAWN = 0.8  # share of a signal's square that a curve can draw, from which it is one
_HINTS = 3  # curves in whose place others are tried: most of a jump shows in a curve that cannot jump
_BENDING = _JUMPING = 0.2  # share of what is outside the catalogue that bends more often, or jumps
_NO_LEVEL = 0.05  # share of a signal's square beyond a level, below which it is one
_SAME = 0.1  # share of the rates by which they may differ and be nearly the same
_PRECISION = 1e-6  # of the products with what equations may miss, which are in single precision
_WORTH = -2.0  # [nat] below which a curve is not kept


@dataclass(frozen=True)
class SetWithCurve:
    """A set of effects with a curve beside it: by how many nats the data and the prior are for the curve.

    form_of: the effects that it draws: one of the set, so that both together are another form of it, or some that the
    set has not. likewise: other single effects that it draws as well.
    """

    fit: Fit
    curve: Curve
    evidence: CurveEvidence
    nats: float
    form_of: frozenset[str] = frozenset()
    likewise: frozenset[str] = frozenset()


class CurveSearch:
    """Curves beside any set of effects of a problem."""

    def __init__(self, problem: Problem, about: Fit | None = None) -> None:
        """Take drives, and the fit by which they are simulated, None: nothing."""
        self._problem, self._about = problem, () if about is None else about.settings
        self._found: dict[frozenset[Candidate], list[SetWithCurve]] = {}
        self._moved: dict[tuple[frozenset[Candidate], frozenset[str]], FloatArray] = {}

    @cached_property
    def _design(self) -> Design | None:
        """Return the curves; None where nothing but effects is asked for."""
        ids = self._problem.ids
        return Design(self._problem, self._about) if ids is None or effects.SMOOTH in ids else None

    def columns(self, fit: Fit, one: SetWithCurve) -> FloatArray:
        """Return whitened columns (rows, k) whose normal shares are a curve before the data."""
        return np.asarray(without(fit.beside.own, self._columns(one.curve)) @ root_of(one.evidence.prior))

    def _columns(self, curve: Curve) -> FloatArray:
        """Return the whitened columns of a curve, (rows, k)."""
        if self._design is not None and any(curve is one for one in self._design.curves):
            return self._design.columns[:, curve.columns]
        return columns_of(self._problem, self._about, [curve])

    def closer(self, fit: Fit) -> None:
        """Try curves that bend more often, and that jump, in the place of the best ones beside a set."""
        if self._design is None:
            return
        hints = [one.curve for one in self.beside(fit)[:_HINTS]]
        gains = [curve for curve in gains_over_own_rate(self._design.curves) if curve not in hints]
        share = float(np.log(UNKNOWN_ODDS / max(len(self._design.curves), 1)))
        kinds = (
            (_BENDING, fine_curves(self._problem, fit, hints)),
            (_JUMPING, step_curves(self._problem, fit, [*hints, *gains])),
        )
        more = [
            SetWithCurve(fit, curve, evidence, evidence.nats + share + float(np.log(odds)), self._form_of(fit, curve))
            for odds, found in kinds
            for curve, evidence in found
        ]
        self._found[fit.candidates] = sorted([*self.beside(fit), *more], key=lambda one: -one.nats)

    def found(self, fit: Fit) -> list[SetWithCurve]:
        """Return the curves that were asked for beside a set."""
        return self._found.get(fit.candidates, [])

    def beside(self, fit: Fit) -> list[SetWithCurve]:
        """Return the curves that may be beside a set, the likeliest first."""
        if fit.candidates not in self._found:
            self._found[fit.candidates] = sorted(self._weighed(fit), key=lambda one: -one.nats)
        return self._found[fit.candidates]

    def _weighed(self, fit: Fit) -> Sequence[SetWithCurve]:
        design, beside = self._design, fit.beside
        if design is None or not design.curves:
            return []
        columns = design.columns
        pull = columns.T @ beside.residual
        share = float(np.log(UNKNOWN_ODDS / len(design.curves)))
        shares = [(0.0, 0.0)]
        if len(beside.missed.variances):  # that equations may miss, with the log of their posterior at the fit
            gains = np.array([beside.missed.scaled(share).gain(beside.residual) for share in SHARES])
            shares = list(zip(SHARES, gains - logsumexp(gains), strict=True))
        totals, best = self._evidences(design, beside, pull, shares)
        found = []
        for curve, nats, evidence in zip(design.curves, totals, best, strict=True):
            found.append(SetWithCurve(fit, curve, evidence, nats + share - float(np.log(curve.basis.ways))))
        found.sort(key=lambda one: -one.nats)
        kept = found[: max(_HINTS, sum(one.nats > _WORTH for one in found))]
        return [replace(one, form_of=self._form_of(fit, one.curve)) for one in kept]

    def _form_of(self, fit: Fit, curve: Curve) -> frozenset[str]:
        """Return the one effect of a set that is a curve over what a curve follows, if there is one.

        Either in the way or in the turns, and but for a level, which a gain has and every curve can have.
        """
        if not fit.ids:
            return frozenset()
        columns = self._columns(curve)
        level = orthonormal(columns[:, :1] if not len(curve.basis.knots) else columns.sum(axis=1, keepdims=True))
        span = orthonormal(without(level, columns))
        signals = {name: self._signals(fit, frozenset({name})) for name in fit.ids}
        shares = {name: max(_share(span, level, part) for part in both.T) for name, both in signals.items()}
        best = max(shares, key=lambda name: shares[name])
        return frozenset({best}) if shares[best] >= _DRAWN else frozenset()

    def as_form(self, one: SetWithCurve, more: Sequence[Fit]) -> SetWithCurve:
        """Return a set with a curve, told as another form of the effects that the curve draws, if there are any.

        more: fits with more effects than the set has; one effect goes before several, the first before the others.
        """
        if one.form_of:
            return one
        beside = one.fit.beside
        free, prior = without(beside.own, self._columns(one.curve)), one.evidence.prior
        drawn = free @ np.linalg.solve(np.eye(len(prior)) + prior @ (free.T @ free), prior @ (free.T @ beside.residual))
        alike: list[tuple[frozenset[str], float]] = []
        for fit in more:
            ids = fit.ids - one.fit.ids
            signal = without(beside.own, self._signals(fit, ids).sum(axis=1))
            size = max(float(np.linalg.norm(drawn) * np.linalg.norm(signal)), 1e-12)
            alike.append((ids, float(drawn @ signal) / size))
        single = [each for each in alike if len(each[0]) == 1]
        best = max(single, key=lambda each: each[1], default=(frozenset(), 0.0))
        several = [each for each in alike if len(each[0]) > 1]
        found = next((ids for ids, share in (best, *several) if share >= ALIKE), frozenset())
        close = (ids for ids, share in single if len(found) == 1 and share >= best[1] - AS_ALIKE)
        return replace(one, form_of=found, likewise=frozenset[str]().union(*close) - found)

    def _signals(self, fit: Fit, names: frozenset[str]) -> FloatArray:
        """Return what effects of a fit do to the way, and to the turns, whitened, (rows, 2)."""
        known = self._moved.get((fit.candidates, names))
        if known is not None:
            return known
        terms = zip(fit.terms, fit.values, strict=True)
        null = np.array([t.null if t.id in names and not t.shape else value for t, value in terms])
        parts = []
        for drive in self._problem.drives:
            here, there = (self._problem.simulated(drive, settings_of(fit.terms, at)) for at in (fit.values, null))
            axes = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
            moved = ((here - there)[:, :, None] * axes).reshape(-1, 2)
            parts.append(self._problem.whitened(drive, moved))
        self._moved[fit.candidates, names] = np.concatenate(parts)
        return self._moved[fit.candidates, names]

    def _evidences(
        self, design: Design, beside: Beside, pull: FloatArray, shares: Sequence[tuple[float, float]]
    ) -> tuple[list[float], list[CurveEvidence]]:
        """Return the evidence of each curve of a design [nat], and that at its likeliest share."""
        columns = design.columns
        own = beside.own.T @ columns
        along = beside.missed.along(design.single)
        left = beside.missed.along(beside.residual)
        parts: list[list[float]] = [[] for _ in design.curves]
        kept: list[CurveEvidence] = []
        for eps, weight in shares:
            variances = eps**2 * beside.missed.variances
            scaled = along * np.sqrt(variances / (1 + variances))[:, None]
            rest = pull - scaled.T @ (left * np.sqrt(variances / (1 + variances)))
            groups: dict[int, list[int]] = {}
            for i, curve in enumerate(design.curves):
                groups.setdefault(curve.basis.size, []).append(i)
            found: dict[int, CurveEvidence] = {}
            for some in groups.values():
                grams, pulls, priors = [], [], []
                for i in some:
                    here = design.curves[i].columns
                    gram = design.grams[i] - own[:, here].T @ own[:, here] - scaled[:, here].T @ scaled[:, here]
                    grams.append(gram + _PRECISION * np.diag(np.diag(design.grams[i]) + 1e-12))
                    pulls.append(rest[here])
                    priors.append(np.stack(design.curves[i].basis.priors))
                found |= zip(some, curve_evidences(np.array(grams), np.array(pulls), np.array(priors)), strict=True)
            for i, mine in enumerate(parts):
                mine.append(found[i].nats + weight)
            if not kept or weight == max(w for _, w in shares):
                kept = [found[i] for i in range(len(parts))]
        return [float(logsumexp(mine)) for mine in parts], kept


def _share(span: FloatArray, level: FloatArray, signal: FloatArray) -> float:
    """Return the share of a signal's square that a span draws, both without a level; 0 of what is hardly more."""
    left = without(level, signal[:, None])[:, 0]
    square = float(left @ left)
    return float(np.sum((span.T @ left) ** 2)) / square if square > _NO_LEVEL * float(signal @ signal) else 0.0


def nearly_same_rates(problem: Problem, fit: Fit) -> bool:
    """Tell whether a fit moves the chair at nearly the rates of the model: else curves over them are others."""
    for drive in problem.drives:
        one, other = (replay.motion(drive, problem.model, settings) for settings in (fit.settings, ()))
        for rate in ("v", "w"):
            before, after = getattr(other, rate), getattr(one, rate)
            if np.sqrt(np.mean((after - before) ** 2)) > _SAME * np.sqrt(np.mean(before**2)) + effects.RESTS:
                return False
    return True

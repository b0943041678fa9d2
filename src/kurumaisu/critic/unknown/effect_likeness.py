# SPDX-License-Identifier: BSD-3-Clause
"""Which effect of the catalogue a curve draws: another form of a known cause is no cause outside the catalogue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.engine.catalogue import Candidate
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.unknown.curves import Curve, CurveEvidence, columns, own_span
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.step_curves import StepCurve
from kurumaisu.critic.values.policy import FORM_ERROR
from kurumaisu.types import FloatArray

_ALIKE = 0.9  # correlation of signals from which a curve draws an effect; noise alone bends a curve by as much
_CHANCE = 3.0  # [nat] that a level more and the best of many places explain of noise


class EffectLikeness:
    """How alike curves are to the effects of a fit, as both explain the drives."""

    def __init__(self, problem: Problem, best: Fit, designs: Designs) -> None:
        self._problem, self._best, self._designs = problem, best, designs
        self._signals = {name: signal_of(problem, best, name) for name in sorted(best.ids)}
        self._fits: dict[frozenset[Candidate], Fit] = {}

    def drawn(self, fit: Fit, curve: Curve, belief: CurveEvidence) -> dict[str, float]:
        """Return what this curve draws of the best fit's effects, beside another fit that lacks them.

        By effect, of which there is one at most: evidence [nat] by which the curve may be better for nothing but the
        form of the equation.
        """
        missing = self._best.ids - fit.ids
        # Of several, one may hide what another does: then a small whole has large parts.
        if len(missing) != 1 or fit.ids - self._best.ids:
            return {}
        signals = {name: self._signals[name] for name in missing}
        return self._like(signals, fit, curve, belief, self._best.log_likelihood)

    def drawn_together(self, fit: Fit, curve: Curve, belief: CurveEvidence) -> dict[str, float]:
        """Return the effects of the best fit, several, that do together what this curve draws beside a part of it.

        A free curve over the yaw rate is any law of it: for one that explains less than they do it is no news.
        """
        missing = self._best.ids - fit.ids
        if len(missing) < 2 or not fit.ids <= self._best.ids:
            return {}
        together = signal_of(self._problem, self._best, *missing)
        found = self._like({"": together}, fit, curve, belief, self._best.log_likelihood)
        return dict.fromkeys(missing, found[""]) if found else {}

    def drawn_alone(self, fit: Fit, curve: Curve, belief: CurveEvidence) -> dict[str, float]:
        """Return the one effect of the best fit that draws what this curve does, beside a fit that lacks several.

        The others may only mend its form, as a bent law does of a limit that has no corner.
        """
        missing = [one for one in self._best.candidates if one not in fit.candidates]
        if len(missing) < 2 or not fit.candidates <= self._best.candidates:
            return {}
        found: dict[str, float] = {}
        for one in sorted(missing, key=lambda one: one.id):
            alone = self._alone(fit.candidates | {one})
            found |= self._like(
                {one.id: signal_of(self._problem, alone, one.id)}, fit, curve, belief, alone.log_likelihood
            )
        strongest = max(found, key=lambda name: found[name], default="")
        return {strongest: found[strongest]} if found else {}

    def _alone(self, candidates: frozenset[Candidate]) -> Fit:
        if candidates not in self._fits:
            self._fits[candidates] = self._problem.fit_candidates(candidates, self._best.start)
        return self._fits[candidates]

    def _like(
        self, signals: dict[str, FloatArray], fit: Fit, curve: Curve, belief: CurveEvidence, likelihood: float
    ) -> dict[str, float]:
        """Return those of some effects of which a curve beside a fit draws the signals; likelihood: of them instead."""
        y, own = own_span(self._problem, fit)
        free = self._designs.columns(fit, curve)
        free = free - own @ (own.T @ free)
        spread = np.eye(free.shape[1]) + belief.prior @ (free.T @ free)
        drawn = free @ np.linalg.solve(spread, belief.prior @ (free.T @ y))
        signals = {name: signal - own @ (own.T @ signal) for name, signal in signals.items()}
        found = {
            name: 0.5 * float(FORM_ERROR**2 * signal @ signal)
            for name, signal in signals.items()
            if _correlation(drawn, signal) > _ALIKE
        }
        return self._by_no_jump(found, fit, curve, likelihood - fit.log_likelihood)

    def _by_no_jump(self, found: dict[str, float], fit: Fit, curve: Curve, already: float) -> dict[str, float]:
        """Return those effects of which a curve is drawn though it jumps; already: what they explain of it [nat].

        No other form of an equation jumps: what a jump explains beyond it, and beyond chance, is no form.
        """
        if not isinstance(curve.basis, StepCurve):
            return found
        y, own = own_span(self._problem, fit)
        free = self._designs.columns(fit, curve)
        free = free - own @ (own.T @ free)
        better = 0.5 * float(y @ free @ np.linalg.lstsq(free, y, rcond=None)[0]) - already
        return {name: nats for name, nats in found.items() if better < nats + _CHANCE}

    def mended(self, fit: Fit, curve: Curve) -> dict[str, float]:
        """Return the effect of a fit of which a curve beside it may be what its equation lacks, as drawn does.

        One that is a curve over what it follows: it could draw all that the effect does. Of several, which hide one
        another, none.
        """
        if not self._best.ids <= fit.ids:
            return {}
        own = _span(self._finer(fit, curve))
        signals = {name: signal_of(self._problem, fit, name) for name in sorted(self._best.ids)}
        found = {
            name: 0.5 * float(FORM_ERROR**2 * signal @ signal)
            for name, signal in signals.items()
            if _norm(own.T @ signal) > _ALIKE * _norm(signal)
        }
        return self._by_no_jump(found, fit, curve, 0.0) if len(found) == 1 else {}

    def _finer(self, fit: Fit, curve: Curve) -> FloatArray:
        return columns(self._problem, fit.settings, [replace(curve, basis=curve.basis.finer())])

    def part_of(self, fit: Fit, curve: Curve) -> set[str]:
        """Return the effects of a fit that are themselves curves over what a curve beside them follows.

        How many knots it has is our choice: what they lack for a step, a gain and a dead zone supply, though neither
        acts.
        """
        if not fit.ids:
            return set()
        free = self._finer(fit, curve)
        rate = effects.CHANNELS[curve.channel].rate
        # A curve of factors may be one about another gain than 1, but for one over the rate itself: it holds the gain.
        if rate not in (curve.channel, curve.basis.covariate.removeprefix("abs_")):
            level = free[:, :1] if not len(curve.basis.knots) else free.sum(axis=1, keepdims=True)
            level = level / np.linalg.norm(level)
            free = free - level @ (level.T @ free)
        own = _span(free)
        signals = {name: signal_of(self._problem, fit, name) for name in sorted(fit.ids)}
        return {name for name, signal in signals.items() if _norm(own.T @ signal) > _ALIKE * _norm(signal)}


def signal_of(problem: Problem, fit: Fit, *names: str) -> FloatArray:
    """Return what effects of a fit do together, whitened."""
    null = np.array(
        [
            term.null if term.id in names and not term.shape else value
            for term, value in zip(fit.terms, fit.values, strict=True)
        ]
    )
    return problem.residual(fit.terms, null) - problem.residual(fit.terms, fit.values)


def _span(free: FloatArray) -> FloatArray:
    """Return orthonormal columns that span some."""
    left, sizes, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(left[:, sizes > 1e-6 * max(sizes[0], 1e-12)])


def _correlation(one: FloatArray, other: FloatArray) -> float:
    norms = _norm(one) * _norm(other)
    return float(one @ other) / norms if norms else 0.0


def _norm(values: FloatArray) -> float:
    return float(np.linalg.norm(values))

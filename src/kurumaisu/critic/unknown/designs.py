# SPDX-License-Identifier: BSD-3-Clause
"""Curves about the fit that they are tried beside: what follows a rate is another curve where the rate is another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.unknown.curves import Curve, Design, columns
from kurumaisu.types import FloatArray

# Share of the rates by which another fit may differ. Effects that make up for each other, such as a gain of -0.6 and a
# dead zone, leave rates over which no step of the true ones is a step.
_NEAR = 0.1
_RESTS = 0.02  # share of the time in which the chair may rest by one and not by the other: curves act while it moves


class Designs:
    """The curves of a problem, about the best set, and about others that make much of the rates."""

    def __init__(self, problem: Problem, best: Fit) -> None:
        self._problem = problem
        rates = self._rates(best)
        self._made = [(rates, Design(problem, best.settings))]
        self._of = {best.candidates: self._made[0][1]}
        self._ways = {best.candidates: _way(rates)}

    def about(self, fit: Fit) -> Design:
        """Return the design about a fit, or about another one that has nearly the same rates."""
        if fit.candidates not in self._of:
            rates = self._rates(fit)
            self._ways[fit.candidates] = _way(rates)
            near = [design for other, design in self._made if _near(rates, other)]
            if not near:
                near = [Design(self._problem, fit.settings)]
                self._made.append((rates, near[0]))
            self._of[fit.candidates] = near[0]
        return self._of[fit.candidates]

    def paced(self, fit: Fit, curve: Curve) -> Curve:
        """Return a curve of the design about a fit as it is beside that very fit.

        Waves over the distance come as often by another one, which makes more or less of the way.
        """
        if curve.basis.covariate != "distance":
            return curve
        design = self.about(fit)
        here, there = self._ways[fit.candidates], next(_way(rates) for rates, made in self._made if made is design)
        if here == there:
            return curve
        constants = {name: period * here / there for name, period in curve.basis.constants.items()}
        return replace(curve, basis=replace(curve.basis, constants=constants))

    def columns(self, fit: Fit, curve: Curve) -> FloatArray:
        """Return the whitened columns of a curve beside a fit, (rows, k)."""
        design = self.about(fit)
        if any(curve is one for one in design.curves):
            return design.columns[:, curve.columns]
        return columns(self._problem, fit.settings, [curve])

    def _rates(self, fit: Fit) -> FloatArray:
        """Return v and w of all drives, (2, n)."""
        motions = [replay.motion(drive, self._problem.model, fit.settings) for drive in self._problem.drives]
        return np.concatenate([np.stack([motion.v, motion.w]) for motion in motions], axis=1)


def _way(rates: FloatArray) -> float:
    return float(np.abs(rates[0]).sum())


def _near(one: FloatArray, other: FloatArray) -> bool:
    apart, size = (np.sqrt(np.mean(rates**2, axis=1)) for rates in (one - other, other))
    moves, moved = ((np.abs(rates) > effects.RESTS).any(axis=0) for rates in (one, other))
    return bool(np.all(apart <= _NEAR * size) and np.mean(moves != moved) <= _RESTS)

# SPDX-License-Identifier: BSD-3-Clause
"""Curves over what is known of a beam along which readings scatter more or less: what is in no catalogue.

The log of the noise follows the curve. So the squares of what is left, as shares of those that simulations have, follow
twice the curve; their sums over its hats are normal, with the spread that the simulations' own sums have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.ranges.signals.coefficient_blocks import covariates
from kurumaisu.critic.scatter.simulation import ScatterSimulator
from kurumaisu.critic.scatter.statistics import Statistics
from kurumaisu.critic.unknown.bases import Basis, knots_of, priors_of
from kurumaisu.critic.unknown.curves import curve_evidence
from kurumaisu.critic.values.policy import UNKNOWN_ODDS
from kurumaisu.params import EffectSetting
from kurumaisu.types import BoolArray, FloatArray

_LAWS = ("range", "incidence")  # what equations of the noise follow: a curve over these is another form of one
_LAW = 0.5  # sd of the log of a square by which such an equation may be off
_HATS = 10
_EVENTS = {"time": 40}  # what comes and goes bends more often
_SEEDS = range(2000, 2030)  # simulations that say what squares are to be expected, and how far sums are off by chance
_ENOUGH = 5.0  # [nat] from which a curve is told, as an effect on the scatter is
_MATTERS = 0.1  # share of the noise by which it must make it differ
_ROUNDS = 2  # steps of a fit
_LEAST = 0.05  # of the mean square that is expected anywhere


@dataclass(frozen=True)
class ScatterCurve:
    """A curve: coefficients (m,) of the log of the noise with their covariance (m, m), log evidence and posterior.

    prior (m, m): of twice the coefficients, which are those of the log of the squares.
    """

    basis: Basis
    coefficients: FloatArray
    covariance: FloatArray
    prior: FloatArray
    nats: float
    p: float

    @property
    def setting(self) -> EffectSetting:
        """Return it as a model file has it."""
        id_ = effects.smooth_scatter_id(self.basis.covariate)
        return EffectSetting(id_, self.basis.parameters(self.coefficients))


Squares = tuple[FloatArray, BoolArray]  # (..., n) of the readings that may count, 0 where they do not; and which do
Pull = tuple[FloatArray, FloatArray]  # (m, m), (m,) what speaks for twice a curve's coefficients, laws left free


class ScatterCurves:
    """Curves of some shots."""

    def __init__(
        self, assembly: Assembly, statistics: Statistics, simulate: ScatterSimulator, error: FloatArray
    ) -> None:
        """Take shots; error (k, b) [m]: of their readings, off the mean."""
        self._statistics, self._simulate = statistics, simulate
        self._trust = assembly.geometry
        self._measured = self._squares(assembly.shots.measured, error)
        known = dict(self._hats(covariates(assembly.shots, assembly.marks.seen)))
        level = np.ones((int(self._trust.sum()), 1))
        self._laws = np.column_stack([level, *(known[name][1] for name in _LAWS if name in known)])
        self._curves = {name: each for name, each in known.items() if name not in _LAWS}

    def run(self, beside: Sequence[EffectSetting]) -> list[ScatterCurve]:
        """Return the curve that acts beside effects, and the others behind it; none where there is too little."""
        if not self._measured[1].any():
            return []
        simulated = self._simulated(beside)
        found = [self._weighed(name, simulated) for name in self._curves]
        total = logsumexp([0.0, *(one.nats for one in found)])
        found = [replace(one, p=float(np.exp(one.nats - total))) for one in sorted(found, key=lambda one: -one.nats)]
        if not found or found[0].nats < _ENOUGH:
            return []
        best = self._refined(found[0], beside, self._laws)
        _, hats = self._curves[best.basis.covariate]
        low, high = np.quantile(hats @ best.coefficients, [0.025, 0.975])
        return [best, *found[1:]] if high - low >= _MATTERS else []

    def alone(self, one: ScatterCurve, beside: Sequence[EffectSetting]) -> ScatterCurve:
        """Return a curve fitted beside effects with all that these leave, its level and what laws might have."""
        level = np.ones(len(one.coefficients))
        free = replace(one, prior=one.prior + _LAW**2 * np.outer(level, level))
        for _ in range(_ROUNDS):
            free = self._refined(free, beside, self._laws[:, :0])
        return free

    def _hats(self, at: Mapping[str, FloatArray]) -> Sequence[tuple[str, tuple[Basis, FloatArray]]]:
        """Return the curves over what varies, and their hats (n, m)."""
        out = []
        for name, values in at.items():
            own = values[self._trust]
            knots = knots_of(own, _EVENTS.get(name, _HATS)) if np.isfinite(own).all() else np.empty(0)
            if len(knots) < 3:
                continue
            low, high = np.quantile(own, [0.025, 0.975]).tolist()
            bare = Basis(name, knots, {}, (), low, high)
            hats = bare.matrix(own)
            out.append((name, (replace(bare, priors=tuple(priors_of(knots, hats))), hats)))
        return out

    def _squares(self, readings: FloatArray, error: FloatArray) -> Squares:
        values, counted = self._statistics.squares(readings, error)
        return np.where(counted, values, 0.0)[self._trust], counted[self._trust]

    def _simulated(self, settings: Sequence[EffectSetting]) -> Squares:
        each = [self._squares(*self._simulate.scans(settings, seed)) for seed in _SEEDS]
        return np.array([values for values, _ in each]), np.array([counted for _, counted in each])

    def _weighed(self, name: str, simulated: Squares) -> ScatterCurve:
        basis, _ = self._curves[name]
        speaks = self._pull(name, simulated, self._laws)
        evidence = curve_evidence(*speaks, basis.priors)
        nats = evidence.nats + float(np.log(UNKNOWN_ODDS / len(self._curves)))
        return _stepped(ScatterCurve(basis, np.zeros(basis.size), evidence.prior, evidence.prior, nats, 0.0), speaks)

    def _refined(self, one: ScatterCurve, beside: Sequence[EffectSetting], laws: FloatArray) -> ScatterCurve:
        """Return a curve after another step: beside other noise its own has to be larger."""
        simulated = self._simulated([*beside, one.setting])
        return _stepped(one, self._pull(one.basis.covariate, simulated, laws))

    def _pull(self, name: str, simulated: Squares, laws: FloatArray) -> Pull:
        """Return what the squares say of a curve, beyond those of simulations; laws (n, l): what is left free."""
        (measured, known), (values, counted), (_, hats) = self._measured, simulated, self._curves[name]
        columns = np.column_stack([laws, hats])
        number = np.maximum(counted.sum(axis=0), 1)
        mean, weight = values.sum(axis=0) / number, np.sqrt(counted.mean(axis=0))
        fit = np.linalg.lstsq(columns * weight[:, np.newaxis], mean * weight, rcond=1e-9)[0]
        expected = np.maximum(columns @ fit, _LEAST * float(mean.mean()))
        drawn = np.where(counted, values / expected - 1, 0.0)
        seen = np.where(known, measured / expected - 1, 0.0)
        chance = float(np.sum(drawn**2) / max(int(counted.sum()), 1))
        gram = columns.T @ (columns * known[:, np.newaxis]) / chance
        pulls = np.vstack([seen - drawn.mean(axis=0), drawn - drawn.mean(axis=0)]) @ columns / chance
        free, own = slice(None, laws.shape[1]), slice(laws.shape[1], None)
        shares = np.linalg.solve(gram[free, free] + np.eye(laws.shape[1]) / _LAW**2, gram[free, own])
        gram, pulls = gram[own, own] - gram[own, free] @ shares, pulls[:, own] - pulls[:, free] @ shares
        sizes, axes = np.linalg.eigh(gram)
        use = sizes > 1e-3 * sizes[-1]
        count = len(_SEEDS)
        along = (pulls[1:] @ axes[:, use]) ** 2 / sizes[use] * count / (count - 1)
        loud = max(float(along.mean()), 1.0) * (1 + 1 / count)
        return gram / loud, pulls[0] / loud


def _stepped(one: ScatterCurve, speaks: Pull) -> ScatterCurve:
    """Return a curve moved to where the squares beyond those with it, and its prior, draw it."""
    gram, pull = speaks
    twice, inner = 2 * one.coefficients, np.eye(one.basis.size) + one.prior @ gram
    twice = twice + np.linalg.solve(inner, one.prior @ pull - twice)
    return replace(one, coefficients=twice / 2, covariance=np.linalg.solve(inner, one.prior) / 4)

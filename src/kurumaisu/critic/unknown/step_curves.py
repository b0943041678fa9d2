# SPDX-License-Identifier: BSD-3-Clause
"""Curves that jump: what a rate does up to some value of what it follows, it does not beyond.

Eight knots cannot draw a jump, so an effect of the catalogue that has a corner near by would win. A jump's place may be
anywhere, and that is paid: the evidence is the mean over all places.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu.critic.base import replay
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.curves import Curve, CurveEvidence, columns, curve_evidence, curve_evidences
from kurumaisu.types import FloatArray

_PLACES = 24  # with as many samples between them
_FINER = 9  # between the neighbours of the best one, and once more between those of the best of these
_WIDTH = 1e-3  # share of the covariate's span within which a jump is made: a model file has no steeper curve
_SEEN = 1e-4  # share of the signal's square on either side, at least: of what rolls out to nothing, nothing is known
_BETWEEN = 20  # places between two, for the interval
# Before the data: nothing below the place, nothing beyond it, or something on either side.
_PRIORS = (np.diag([0.0, 1.0]), np.diag([1.0, 0.0]), np.eye(2))


@dataclass(frozen=True)
class StepCurve(Basis):
    """Two levels with a jump between them; the knots are its two sides.

    place: of the jump, with its 90 % interval, (3,).
    """

    place: FloatArray = field(kw_only=True)


@dataclass(frozen=True)
class _Sides(Basis):
    """One, and what is one beyond each of the knots."""

    @property
    def size(self) -> int:
        """Return the number of columns."""
        return 1 + len(self.knots)

    def matrix(self, at: FloatArray) -> FloatArray:
        """Return the columns at values of the covariate (n,), (n, 1 + places)."""
        return np.column_stack([np.ones(len(at)), at[:, None] > self.knots])


@dataclass
class _StepPlaces:
    """Places of a jump of one curve, what each explains and how likely it is beforehand, both in nats."""

    curve: Curve
    places: FloatArray
    prior: float
    nats: list[FloatArray] = field(default_factory=list)
    at: list[FloatArray] = field(default_factory=list)
    shares: list[float] = field(default_factory=list)
    priors: list[FloatArray] = field(default_factory=list)

    def add(self, gram: FloatArray, b: FloatArray) -> None:
        """Weigh the places by normal equations of a column of ones and one for each, and choose closer ones."""
        # Of what is below and beyond each place.
        whole, beyond, both = gram[0, 0], np.diag(gram)[1:], gram[0, 1:]
        cross = both - beyond
        grams = np.array([[whole - 2 * both + beyond, cross], [cross, beyond]]).transpose(2, 0, 1)
        pulls = np.column_stack([b[0] - b[1:], b[1:]])
        found = curve_evidences(grams, pulls, np.repeat(np.stack(_PRIORS)[None], len(grams), axis=0))
        seen = np.einsum("nii->ni", grams).min(axis=1) > _SEEN * gram[0, 0]
        nats = np.where(seen, [belief.nats for belief in found], -np.inf)
        best = int(np.argmax(nats))
        self.nats.append(nats)
        self.at.append(self.places)
        self.shares.append(self.prior)
        self.priors.append(found[best].prior)
        low, high = self.places[max(best - 1, 0)], self.places[min(best + 1, len(nats) - 1)]
        self.prior += float(np.log((1 + (0 < best < len(nats) - 1)) / len(nats)))
        self.places = np.linspace(low, high, _FINER + 2)[1:-1]

    def rival(self) -> tuple[Curve, CurveEvidence]:
        """Return the curve with a jump at the best place, and its evidence, whatever the place."""
        level = int(np.argmax([nats.max() for nats in self.nats]))
        total = max(
            float(logsumexp(nats)) - np.log(len(nats)) + prior
            for nats, prior in zip(self.nats, self.shares, strict=True)
        )
        place = self.at[level][int(np.argmax(self.nats[level]))]
        basis = self.curve.basis
        half = _WIDTH / 2 * (basis.high - basis.low)
        low, high = self._interval()
        jump = StepCurve(
            basis.covariate,
            np.array([place - half, place + half]),
            basis.constants,
            _PRIORS,
            basis.low,
            basis.high,
            place=np.array([place, min(low, place), max(high, place)]),
        )
        return replace(self.curve, basis=jump, columns=slice(0, 2)), CurveEvidence(total, self.priors[level])

    def _interval(self) -> FloatArray:
        """Return the 90 % interval of the place: the log likelihood is taken to be straight between the places."""
        at, nats = np.concatenate(self.at), np.concatenate(self.nats)
        order = np.argsort(at)[np.isfinite(nats[np.argsort(at)])]
        at, nats = at[order], nats[order]
        close = np.interp(np.arange(_BETWEEN * (len(at) - 1) + 1) / _BETWEEN, np.arange(len(at)), at)
        weights = np.exp(np.interp(close, at, nats) - nats.max()) * np.gradient(close) if len(at) > 1 else np.ones(1)
        return np.interp(np.array([0.05, 0.95]) * weights.sum(), np.cumsum(weights), close)


def gains_over_own_rate(curves: Iterable[Curve]) -> Iterator[Curve]:
    """Yield curves of the factors of a rate over that rate itself: gears, and wheels that slip from a speed on.

    Without a jump they would be the sum of a rate and a curve again.
    """
    for curve in curves:
        if curve.channel == curve.basis.covariate.removeprefix("abs_"):
            yield replace(curve, channel=f"{curve.channel}_gain")


def step_curves(problem: Problem, fit: Fit, curves: Sequence[Curve]) -> Iterator[tuple[Curve, CurveEvidence]]:
    """Yield, for each of the curves beside a fit that has knots, the one that jumps instead, and what it explains."""
    tried = list(_first(problem, fit, curves))
    for _ in range(3):
        sides = [
            replace(one.curve, basis=_Sides(one.curve.basis.covariate, one.places, one.curve.basis.constants, (), 0, 0))
            for one in tried
        ]
        for one, normal in zip(tried, _beside(problem, fit, sides), strict=True):
            one.add(*normal)
    yield from (one.rival() for one in tried if np.isfinite(one.nats[0]).any())


def _first(problem: Problem, fit: Fit, curves: Sequence[Curve]) -> Iterator[_StepPlaces]:
    motions = [replay.motion(drive, problem.model, fit.settings) for drive in problem.drives]
    moving = [motion.moving for motion in motions]
    for curve in curves:
        if len(curve.basis.knots) < 2:
            continue
        values = np.concatenate([curve.basis.samples(m)[moved] for m, moved in zip(motions, moving, strict=True)])
        finite = values[np.isfinite(values)]  # none where beside these effects the chair never rests, say
        known = np.unique(np.quantile(finite, np.linspace(0.0, 1.0, _PLACES + 1))) if len(finite) else finite
        if len(known) > 1:  # between values that were driven: at one of them it is not known which side it is on
            yield _StepPlaces(curve, (known[1:] + known[:-1]) / 2, 0.0)


def fine_curves(problem: Problem, fit: Fit, curves: Sequence[Curve]) -> Iterator[tuple[Curve, CurveEvidence]]:
    """Yield, for each of the curves beside a fit that can bend, the one that does so more often, and its evidence.

    Eight knots draw a narrow gust badly, four waves a flat spot of a wheel. What they leave passes for noise that
    wanders or grows, or for an effect beside the curve.
    """
    motions = [replay.motion(drive, problem.model, fit.settings) for drive in problem.drives]
    fine = [(curve, curve.basis.fine(motions)) for curve in curves if curve.basis.size > 1]
    finer = [replace(curve, basis=basis) for curve, basis in fine if basis is not None]
    for curve, (gram, pull) in zip(finer, _beside(problem, fit, finer), strict=True):
        found = curve_evidence(gram, pull, curve.basis.priors)
        nats = found.nats - float(np.log(curve.basis.ways))
        yield replace(curve, columns=slice(0, curve.basis.size)), replace(found, nats=nats)


def _beside(problem: Problem, fit: Fit, curves: Sequence[Curve]) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the normal equations of each curve beside a fit, (k, k) and (k,)."""
    y = fit.beside.covariance.whiten(fit.beside.residual)
    free = fit.beside.white(columns(problem, fit.settings, curves))
    for curve, end in zip(curves, np.cumsum([curve.basis.size for curve in curves]), strict=True):
        part = free[:, end - curve.basis.size : end]
        yield part.T @ part, part.T @ y

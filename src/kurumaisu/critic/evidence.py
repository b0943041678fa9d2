# SPDX-License-Identifier: BSD-3-Clause
"""Evidence for sets of effects: whitened residuals, their columns, nonlinear refits, Occam factors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import least_squares
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic import replay
from kurumaisu.critic.drive import Drive
from kurumaisu.critic.noise import Noise, whitened
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

# Amplitude prior of an effect: log-uniform in z, the whitened norm of its signal, on both sides. Below 3 nobody
# can see it; with a broad Gaussian instead, "none" is over-confident.
_Z_LOW, _Z_HIGH = 3.0, 3000.0
_STEP = 0.2  # finite differences, in units of a parameter's scale


@dataclass(frozen=True)
class Term:
    """One parameter of one effect as the critic may fit it; null: its value in the model criticised."""

    id: str
    parameter: Parameter
    null: float


@dataclass(frozen=True)
class Fit:
    """A set of effects, fitted.

    values and sds per term of the set; log_likelihood relative to any other fit of the same problem;
    score: log evidence, that is log_likelihood less the Occam factors.
    """

    ids: frozenset[str]
    terms: tuple[Term, ...]
    values: FloatArray
    sds: FloatArray
    log_likelihood: float
    score: float

    @property
    def settings(self) -> tuple[EffectSetting, ...]:
        """Return the effects as a model file has them."""
        return settings_of(self.terms, self.values)


def catalogue(model: Model, ids: frozenset[str] | None = None) -> tuple[Term, ...]:
    """Return a term for every parameter of every effect that changes the mean motion; ids: of these effects only."""
    own = {setting.id: setting.parameters for setting in model.effects}
    return tuple(
        Term(effect.id, parameter, own.get(effect.id, {}).get(parameter.name, parameter.null))
        for effect in effects.CRITICISED
        if not effect.random and (ids is None or effect.id in ids)
        for parameter in effect.parameters
    )


class Problem:
    """Drives, model, noise, and which effects may act (ids; None for all): everything but which of them do."""

    def __init__(self, drives: Sequence[Drive], model: Model, noise: Noise, ids: frozenset[str] | None = None) -> None:
        self.drives = drives
        self.model = model
        self.noise = noise
        self.terms = catalogue(model, ids)

    def of(self, ids: Iterable[str]) -> tuple[Term, ...]:
        """Return the terms of effects in the catalogue's order."""
        chosen = set(ids)
        return tuple(term for term in self.terms if term.id in chosen)

    def simulated(self, drive: Drive, settings: Sequence[EffectSetting]) -> FloatArray:
        """Return the simulated body increments of a drive, (m, 3)."""
        return replay.increments(drive, self.model, settings)

    def simulated_columns(self, drive: Drive, fit: Fit) -> FloatArray:
        """Return the derivative of the simulated increments by every term at a fit, per scale, (3 m, k)."""
        here = self.simulated(drive, fit.settings)
        moved = [
            (self.simulated(drive, settings), step) for settings, step in self._moves(fit.terms, fit.values, self.terms)
        ]
        return np.column_stack([(increments - here).ravel() / step for increments, step in moved])

    def residual(self, terms: Sequence[Term], values: FloatArray) -> FloatArray:
        """Return the whitened residual with these parameters, (rows,)."""
        settings = settings_of(terms, values)
        return np.concatenate([self._whitened(drive, settings) for drive in self.drives])

    def columns(self, terms: Sequence[Term], values: FloatArray, of: Sequence[Term]) -> FloatArray:
        """Return minus the derivative of the residual by each term of `of` at a fit, per scale, (rows, k)."""
        here = self.residual(terms, values)
        out = np.empty((len(here), len(of)))
        for j, (settings, step) in enumerate(self._moves(terms, values, of)):
            moved = np.concatenate([self._whitened(drive, settings) for drive in self.drives])
            out[:, j] = (here - moved) / step
        return out

    def fit(self, ids: Iterable[str], start: dict[str, float]) -> Fit:
        """Return the nonlinear fit of a set of effects; start: a first guess per id, else half a scale off null."""
        terms = self.of(ids)
        if not terms:
            y = self.residual((), np.empty(0))
            likelihood = -0.5 * float(y @ y)
            return Fit(frozenset(), (), np.empty(0), np.empty(0), likelihood, likelihood)
        lower = np.array([term.parameter.lower for term in terms])
        upper = np.array([term.parameter.upper for term in terms])
        scale = np.array([term.parameter.scale for term in terms])
        guess = [start.get(term.id, term.null + 0.5 * term.parameter.scale) for term in terms]
        solution = least_squares(
            lambda values: self.residual(terms, values),
            np.clip(guess, lower + 0.01 * scale, upper - 0.01 * scale),
            bounds=(lower, upper),
            x_scale=scale,
            diff_step=1e-3,
            max_nfev=30,
            ftol=1e-5,
            xtol=1e-5,
        )
        # The solver's own steps are too small for a delay between samples of the grid: differentiate once more.
        slopes = self.columns(terms, solution.x, terms)
        sds = np.sqrt(np.diag(covariance(slopes.T @ slopes))) * scale
        likelihood = -float(solution.cost)
        z = np.abs(solution.x - [term.null for term in terms]) / sds
        return Fit(frozenset(ids), terms, solution.x, sds, likelihood, likelihood - float(occam(z).sum()))

    def _moves(
        self, terms: Sequence[Term], values: FloatArray, of: Sequence[Term]
    ) -> Iterator[tuple[tuple[EffectSetting, ...], float]]:
        """Yield, for each term of `of`, the fit's settings with that term moved, and the step in units of its scale."""
        known = {(term.id, term.parameter.name): i for i, term in enumerate(terms)}
        for term in of:
            i = known.get((term.id, term.parameter.name))
            at = term.null if i is None else float(values[i])
            step = _STEP if at + _STEP * term.parameter.scale <= term.parameter.upper else -_STEP
            moved = at + step * term.parameter.scale
            if i is None:
                yield settings_of((*terms, term), np.append(values, moved)), step
            else:
                yield settings_of(terms, np.where(np.arange(len(values)) == i, moved, values)), step

    def _whitened(self, drive: Drive, settings: tuple[EffectSetting, ...]) -> FloatArray:
        residual = drive.measured - self.simulated(drive, settings)
        return whitened(drive, residual.reshape(-1, 1), self.noise)[0][:, 0]


def covariance(gram: FloatArray) -> FloatArray:
    """Return the covariance of parameters, in units of their scales, for G = J'J with columns per scale.

    A weak prior of 100 scales keeps it finite where the data do not determine a parameter at all.
    """
    return np.asarray(np.linalg.inv(gram + 1e-4 * np.eye(len(gram))))


def occam(z: FloatArray) -> FloatArray:
    """Return what a term that lies |z| standard deviations from its null costs, in nats, elementwise.

    z^2 / 2 less the log of the Bayes factor that the amplitude prior gives.
    """
    grid, costs = _occam_table()
    return np.asarray(np.interp(np.abs(z), grid, costs))


@cache
def _occam_table() -> tuple[FloatArray, FloatArray]:
    log_x = np.linspace(np.log(_Z_LOW), np.log(_Z_HIGH), 40001)
    x = np.exp(log_x)
    log_weight = np.log(log_x[1] - log_x[0]) - np.log(2 * np.log(_Z_HIGH / _Z_LOW))
    grid = np.concatenate([np.linspace(0, 20, 201), np.geomspace(21, 0.99 * _Z_HIGH, 100)])
    costs = [-logsumexp(np.logaddexp(-0.5 * (z - x) ** 2, -0.5 * (z + x) ** 2) + log_weight) for z in grid]
    return grid, np.array(costs)


def settings_of(terms: Sequence[Term], values: FloatArray) -> tuple[EffectSetting, ...]:
    """Return the effects of fitted terms as a model file has them."""
    by_id: dict[str, dict[str, float]] = {}
    for term, value in zip(terms, values, strict=True):
        by_id.setdefault(term.id, {})[term.parameter.name] = float(value)
    return tuple(EffectSetting(name, parameters) for name, parameters in by_id.items())

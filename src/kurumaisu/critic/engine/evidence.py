# SPDX-License-Identifier: BSD-3-Clause
"""Evidence for sets of effects: whitened residuals, their columns, nonlinear refits, Occam factors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu._core import Whitener
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.base.sensitivity import free_columns
from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import (
    Candidate,
    Key,
    Term,
    candidates,
    catalogue,
    roughened,
    settings_of,
    showing,
)
from kurumaisu.critic.engine.covariance import Covariance, orthonormal, without
from kurumaisu.critic.engine.form_error import SHARES, form_errors, smooth_functions
from kurumaisu.critic.engine.set_cost import alike, proportion, step_cost
from kurumaisu.critic.engine.step_likelihood import StartValues, Walked
from kurumaisu.critic.noise.base_noise import Noise, turned, whitener
from kurumaisu.critic.values.policy import Z_USUAL, log_prior, occam, occam_plane
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_DERIVATIVE = 0.25  # finite differences about a fit, in units of a term's step
_ROUGH_WAYS = float(np.log(16))  # [nat] for having been tried over its whole range, with many peaks
_ROUGH_DERIVATIVE = 1e-4  # the same of what has many likely values: right between its peaks
_AT_WILL = float(np.log(2.0))  # [nat] of a size beyond some, which every other one is
_LARGER = 0.5  # by this share such sizes are made larger, to see it


@dataclass(frozen=True)
class Beside:
    """What is beside a fit: its residual (rows,), a basis of what its sizes do (rows, n), and what its equations miss.

    missed: with a share of 1; share: the likeliest; nats: how much likelier the data are with it than without; forms:
    the same of each cause alone, at that share.
    """

    residual: FloatArray
    own: FloatArray
    missed: Covariance
    share: float
    nats: float
    forms: dict[str, float]

    def white(self, columns: FloatArray) -> FloatArray:
        """Return columns (rows, k), or a residual, whitened, without what the sizes do and what equations may miss."""
        return self.covariance.whiten(without(self.own, columns))

    @cached_property
    def covariance(self) -> Covariance:
        """Return the noise with what the equations miss at the likeliest share."""
        return self.missed.scaled(self.share)


@dataclass(frozen=True)
class Fit:
    """A set of effects, fitted.

    candidates: the way in which each acts; values and sds per term of the set; settings: the effects as a model file
    has them; log_likelihood relative to any other fit of the same problem; score: log evidence, that is
    log_likelihood less the Occam factors.
    """

    candidates: frozenset[Candidate]
    terms: tuple[Term, ...]
    values: FloatArray
    sds: FloatArray
    settings: tuple[EffectSetting, ...]
    log_likelihood: float
    score: float
    beside: Beside

    @property
    def ids(self) -> frozenset[str]:
        """Return the effects."""
        return frozenset(candidate.id for candidate in self.candidates)

    @property
    def sizes(self) -> int:
        """Return how many values were fitted."""
        return sum(not term.fixed for term in self.terms)

    @property
    def start(self) -> dict[Key, float]:
        """Return the values by term, from which another fit may start."""
        return {term.key: float(value) for term, value in zip(self.terms, self.values, strict=True)}


def log_posterior(fit: Fit, of: int) -> float:
    """Return the log posterior [nat] of a set, not normalised, among sets of so many effects that could show."""
    return fit.score + log_prior(len(fit.candidates), of)


class Problem:
    """Drives, model and noise: everything but the choice of effects."""

    def __init__(
        self,
        drives: Sequence[Drive],
        model: Model,
        noise: Noise,
        terms: tuple[Term, ...] | None = None,
        ids: frozenset[str] | None = None,
        known: replay.Increments | None = None,
    ) -> None:
        """Take terms: those that such drives can show, where somebody has found them out; ids: effects that may act.

        known: of the same model.
        """
        self.drives = drives
        self.model = model
        self.noise = noise
        self._terms = terms
        self.ids = ids
        self._known = known or replay.Increments(model)
        self._smooth: dict[int, tuple[Drive, FloatArray]] = {}
        self._whiteners: dict[int, tuple[Drive, Whitener, Covariance]] = {}
        self._walked: Walked = {}

    def changed(
        self,
        *,
        drives: Sequence[Drive] | None = None,
        model: Model | None = None,
        noise: Noise | None = None,
    ) -> Problem:
        """Return the problem, with the same terms, of other drives, another model or noise."""
        known = None if model is not None else self._known
        new = drives or self.drives, model or self.model, noise or self.noise
        other = Problem(*new, self.terms, self.ids, known)
        if drives is None:
            other._walked = self._walked
        return other

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Return the terms that these drives can show."""
        if self._terms is not None:
            return self._terms
        here = self.residual((), np.empty(0))

        def moved(settings: tuple[EffectSetting, ...]) -> FloatArray:
            return np.concatenate([self._whitened(drive, settings) for drive in self.drives]) - here

        shown = showing(catalogue(self.model, self.ids), lambda settings: float(np.linalg.norm(moved(settings))))
        return tuple(roughened(shown, moved))

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Return the ways in which effects may act that these drives can show."""
        return candidates(self.terms, self.model, self.ids)

    def simulated(self, drive: Drive, settings: Sequence[EffectSetting]) -> FloatArray:
        """Return the simulated body increments of a drive, (m, 3)."""
        return self._known.of(drive, settings)

    def simulated_columns(self, drive: Drive, fit: Fit) -> FloatArray:
        """Return the derivative of the simulated increments by every term at a fit, per step, (3 m, k)."""
        here = self.simulated(drive, fit.settings)
        moves = self._moves(fit.terms, fit.values, self.terms)
        return np.column_stack([(self.simulated(drive, settings) - here).ravel() / share for settings, share in moves])

    def residual(self, terms: Sequence[Term], values: FloatArray) -> FloatArray:
        """Return the whitened residual with these parameters, (rows,)."""
        return np.concatenate(self.residuals(terms, values))

    def residuals(self, terms: Sequence[Term], values: FloatArray) -> list[FloatArray]:
        """Return the whitened residual of each drive, (rows,) each."""
        settings = settings_of(terms, values)
        return [self._whitened(drive, settings) for drive in self.drives]

    def columns(self, terms: Sequence[Term], values: FloatArray, of: Sequence[Term]) -> FloatArray:
        """Return minus the derivative of the residual by each term of `of` at a fit, per step, (rows, k)."""
        return self.linearised(terms, values, of)[1]

    def linearised(
        self, terms: Sequence[Term], values: FloatArray, of: Sequence[Term]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the whitened residual (rows,) at a fit and minus its derivative by each term of `of`, per step."""
        here, moves = settings_of(terms, values), list(self._moves(terms, values, of))
        parts = []
        for drive in self.drives:
            simulated = self.simulated(drive, here)
            rows = [(drive.measured - simulated).ravel()]
            rows += [(self.simulated(drive, settings) - simulated).ravel() / share for settings, share in moves]
            parts.append(self.whitened(drive, np.column_stack(rows)))
        both = np.concatenate(parts)
        return both[:, 0], both[:, 1:]

    def whitened(self, drive: Drive, columns: FloatArray) -> FloatArray:
        """Return columns (3 m, k) of one of the drives, whitened.

        The reference's heading may be off throughout a drive: that is noise, too. So is what a drive does in moments
        that are free.
        """
        if id(drive) not in self._whiteners:
            white = whitener(drive, self.noise)
            wandering = min(self.noise.wander, self.noise.heading_sd * self.noise.louder)
            nuisance = np.column_stack([wandering * turned(drive), free_columns(drive, self.model)])
            self._whiteners[id(drive)] = drive, white, Covariance(white.whiten(nuisance))
        _, white, lasting = self._whiteners[id(drive)]
        return lasting.whiten(white.whiten(columns))

    def smooth(self, drive: Drive) -> FloatArray:
        """Return the functions of one of the drives over which forms may differ, (m, k)."""
        if id(drive) not in self._smooth:
            self._smooth[id(drive)] = drive, smooth_functions(drive)
        return self._smooth[id(drive)][1]

    def fit(self, ids: Iterable[str], start: Mapping[Key, float]) -> Fit:
        """Return the nonlinear fit of a set of effects with all their parameters; start: a first guess by term."""
        chosen = set(ids)
        whole: dict[str, Candidate] = {}
        for candidate in self.candidates:
            if candidate.id in chosen and len(candidate.terms) >= len(getattr(whole.get(candidate.id), "terms", ())):
                whole[candidate.id] = candidate
        return self.fit_candidates(whole.values(), start)

    def fit_candidates(self, chosen: Iterable[Candidate], start: Mapping[Key, float]) -> Fit:
        """Return the nonlinear fit of a set of candidates; start: a first guess by term, else it is searched for."""
        ordered = sorted(chosen, key=lambda candidate: candidate.id)
        terms = tuple(term for candidate in ordered for term in candidate.terms)
        if not terms:
            y = self.residual((), np.empty(0))
            likelihood, nothing = -0.5 * float(y @ y), np.empty((len(y), 0))
            beside = Beside(y, nothing, Covariance(nothing), 0.0, 0.0, {})
            return Fit(frozenset(), (), np.empty(0), np.empty(0), (), likelihood, likelihood, beside)
        begun = least_squares.least_squares(self, terms, self.start_values.first(terms, start))
        solution = self.start_values.likeliest(terms, begun)
        beside = self._beside(terms, solution)
        costs = self._occam(ordered, terms, solution)
        return Fit(
            frozenset(ordered),
            terms,
            solution.values,
            solution.sds,
            replay.completed(self.model, settings_of(terms, solution.values)),
            beside.nats - solution.cost,
            beside.nats - solution.cost - costs,
            beside,
        )

    def _beside(self, terms: Sequence[Term], solution: least_squares.Solution) -> Beside:
        own = orthonormal(solution.slopes)
        columns = form_errors(self, terms, solution.values, own)
        whole = np.column_stack([np.empty((len(own), 0)), *columns.values()])
        gram: FloatArray = np.asarray(whole.T @ whole, dtype=np.float64)
        missed = Covariance(whole, gram)
        ends = np.cumsum([some.shape[1] for some in columns.values()])
        blocks = {
            name: Covariance(some, gram[end - some.shape[1] : end, end - some.shape[1] : end])
            for (name, some), end in zip(columns.items(), ends, strict=True)
        }
        left = without(own, solution.residual)
        gains = [missed.scaled(share).gain(left) for share in SHARES]
        best = SHARES[int(np.argmax(gains))]
        forms = {name: one.scaled(best).gain(left) for name, one in blocks.items()}
        return Beside(left, own, missed, best, float(logsumexp(gains)) - float(np.log(len(SHARES))), forms)

    @cached_property
    def start_values(self) -> StartValues:
        """Return what finds first values, and those of what has many likely values."""
        return StartValues(self, self._walked)

    def _occam(self, chosen: Sequence[Candidate], terms: Sequence[Term], solution: least_squares.Solution) -> float:
        """Return what the set costs, in nats: Laplace's approximation about the fit, with the prior of each signal."""
        cost, free = 0.0, []
        for candidate in chosen:
            cost += float(np.log(candidate.ways))
            own = [i for i, term in enumerate(terms) if term.id == candidate.id and not term.fixed]
            loud = [i for i in own if not terms[i].shape]
            free += loud
            # Of a shape the prior is normal about its null with its scale; least_squares has its misfit.
            scales = [terms[i].parameter.scale / solution.sds[i] for i in own if terms[i].shape]
            cost += sum(float(np.log(np.hypot(1.0, scale))) for scale in scales)
            size = self._amplitudes(terms, solution, loud)
            ways = _ROUGH_WAYS if candidate.rough else 0.0
            size -= 0.0 if effects.by_id(candidate.id).separable else proportion(terms, solution, loud)
            cost += max(ways + size, step_cost(terms, solution, loud))
        if len(free) > 1:
            cost += alike(solution.slopes[:, free])
            # Less what an effect with two amplitudes has by itself: z counts it.
            total = 0.0
            for candidate in chosen:
                own = [i for i in free if terms[i].id == candidate.id]
                total += alike(solution.slopes[:, own]) if len(own) > 1 else 0.0
            cost -= total
        return cost

    def _amplitudes(self, terms: Sequence[Term], solution: least_squares.Solution, loud: Sequence[int]) -> float:
        """Return the cost of one effect's amplitudes by the size of its signal at the fit."""
        moved = np.array(solution.values)
        if not loud:
            return 0.0
        for i in loud:
            moved[i] = terms[i].null
        signal = float(np.linalg.norm(self.residual(terms, moved) - solution.residual))
        if signal > Z_USUAL and self._at_will(terms, solution, loud):
            return _AT_WILL
        if len(loud) == 2:
            return float(occam_plane(np.array(signal)))
        p = terms[loud[0]].parameter
        return float(occam(np.array(signal), 1 if terms[loud[0]].null in (p.lower, p.upper) else 2)) * len(loud)

    def _at_will(self, terms: Sequence[Term], solution: least_squares.Solution, loud: Sequence[int]) -> bool:
        """Tell whether the fit is as good with larger sizes of an effect: nothing swallows more than all there is."""
        larger = np.array(solution.values)
        for i in loud:
            p, size = terms[i].parameter, solution.values[i] - terms[i].null
            if np.linalg.norm(solution.slopes[:, i]) * abs(size / (terms[i].step * p.scale)) > 1:
                return False
            larger[i] = np.clip(larger[i] + _LARGER * size, p.lower, p.upper)
        return float(np.linalg.norm(self.residual(terms, larger) - solution.residual)) < 1

    def _moves(
        self, terms: Sequence[Term], values: FloatArray, of: Sequence[Term]
    ) -> Iterator[tuple[tuple[EffectSetting, ...], float]]:
        """Yield, for each term of `of`, the settings with that term moved, and the move in units of its step.

        A term of the fit is moved a little; another one by a whole step, because less may not show at all.
        """
        known = {term.key: i for i, term in enumerate(terms)}
        for term in of:
            i = known.get(term.key)
            p = term.parameter
            at = term.null if i is None else float(values[i])
            share = 1.0 if i is None else _ROUGH_DERIVATIVE if term.rough else _DERIVATIVE
            if term.fixed:
                yield settings_of(terms, values), share
                continue
            if not p.lower <= at + share * term.step * p.scale <= p.upper:
                share = -share
            if not p.lower <= at + share * term.step * p.scale <= p.upper:  # no room on either side: as far as it goes
                ends = p.lower - at, p.upper - at
                share = max(ends, key=abs) / (term.step * p.scale)
            moved = at + share * term.step * p.scale
            if i is None:
                yield settings_of((*terms, term), np.append(values, moved)), share
            else:
                yield settings_of(terms, np.where(np.arange(len(values)) == i, moved, values)), share

    def _whitened(self, drive: Drive, settings: tuple[EffectSetting, ...]) -> FloatArray:
        residual = drive.measured - self.simulated(drive, settings)
        return self.whitened(drive, residual.reshape(-1, 1))[:, 0]

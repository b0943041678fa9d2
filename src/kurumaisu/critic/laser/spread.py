# SPDX-License-Identifier: BSD-3-Clause
"""Effects that change how readings scatter, not their mean: likelihood of statistics, simulated with the very effects.

Which numbers an effect changes is found by simulating it. No effect is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.laser.normal import Assembly
from kurumaisu.critic.laser.shots import own_with, read
from kurumaisu.critic.laser.statistics import Statistics
from kurumaisu.critic.prior import log_prior, occam
from kurumaisu.critic.story import Comparison
from kurumaisu.effects import LaserStage, Mechanism, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_NULLS = 50  # simulations of the model as it is, for the covariance of the statistics
_MODEL = 0.5  # what the simulation of the statistics itself is off by, in their sds
_QUIET = 3.5  # sds that some statistic must be off by before any effect is tried
_COUNTS = 1.0  # no statistic but a root of a count is that large
_SIZES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # in units of a parameter's scale, tried first
_ENOUGH = 5.0  # nats of evidence from which an effect is taken; nulls reach 3
_LEFT = 1e-3  # share of an effect's evidence that its own form may leave to others
_LARGEST = 3  # effects in a set
_TRIES = 12  # simulations of a refit per parameter
_REFITS = 4  # effects that are refitted
_CLOSE = 0.5  # share of what the best of them gains that another one must gain, to be refitted
_COMPARED = 10  # simulations with the effects, for the report
_FREE = 2.0  # nats that a further parameter must bring


@dataclass(frozen=True)
class Scatter:
    """Effects on the scatter: a setting each, with the posterior, the log evidence, and sds of the parameters."""

    setting: EffectSetting
    p: float
    nats: float
    sds: Mapping[str, float]


@dataclass(frozen=True)
class _Rough:
    low: float
    effect: type[Mechanism]
    values: Mapping[str, float]


@dataclass(frozen=True)
class _Push:
    """What a parameter at a value does to the statistics."""

    effect: type[Mechanism]
    name: str
    value: float
    change: FloatArray


def _low(rough: _Rough) -> float:
    return rough.low


class Simulator:
    """Statistics of the shots with effects on how readings scatter."""

    def __init__(self, assembly: Assembly, statistics: Statistics) -> None:
        self._assembly = assembly
        self._statistics = statistics

    def __call__(self, settings: Sequence[EffectSetting], seed: int) -> FloatArray:
        """Return the statistics of a simulation."""
        shots, seen, base = self._assembly.shots, self._assembly.marks.seen, self._assembly.marks.base
        rng = np.random.default_rng([seed, 7])
        chain = effects.build_laser(own_with(shots, settings), np.random.default_rng(seed))
        raw = read(shots, seen, chain, rng.standard_normal(base.shape))
        error = shots.laser.error
        raw = raw + self._statistics.pose_errors(rng)
        readings = error.reading(error.range(raw), np.zeros_like(raw))
        with np.errstate(invalid="ignore"):
            return self._statistics.of(readings, np.where(np.isfinite(readings), readings - base, np.nan))


class ScatterSearch:
    """Finds the effects that the statistics call for."""

    def __init__(
        self, simulate: Simulator, measured: FloatArray, means: Sequence[str], ids: frozenset[str] | None = None
    ) -> None:
        """Take the measured statistics; means: parameters, as id.name, that act on the mean and are not for here.

        ids: the effects to look for; None for all.
        """
        self._ids = ids
        nulls = np.array([simulate((), 1000 + i) for i in range(_NULLS)])
        self._simulate, self._measured, self._means = simulate, measured, set(means)
        # A count that is always 0 in simulations may well be 1 in truth; roots of counts have an sd of 1.
        sd = np.maximum(nulls.std(axis=0), np.where(np.abs(nulls.mean(axis=0)) >= _COUNTS, 0.7, 0.003))
        unit = (nulls - nulls.mean(axis=0)) / sd
        half = 0.5 * (unit.T @ unit / _NULLS + np.eye(len(sd)))  # of 50 draws, correlations of 40 are uncertain
        self._sd = sd
        self._whiten = np.linalg.inv(np.linalg.cholesky(half + _MODEL**2 * np.eye(len(sd))))
        self._offset = nulls.mean(axis=0)

    def run(self) -> list[Scatter]:
        """Return the effects, greedily added while the evidence grows."""
        if np.abs((self._measured - self._offset) / self._sd).max() < _QUIET:
            return []
        pushes = list(self._pushes())
        chosen: list[type[Mechanism]] = []
        settings: list[EffectSetting] = []
        out: list[Scatter] = []
        while len(chosen) < _LARGEST:
            step = self._step(pushes, chosen, settings)
            least = max([_ENOUGH, *(_LEFT * each.nats for each in out)])
            if step is None or step[3] < least:
                break
            effect, setting, p, gain = step
            out.append(Scatter(setting, p, gain, self._errors(effect, setting, settings)))
            chosen.append(effect)
            settings.append(setting)
        return out

    def compared(self, names: Sequence[str], settings: Sequence[EffectSetting]) -> Comparison:
        """Return the statistics of the measured scans and of simulated ones without and with effects."""
        extended = self._statistics(settings, range(1, _COMPARED + 1))
        blamed = " + ".join(setting.id for setting in settings)
        return Comparison(blamed, tuple(names), self._measured, self._offset, extended, self._sd)

    def _step(
        self, pushes: Sequence[_Push], chosen: Sequence[type[Mechanism]], beside: Sequence[EffectSetting]
    ) -> tuple[type[Mechanism], EffectSetting, float, float] | None:
        """Return the effect to add, its setting, posterior and evidence; None where there is too little."""
        at = self._statistics(beside, (1, 2))
        here, count = self._cost(at), len(effects.LASER)
        starts = [
            self._rough([push for push in pushes if push.effect is effect], at) for effect in self._candidates(chosen)
        ]
        starts = sorted((start for start in starts if start.low < here), key=_low)
        tried = []
        for start in starts[:_REFITS]:
            if here - start.low < _CLOSE * (here - starts[0].low):
                break
            setting, misfit = self._refit(start, beside)
            z = np.sqrt(max(2 * (here - misfit), 0.0))
            gain = here - misfit - float(occam(np.array(z))) - 2.0 * (len(start.values) - 1)
            tried.append((gain + log_prior(1, count) - log_prior(0, count), start.effect, setting))
        if not tried:
            return None
        best, effect, setting = max(tried, key=lambda item: item[0])
        p = float(np.exp(best - logsumexp([0.0, *(item[0] for item in tried)])))
        return None if p < 0.5 else (effect, setting, p, best)

    def _pushes(self) -> Iterator[_Push]:
        """Yield what each parameter alone does to the statistics, at some values."""
        plain = self._simulate((), 1)
        for effect in self._candidates(()):
            null = {p.name: p.null for p in effect.parameters}
            for p in self._parameters(effect):
                for value in _sizes(p):
                    moved = self._simulate((EffectSetting(effect.id, {**null, p.name: value}),), 1)
                    yield _Push(effect, p.name, value, moved - plain)

    def _candidates(self, without: Sequence[type[Mechanism]]) -> Iterator[type[Mechanism]]:
        for effect in effects.LASER:
            asked = self._ids is None or effect.id in self._ids
            if asked and effect not in without and effect.stage > LaserStage.GEOMETRY and self._parameters(effect):
                yield effect

    def _parameters(self, effect: type[Mechanism]) -> list[Parameter]:
        return [p for p in effect.parameters if f"{effect.id}.{p.name}" not in self._means]

    def _statistics(self, settings: Sequence[EffectSetting], seeds: Sequence[int]) -> FloatArray:
        return np.asarray(np.mean([self._simulate(settings, seed) for seed in seeds], axis=0))

    def _misfit(self, settings: Sequence[EffectSetting], seeds: Sequence[int] = (1, 2)) -> float:
        return self._cost(self._statistics(settings, seeds))

    def _cost(self, statistics: FloatArray) -> float:
        white = self._whiten @ ((statistics - self._measured) / self._sd)
        return 0.5 * float(white @ white)

    def _rough(self, pushes: Sequence[_Push], at: FloatArray) -> _Rough:
        """Return the best of some sizes of an effect's parameters, as if changes of the statistics were sums."""
        low, best = np.inf, dict[str, float]()
        for name in dict.fromkeys(push.name for push in pushes):
            known = at + sum(push.change for push in pushes if best.get(push.name) == push.value)
            for push in pushes:
                misfit = self._cost(known + push.change) if push.name == name else np.inf
                if misfit < low - _FREE:
                    low, best = misfit, {**{k: v for k, v in best.items() if k != name}, name: push.value}
        return _Rough(low, pushes[0].effect, best)

    def _refit(self, start: _Rough, beside: Sequence[EffectSetting]) -> tuple[EffectSetting, float]:
        """Return an effect's best setting and its misfit, from a rough one: those parameters that helped, together."""
        effect = start.effect
        null = {p.name: p.null for p in effect.parameters}
        free = [p for p in effect.parameters if p.name in start.values]
        centre = np.array([start.values[p.name] for p in free])
        step = np.array([0.3 * abs(x - p.null) or 0.1 * p.scale for x, p in zip(centre, free, strict=True)])

        def at(x: FloatArray) -> EffectSetting:
            values = {p.name: float(np.clip(v, p.lower, p.upper)) for p, v in zip(free, centre + step * x, strict=True)}
            return EffectSetting(effect.id, {**null, **values})

        simplex = np.vstack([np.zeros(len(free)), np.eye(len(free))])
        options = {"maxfev": _TRIES * len(free), "xatol": 0.02, "fatol": 0.1, "initial_simplex": simplex}
        cost = lambda x: self._misfit((*beside, at(x)), (1, 2))  # noqa: E731
        result = minimize(cost, np.zeros(len(free)), method="Nelder-Mead", options=options)
        return at(result.x), float(result.fun)

    def _errors(
        self, effect: type[Mechanism], setting: EffectSetting, beside: Sequence[EffectSetting]
    ) -> dict[str, float]:
        """Return sds of the parameters from how the statistics follow each."""
        slopes = []
        for p in self._parameters(effect):
            step = 0.1 * abs(setting.parameters[p.name] - p.null) or 0.05 * p.scale
            ends = np.clip(setting.parameters[p.name] + np.array([-step, step]), p.lower, p.upper)
            moved = [
                np.mean(
                    [
                        self._simulate((*beside, EffectSetting(effect.id, {**setting.parameters, p.name: float(e)})), s)
                        for s in (1, 2)
                    ],
                    axis=0,
                )
                for e in ends
            ]
            slopes.append(self._whiten @ ((moved[1] - moved[0]) / self._sd) / (ends[1] - ends[0]))
        j = np.array(slopes).T
        scale = np.array([p.scale for p in self._parameters(effect)])
        inverse = np.linalg.inv((j * scale).T @ (j * scale) + 1e-4 * np.eye(len(scale)))
        sds = np.sqrt(np.diag(inverse)) * scale
        return {p.name: float(sd) for p, sd in zip(self._parameters(effect), sds, strict=True)}


def _sizes(p: Parameter) -> list[float]:
    """Return values to try for a parameter, off its null."""
    values = [p.null + sign * size * p.scale for size in _SIZES for sign in (1.0, -1.0)]
    return [value for value in values if p.lower <= value <= p.upper]

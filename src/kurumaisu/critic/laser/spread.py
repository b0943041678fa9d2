# SPDX-License-Identifier: BSD-3-Clause
"""Effects that change how readings scatter, not their mean: likelihood of statistics, simulated with the very effects.

Which numbers an effect changes is found by simulating it. No effect is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.evidence import occam
from kurumaisu.critic.laser.normal import Assembly
from kurumaisu.critic.laser.shots import own_with, read
from kurumaisu.critic.laser.statistics import Statistics
from kurumaisu.critic.naming import log_prior
from kurumaisu.effects import LaserStage, Mechanism, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_NULLS = 60  # simulations of the model as it is, for the covariance of the statistics
_MODEL = 0.5  # what the simulation of the statistics itself is off by, in their sds
_QUIET = 3.5  # sds that some statistic must be off by before any effect is tried
_SIZES = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # in units of a parameter's scale, tried first
_LARGEST = 3  # effects in a set
_TRIES = 40  # simulations of a refit per parameter


@dataclass(frozen=True)
class Scatter:
    """Effects on the scatter: a setting each, with the posterior, the log evidence, and sds of the parameters."""

    setting: EffectSetting
    p: float
    nats: float
    sds: Mapping[str, float]


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

    def __init__(self, simulate: Simulator, measured: FloatArray, means: Sequence[str]) -> None:
        """Take the measured statistics; means: parameters, as id.name, that act on the mean and are not for here."""
        nulls = np.array([simulate((), 1000 + i) for i in range(_NULLS)])
        self._simulate, self._measured, self._means = simulate, measured, set(means)
        sd = np.maximum(nulls.std(axis=0), 1e-3 * np.maximum(np.abs(nulls.mean(axis=0)), 1e-2))
        unit = (nulls - nulls.mean(axis=0)) / sd
        half = 0.5 * (unit.T @ unit / _NULLS + np.eye(len(sd)))  # of 60 draws, correlations of 40 are uncertain
        self._sd = sd
        self._whiten = np.linalg.inv(np.linalg.cholesky(half + _MODEL**2 * np.eye(len(sd))))
        self._offset = nulls.mean(axis=0)

    def run(self) -> list[Scatter]:
        """Return the effects, greedily added while the evidence grows."""
        if np.abs((self._measured - self._offset) / self._sd).max() < _QUIET:
            return []
        chosen: list[tuple[type[Mechanism], EffectSetting]] = []
        here = self._misfit(())
        out: list[Scatter] = []
        count = len(effects.LASER)
        while len(chosen) < _LARGEST:
            tried = []
            for effect in self._candidates([effect for effect, _ in chosen]):
                setting, misfit = self._fit(effect, [setting for _, setting in chosen])
                z = np.sqrt(max(2 * (here - misfit), 0.0))
                free = len(self._parameters(effect))
                gain = here - misfit - float(occam(np.array(z))) - 2.0 * (free - 1)
                tried.append((gain + log_prior(1, count) - log_prior(0, count), misfit, effect, setting))
            tried.sort(key=lambda item: -item[0])
            best, misfit, effect, setting = tried[0]
            p = float(np.exp(best - logsumexp([0.0, *(item[0] for item in tried)])))
            if best < 0 or p < 0.5:
                break
            chosen.append((effect, setting))
            out.append(Scatter(setting, p, best, self._errors(effect, setting, [s for _, s in chosen[:-1]])))
            here = misfit
        return out

    def _candidates(self, without: Sequence[type[Mechanism]]) -> Iterator[type[Mechanism]]:
        for effect in effects.LASER:
            if effect not in without and effect.stage > LaserStage.GEOMETRY and self._parameters(effect):
                yield effect

    def _parameters(self, effect: type[Mechanism]) -> list[Parameter]:
        return [p for p in effect.parameters if f"{effect.id}.{p.name}" not in self._means]

    def _misfit(self, settings: Sequence[EffectSetting]) -> float:
        off = (np.mean([self._simulate(settings, seed) for seed in (1, 2)], axis=0) - self._measured) / self._sd
        white = self._whiten @ off
        return 0.5 * float(np.sum(np.minimum(white**2, 1e4)))

    def _fit(self, effect: type[Mechanism], beside: Sequence[EffectSetting]) -> tuple[EffectSetting, float]:
        """Return an effect's best setting and its misfit: sizes one by one, then all parameters together."""
        null = {p.name: p.null for p in effect.parameters}
        free = self._parameters(effect)

        def misfit(values: Mapping[str, float]) -> float:
            return self._misfit((*beside, EffectSetting(effect.id, {**null, **values})))

        best: dict[str, float] = {}
        low = misfit({})
        for p in free:
            at = dict(best)
            for value in _sizes(p):
                found = misfit({**at, p.name: value})
                if found < low:
                    low, best = found, {**at, p.name: value}
        if not best:
            return EffectSetting(effect.id, null), low
        return self._refit(effect.id, null, free, best, misfit)

    def _refit(
        self,
        name: str,
        null: Mapping[str, float],
        free: Sequence[Parameter],
        best: Mapping[str, float],
        misfit: Callable[[Mapping[str, float]], float],
    ) -> tuple[EffectSetting, float]:
        start = np.array([{**null, **best}[p.name] for p in free])
        step = np.array([0.3 * abs(x - p.null) or 0.1 * p.scale for x, p in zip(start, free, strict=True)])

        def at(x: FloatArray) -> dict[str, float]:
            return {p.name: float(np.clip(v, p.lower, p.upper)) for p, v in zip(free, start + step * x, strict=True)}

        simplex = np.vstack([np.zeros(len(free)), np.eye(len(free))])
        options = {"maxfev": _TRIES, "xatol": 0.02, "fatol": 0.1, "initial_simplex": simplex}
        result = minimize(lambda x: misfit(at(x)), np.zeros(len(free)), method="Nelder-Mead", options=options)
        return EffectSetting(name, {**null, **at(result.x)}), float(result.fun)

    def _errors(
        self, effect: type[Mechanism], setting: EffectSetting, beside: Sequence[EffectSetting]
    ) -> dict[str, float]:
        """Return sds of the parameters from how the statistics follow each."""
        slopes = []
        for p in self._parameters(effect):
            step = 0.1 * abs(setting.parameters[p.name] - p.null) or 0.05 * p.scale
            ends = np.clip(setting.parameters[p.name] + np.array([-step, step]), p.lower, p.upper)
            moved = [
                np.mean([self._simulate((*beside, EffectSetting(effect.id, {**setting.parameters, p.name: float(e)})), s)
                         for s in (1, 2)], axis=0)
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

# SPDX-License-Identifier: BSD-3-Clause
"""Effects that change how readings scatter, not their mean: likelihood of statistics, simulated with the very effects.

Which numbers an effect changes is found by simulating it. No effect is named. One is added at a time; those that change
the same numbers are then fitted together, and what is no longer needed goes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.laser.likeness import Likeness
from kurumaisu.critic.laser.simulated import Simulator
from kurumaisu.critic.prior import log_prior, occam
from kurumaisu.critic.story import Comparison
from kurumaisu.effects import LaserStage, Mechanism, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_NULLS = 50  # simulations of the model as it is, for the covariance of the statistics
_QUIET = 3.5  # sds that some statistic must be off by before any effect is tried
_SIZES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # in units of a parameter's scale, tried first
_ENOUGH = 5.0  # nats of evidence from which an effect is taken; nulls reach 3
_LEFT = 1e-3  # share of an effect's evidence that its own form may leave to any other one
_LEFT_LIKE = 0.02  # and to one that changes the same numbers
_WEAK = 0.05  # share of the strongest effect's evidence, from which another one is beyond doubt
_LARGEST = 6  # effects in a set
_ROUNDS = 4  # Gauss-Newton steps of a refit
_SHARES = (1.0, 0.5, 0.2)  # of such a step, tried in turn
_FARTHEST = 3.0  # such a step, in units of the first difference
_FINER = 0.5  # of one step's difference is the next one's
_DAMPED = 0.02  # share by which the curvature is raised: other draws make the slopes uncertain
_SETTLED = 0.3  # nats that another step must bring
_REFITS = 4  # effects that are refitted
_CLOSE = 0.5  # share of what the best of them gains that another one must gain, to be refitted
_COMPARED = 10  # simulations with the effects, for the report
_FREE = 2.0  # nats that a further parameter must bring
_POOR = 15.0  # nats of misfit from which shapes of an effect are tried, too
_OVERLAP = 0.3  # cosine of two effects' changes of the statistics, from which they are fitted together


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


@dataclass(frozen=True)
class _Piece:
    """An effect that acts: its setting, which parameters are fitted, posterior and log evidence of it."""

    effect: type[Mechanism]
    setting: EffectSetting
    free: tuple[str, ...]
    p: float
    nats: float

    @property
    def price(self) -> float:
        """What its parameters but the first cost [nat]."""
        return _FREE * (len(self.free) - 1)


def _low(rough: _Rough) -> float:
    return rough.low


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
        self._simulate, self._means = simulate, set(means)
        self._likeness = Likeness(nulls, measured, simulate.counts())

    def run(self) -> list[Scatter]:
        """Return the effects, added while the evidence grows."""
        if np.abs(self._likeness.units(self._likeness.measured)).max() < _QUIET:
            return []
        pushes = list(self._pushes())
        chosen: list[_Piece] = []
        gone: set[type[Mechanism]] = set()
        while len(chosen) < _LARGEST:
            new = self._step(pushes, chosen, gone)
            if new is None or new.nats < self._least(chosen, new):
                break
            chosen = self._settled(chosen, new, gone)
        chosen = self._polished(chosen)
        settings = [piece.setting for piece in chosen]
        return [Scatter(piece.setting, piece.p, piece.nats, self._errors(piece, settings)) for piece in chosen]

    def compared(self, names: Sequence[str], settings: Sequence[EffectSetting]) -> Comparison:
        """Return the statistics of the measured scans and of simulated ones without and with effects."""
        extended = self._statistics(settings, range(1, _COMPARED + 1))
        blamed = " + ".join(setting.id for setting in settings)
        known = self._likeness
        return Comparison(blamed, tuple(names), known.measured, known.offset, extended, known.sd)

    def _step(self, pushes: Sequence[_Push], chosen: Sequence[_Piece], gone: set[type[Mechanism]]) -> _Piece | None:
        """Return the effect to add; None where there is too little."""
        beside = [piece.setting for piece in chosen]
        at = self._statistics(beside, (1, 2))
        here, count = self._likeness.cost(at), len(effects.LASER)
        without = {*gone, *(piece.effect for piece in chosen)}
        starts = [
            self._rough([push for push in pushes if push.effect is effect], at) for effect in self._candidates(without)
        ]
        starts = sorted((start for start in starts if start.low < here), key=_low)
        tried: list[_Piece] = []
        for start in starts[:_REFITS]:
            if here - start.low < _CLOSE * (here - starts[0].low):
                break
            piece, misfit = self._alone(start, beside)
            z = np.sqrt(max(2 * (here - misfit), 0.0))
            gain = here - misfit - float(occam(np.array(z))) - piece.price
            tried.append(replace(piece, nats=gain + log_prior(1, count) - log_prior(0, count)))
        if not tried:
            return None
        best = max(tried, key=lambda piece: piece.nats)
        p = float(np.exp(best.nats - logsumexp([0.0, *(piece.nats for piece in tried)])))
        return None if p < 0.5 else replace(best, p=p)

    def _least(self, chosen: Sequence[_Piece], new: _Piece) -> float:
        """Return the evidence from which an effect is taken beside others [nat]: they may act in another form."""
        like = [piece.nats for piece in chosen if self._overlap(piece, new) > _OVERLAP]
        return max([_ENOUGH, *(_LEFT * piece.nats for piece in chosen), *(_LEFT_LIKE * nats for nats in like)])

    def _settled(self, chosen: Sequence[_Piece], new: _Piece, gone: set[type[Mechanism]]) -> list[_Piece]:
        """Return the pieces with a new one, fitted together with those like it; what it makes superfluous is gone."""
        like = [piece for piece in chosen if self._overlap(piece, new) > _OVERLAP]
        rest = [piece for piece in chosen if piece not in like]
        if not like:
            return [*chosen, new]
        beside = [piece.setting for piece in rest]
        group, cost = self._together([*like, new], beside)
        for old in like:
            fewer, more = self._together([piece for piece in group if piece.effect is not old.effect], beside)
            z = np.sqrt(max(2 * (more - cost), 0.0))
            nats = more - cost - float(occam(np.array(z))) - old.price
            if nats < _ENOUGH:
                group, cost = fewer, more
                gone.add(old.effect)
            else:
                group = [replace(piece, nats=nats) if piece.effect is old.effect else piece for piece in group]
        return [*rest, *group]

    def _polished(self, chosen: Sequence[_Piece]) -> list[_Piece]:
        """Return all pieces fitted together, without weak ones that stood in for wrong sizes of others."""
        if len(chosen) < 2:
            return list(chosen)
        group, cost = self._together(chosen, ())
        strong = max(piece.nats for piece in group)
        for old in sorted(group, key=lambda piece: piece.nats):
            others = [piece for piece in group if piece.effect is not old.effect]
            if old.nats > _WEAK * strong or not others:
                continue
            fewer, more = self._together(others, ())
            z = np.sqrt(max(2 * (more - cost), 0.0))
            if more - cost - float(occam(np.array(z))) - old.price < self._least(others, old):
                group, cost = fewer, more
        return group

    def _overlap(self, one: _Piece, other: _Piece) -> float:
        """Return the cosine of what two effects do to the statistics, whatever its sign."""
        plain = self._statistics((), (1, 2))
        a, b = (
            self._likeness.whitened(self._statistics((piece.setting,), (1, 2)) - plain, plain) for piece in (one, other)
        )
        return float(abs(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-9))

    def _pushes(self) -> Iterator[_Push]:
        """Yield what each parameter alone does to the statistics, at some values."""
        plain = self._simulate((), 1)
        for effect in self._candidates(set()):
            null = self._simulate.null(effect)
            for p in self._parameters(effect):
                for value in _sizes(p):
                    moved = self._simulate((EffectSetting(effect.id, {**null, p.name: value}),), 1)
                    yield _Push(effect, p.name, value, moved - plain)

    def _candidates(self, without: set[type[Mechanism]]) -> Iterator[type[Mechanism]]:
        for effect in effects.LASER:
            asked = self._ids is None or effect.id in self._ids
            if asked and effect not in without and effect.stage > LaserStage.GEOMETRY and self._parameters(effect):
                yield effect

    def _parameters(self, effect: type[Mechanism]) -> list[Parameter]:
        return [p for p in effect.parameters if f"{effect.id}.{p.name}" not in self._means]

    def _statistics(self, settings: Sequence[EffectSetting], seeds: Sequence[int]) -> FloatArray:
        return np.asarray(np.mean([self._simulate(settings, seed) for seed in seeds], axis=0))

    def _misfit(self, settings: Sequence[EffectSetting]) -> float:
        return self._likeness.cost(self._statistics(settings, (1, 2)))

    def _rough(self, pushes: Sequence[_Push], at: FloatArray) -> _Rough:
        """Return the best of some sizes of an effect's parameters, as if changes of the statistics were sums."""
        low, best = np.inf, dict[str, float]()
        for name in dict.fromkeys(push.name for push in pushes):
            known = at + sum(push.change for push in pushes if best.get(push.name) == push.value)
            for push in pushes:
                misfit = self._likeness.cost(known + push.change) if push.name == name else np.inf
                if misfit < low - _FREE:
                    low, best = misfit, {**{k: v for k, v in best.items() if k != name}, name: push.value}
        return _Rough(low, pushes[0].effect, best)

    def _alone(self, start: _Rough, beside: Sequence[EffectSetting]) -> tuple[_Piece, float]:
        """Return an effect fitted beside others, and its misfit: the parameters that helped; then its shape."""
        null = self._simulate.null(start.effect)
        setting = EffectSetting(start.effect.id, {**null, **start.values})
        (piece,), low = self._together([_Piece(start.effect, setting, tuple(start.values), 0.0, 0.0)], beside)
        for p in self._parameters(start.effect) if low > _POOR else ():
            if p.name in piece.free:
                continue
            values = piece.setting.parameters
            tried = [EffectSetting(start.effect.id, {**values, p.name: value}) for value in _sizes(p)]
            misfits = [self._misfit((*beside, each)) for each in tried]
            if min(misfits) < low - _FREE:
                better = replace(piece, setting=tried[int(np.argmin(misfits))], free=(*piece.free, p.name))
                (piece,), low = self._together([better], beside)
        return piece, low

    def _together(self, pieces: Sequence[_Piece], beside: Sequence[EffectSetting]) -> tuple[list[_Piece], float]:
        """Return effects fitted together beside others, and the misfit."""
        places = [(i, p) for i, each in enumerate(pieces) for p in each.effect.parameters if p.name in each.free]
        centre = np.array([pieces[i].setting.parameters[p.name] for i, p in places])
        step = np.array([0.3 * abs(x - p.null) or 0.1 * p.scale for x, (_, p) in zip(centre, places, strict=True)])

        def at(x: FloatArray) -> list[_Piece]:
            values = [dict(piece.setting.parameters) for piece in pieces]
            for (i, p), value in zip(places, (centre + step * x).tolist(), strict=True):
                values[i][p.name] = float(np.clip(value, p.lower, p.upper))
            made = zip(pieces, values, strict=True)
            return [replace(piece, setting=EffectSetting(piece.setting.id, each)) for piece, each in made]

        def numbers(x: FloatArray) -> FloatArray:
            return self._statistics((*beside, *(piece.setting for piece in at(x))), (1, 2))

        x, reach = np.zeros(len(places)), 1.0
        here = numbers(x)
        low = self._likeness.cost(here)
        for _ in range(_ROUNDS):
            moved = [numbers(x + reach * one) - here for one in np.eye(len(x))]
            slopes = np.array([self._likeness.whitened(change, here) / reach for change in moved])
            left = self._likeness.whitened(here - self._likeness.measured, here)
            inner = slopes @ slopes.T
            move = -np.linalg.solve(inner + _DAMPED * np.diag(np.diag(inner)) + 1e-6 * np.eye(len(x)), slopes @ left)
            before, move, reach = low, np.clip(move, -_FARTHEST, _FARTHEST), _FINER * reach
            for share in _SHARES:
                tried = numbers(x + share * move)
                if self._likeness.cost(tried) < low:
                    x, here, low = x + share * move, tried, self._likeness.cost(tried)
                    break
            if before - low < _SETTLED:
                break
        return at(x), low

    def _errors(self, piece: _Piece, every: Sequence[EffectSetting]) -> dict[str, float]:
        """Return sds of the parameters that were fitted, from how the statistics follow each."""
        setting, parameters = piece.setting, [p for p in piece.effect.parameters if p.name in piece.free]
        beside = [other for other in every if other is not setting]
        slopes = []
        for p in parameters:
            step = 0.1 * max(abs(setting.parameters[p.name] - p.null), p.scale)
            ends = np.clip(setting.parameters[p.name] + np.array([-step, step]), p.lower, p.upper)
            each = [
                [
                    self._simulate((*beside, EffectSetting(setting.id, {**setting.parameters, p.name: end})), seed)
                    for seed in (1, 2)
                ]
                for end in ends.tolist()
            ]
            low, high = np.array(each[0]), np.array(each[1])
            middle = 0.25 * (low + high).sum(axis=0)
            first, second = (self._likeness.whitened(change, middle) for change in high - low)
            change, chance = 0.5 * (first + second), 0.25 * float((first - second) @ (first - second))
            sure = np.sqrt(max(1 - chance / max(float(change @ change), 1e-9), 0.0))  # other draws alone differ, too
            slopes.append(sure * change / (ends[1] - ends[0]))
        j = np.array(slopes).T
        scale = np.array([p.scale for p in parameters])
        inverse = np.linalg.inv((j * scale).T @ (j * scale) + 1e-4 * np.eye(len(scale)))
        sds = np.sqrt(np.diag(inverse)) * scale
        return {p.name: float(sd) for p, sd in zip(parameters, sds, strict=True)}


def _sizes(p: Parameter) -> list[float]:
    """Return values to try for a parameter, off its null."""
    values = [p.null + sign * size * p.scale for size in _SIZES for sign in (1.0, -1.0)]
    return [value for value in values if p.lower <= value <= p.upper]

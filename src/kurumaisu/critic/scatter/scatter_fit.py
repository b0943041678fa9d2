# SPDX-License-Identifier: BSD-3-Clause
"""Fits of effects on the scatter: which numbers an effect changes, how far, and how surely its parameters are known.

Which numbers an effect changes is found by simulating it. No effect is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.scatter.likelihood import StatisticsLikelihood
from kurumaisu.critic.scatter.simulation import ScatterSimulator
from kurumaisu.critic.values.policy import Z_LOW
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.effects import LaserStage, Mechanism, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import BoolArray, FloatArray

_NULLS = 50  # simulations of the model as it is, for the covariance of the statistics
# In units of a parameter's scale, tried first: a thousandth of the readings shows.
_SIZES = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
_PARTS = (0.25, 0.5, 0.75)  # of the way between two of these, which no simulation is needed for
_HALVED = 12  # times that the way between two of these is halved at most, where readings pile up between them
_ROUNDS = 4  # Gauss-Newton steps of a refit
_SHARES = (1.0, 0.5, 0.2)  # of such a step, tried in turn
_FARTHEST = 3.0  # such a step, in units of the first difference
_FINER = 0.5  # of one step's difference is the next one's
_SHOWS, _LONGEST = 0.5, 8.0  # sds by which numbers must change to tell a slope; times a step is made longer at most
_SETTLED = 0.3  # nats that another step must bring
_FREE = 2.0  # nats that a shape must bring; a further amplitude must show like any other one
_NONE = 1e-6  # of what a shape is usually
_PASSES = 2  # over an effect's further parameters: one may help only where another has been found
_POOR = 15.0  # nats of misfit from which shapes of an effect are tried, too
# Factor, at 90 %, by which another form of an effect that is empirical may pass for another size: all numbers follow it
# together, so that many of them do not average it out. What one counts for each edge, another counts for each beam.
_OTHER = 2.0


@dataclass(frozen=True)
class RoughFit:
    """An effect of a form with the best of some sizes of its parameters, and the misfit then."""

    low: float
    effect: type[Mechanism]
    form: Mapping[str, float]
    values: Mapping[str, float]


@dataclass(frozen=True)
class StatisticsChange:
    """What a parameter at a value does to the statistics, with an effect of a form."""

    effect: type[Mechanism]
    form: Mapping[str, float]
    name: str
    value: float
    change: FloatArray


@dataclass(frozen=True)
class ScatterPiece:
    """An effect that acts: its setting, which parameters are fitted, and its log evidence beside the others."""

    effect: type[Mechanism]
    setting: EffectSetting
    free: tuple[str, ...]
    nats: float = 0.0

    def start(self, low: float) -> RoughFit:
        """Return it as what to fit beside others, with the misfit then."""
        values = self.setting.parameters
        form = {name: value for name, value in values.items() if name not in self.free}
        return RoughFit(low, self.effect, form, {name: values[name] for name in self.free})

    @property
    def price(self) -> float:
        """What its parameters but the first cost [nat]: a shape is usually within a factor e of what it is usually."""
        free = [p for p in self.effect.parameters if p.name in self.free]
        asked = [_least(p) for p in free]
        factors = [max(abs(self.setting.parameters[p.name]) / p.null, _NONE) for p in free if p.null > 0]
        return float(sum(asked) - max(asked) + 0.5 * np.sum(np.log(factors) ** 2))


class ScatterFit:
    """Fits effects to the statistics."""

    def __init__(
        self,
        simulate: ScatterSimulator,
        measured: FloatArray,
        means: Sequence[str],
        ids: frozenset[str] | None = None,
        heard: BoolArray | None = None,
    ) -> None:
        """Take the measured statistics; means: parameters, as id.name, that act on the mean and are not for here.

        ids: the effects to look for, heard: which of the statistics say anything; None for all.
        """
        self._ids = ids
        nulls = simulate.nulls(range(1000, 1000 + _NULLS))
        self._simulate, self._means = simulate, set(means)
        self._known: dict[tuple[object, ...], FloatArray] = {}
        self._shapes: set[tuple[str, str]] = set()
        self.likeness = StatisticsLikelihood(
            nulls, measured, simulate.kinds(), np.ones(len(measured), dtype=bool) if heard is None else heard
        )

    def overlap(self, one: ScatterPiece, other: ScatterPiece) -> float:
        """Return the cosine of what two effects do to the statistics, whatever its sign."""
        plain = self.statistics((), (1, 2))
        a, b = (
            self.likeness.whitened(self.statistics((piece.setting,), (1, 2)) - plain, plain) for piece in (one, other)
        )
        return float(abs(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-9))

    def pushes(self) -> Iterator[StatisticsChange]:
        """Yield what each parameter alone does to the statistics, at some values, the largest last."""
        plain = self._numbers((), 1)
        for effect, form in [(one, form) for one in self.candidates(set()) for form in self._forms(one)]:
            null = {**self._simulate.null(effect), **form}
            for p in self._parameters(effect):
                found: list[StatisticsChange] = []
                least = 0.0
                for value in sorted(_sizes(p), key=lambda value: -abs(value - p.null)):
                    moved = self._numbers((EffectSetting(effect.id, {**null, p.name: value}),), 1)
                    if np.array_equal(moved, plain):
                        least = value
                        break  # it only shapes what others do, or does nothing when it is smaller
                    found.append(StatisticsChange(effect, form, p.name, value, moved - plain))
                if not found:
                    self._shapes.add((effect.id, p.name))
                yield from reversed(found)
                if found:
                    yield from self._at_places(found, least, plain)

    def _at_places(
        self, found: Sequence[StatisticsChange], least: float, plain: FloatArray
    ) -> Iterator[StatisticsChange]:
        """Yield a parameter's pushes that bring the places of piles to where they are; least: a value that did nothing.

        Where readings pile up is known to a step of them: from half or twice as far off no small step leads there.
        """
        known = {least: plain, **{push.value: plain + push.change for push in found}}
        null = {**self._simulate.null(found[0].effect), **found[0].form}
        for low, high in pairwise(sorted(known)):
            off, end = (self.likeness.places_off(known[value]) for value in (low, high))
            for place in np.flatnonzero(off * end < 0):
                left, right = low, high
                for _ in range(_HALVED):
                    middle = float(np.sqrt(left * right)) if left > 0 else (left + right) / 2
                    setting = EffectSetting(found[0].effect.id, {**null, found[0].name: middle})
                    change = self._numbers((setting,), 1) - plain
                    now = self.likeness.places_off(plain + change)[place]
                    left, right = (middle, right) if now * off[place] > 0 else (left, middle)
                    if not now:
                        break
                yield replace(found[0], value=middle, change=change)

    def candidates(self, without: set[type[Mechanism]]) -> Iterator[type[Mechanism]]:
        """Yield the effects that may be looked for, without some."""
        for effect in effects.LASER:
            asked = self._ids is None or effect.id in self._ids
            if asked and effect not in without and effect.stage > LaserStage.GEOMETRY and self._parameters(effect):
                yield effect

    def _forms(self, effect: type[Mechanism]) -> Sequence[Mapping[str, float]]:
        """Return the forms of an effect that do not act on the mean."""
        free = [form for form in effect.forms if not any(f"{effect.id}.{name}" in self._means for name in form)]
        return free or ({},)

    def _parameters(self, effect: type[Mechanism]) -> list[Parameter]:
        known = self._means | {f"{effect.id}.{name}" for name in effect.usual()}
        return [p for p in effect.parameters if f"{effect.id}.{p.name}" not in known]

    def statistics(self, settings: Sequence[EffectSetting], seeds: Sequence[int]) -> FloatArray:
        """Return the statistics of simulations with effects, the mean over seeds."""
        return np.asarray(np.mean([self._numbers(settings, seed) for seed in seeds], axis=0))

    def _numbers(self, settings: Sequence[EffectSetting], seed: int) -> FloatArray:
        """Return the statistics of a simulation, which is made once."""
        key = (seed, *((setting.id, *setting.parameters.items()) for setting in settings))
        if key not in self._known:
            self._known[key] = self._simulate(settings, seed)
        return self._known[key]

    def misfit(self, settings: Sequence[EffectSetting]) -> float:
        """Return how ill simulations with effects agree with what was measured [nat]."""
        return self.likeness.cost(self.statistics(settings, (1, 2)))

    def rough(self, pushes: Sequence[StatisticsChange], at: FloatArray) -> list[RoughFit]:
        """Return the best of some sizes of each of an effect's forms, as if changes of the statistics were sums."""
        forms = list({tuple(push.form.items()): push.form for push in pushes}.values())
        return [self._rough([push for push in pushes if push.form == form], at) for form in forms]

    def _rough(self, pushes: Sequence[StatisticsChange], at: FloatArray) -> RoughFit:
        """Return the best of some sizes of one form's parameters, and of sizes between them."""
        pushes = [*pushes, *_between(pushes)]
        names = dict.fromkeys(push.name for push in pushes)
        changes = {(push.name, push.value): push.change for push in pushes}
        low, best = np.inf, dict[str, float]()
        asked = {p.name: _least(p) for p in pushes[0].effect.parameters}
        for _, name in product(range(_PASSES), names):
            others = {k: v for k, v in best.items() if k != name}
            known = at + sum(changes[each] for each in others.items())
            tried = [(self.likeness.cost(known + push.change), push.value) for push in pushes if push.name == name]
            misfit, value = min(tried)
            plain = self.likeness.cost(known) if others else np.inf
            low, best = (misfit, {**others, name: value}) if misfit < plain - asked[name] else (plain, others)
        return RoughFit(low, pushes[0].effect, pushes[0].form, best)

    def alone(self, start: RoughFit, beside: Sequence[EffectSetting]) -> tuple[ScatterPiece, float]:
        """Return an effect fitted beside others, and its misfit: the parameters that helped; then its shape."""
        setting = EffectSetting(start.effect.id, {**self._simulate.null(start.effect), **start.form, **start.values})
        (piece,), low = self.together([ScatterPiece(start.effect, setting, tuple(start.values))], beside)
        for p in start.effect.parameters:
            piece, low = self._spared(p, piece, low, beside)
        return self.shaped(piece, low, beside)

    def _spared(
        self, p: Parameter, piece: ScatterPiece, low: float, beside: Sequence[EffectSetting]
    ) -> tuple[ScatterPiece, float]:
        """Return an effect without one of several parameters where that fits nearly as well, and its misfit.

        Changes of the statistics are no sums: what seemed to help may be needless when the others are fitted.
        """
        if p.name not in piece.free or len(piece.free) == 1:
            return piece, low
        setting = EffectSetting(piece.setting.id, {**piece.setting.parameters, p.name: p.null})
        free = tuple(name for name in piece.free if name != p.name)
        (plainer,), misfit = self.together([replace(piece, setting=setting, free=free)], beside)
        return (plainer, misfit) if misfit < low + _least(p) else (piece, low)

    def shaped(self, piece: ScatterPiece, low: float, beside: Sequence[EffectSetting]) -> tuple[ScatterPiece, float]:
        """Return an effect with what shapes it fitted, too, as far as it helps, and its misfit; low: without that."""
        shapes = [p for p in piece.effect.parameters if (piece.setting.id, p.name) in self._shapes]
        for _, p in product(range(_PASSES), shapes):
            if p.name not in piece.free and low > _POOR:
                piece, low = self._with(p, piece, low, beside)
        return piece, low

    def _with(
        self, p: Parameter, piece: ScatterPiece, low: float, beside: Sequence[EffectSetting]
    ) -> tuple[ScatterPiece, float]:
        """Return an effect with its shape fitted, too, where that helps, and its misfit; low: without it."""
        name, values = piece.setting.id, piece.setting.parameters
        tried = [EffectSetting(name, {**values, p.name: value}) for value in _sizes(p)]
        misfits = [self.misfit((*beside, each)) for each in tried]
        # A wider burst of fewer readings: neither of both helps alone.
        setting = tried[int(np.argmin(misfits))] if min(misfits) < low - _least(p) else piece.setting
        (better,), least = self.together([replace(piece, setting=setting, free=(*piece.free, p.name))], beside)
        return (better, least) if least < low - _least(p) else (piece, low)

    def together(
        self, pieces: Sequence[ScatterPiece], beside: Sequence[EffectSetting]
    ) -> tuple[list[ScatterPiece], float]:
        """Return effects fitted together beside others, and the misfit."""
        places = [(i, p) for i, each in enumerate(pieces) for p in each.effect.parameters if p.name in each.free]
        centre = np.array([pieces[i].setting.parameters[p.name] for i, p in places])
        step = np.array([_step(p, x) for x, (_, p) in zip(centre.tolist(), places, strict=True)])

        def at(x: FloatArray) -> list[ScatterPiece]:
            values = [dict(piece.setting.parameters) for piece in pieces]
            for (i, p), value in zip(places, (centre + step * x).tolist(), strict=True):
                values[i][p.name] = float(np.clip(value, p.lower, p.upper))
            made = zip(pieces, values, strict=True)
            return [replace(piece, setting=EffectSetting(piece.setting.id, each)) for piece, each in made]

        def numbers(x: FloatArray, seeds: Sequence[int] = (1, 2)) -> FloatArray:
            return self.statistics((*beside, *(piece.setting for piece in at(x))), seeds)

        x, reach = np.zeros(len(places)), 1.0
        here = numbers(x)
        low = self.likeness.cost(here)
        for _ in range(_ROUNDS):
            slopes = [self._slope(lambda moved: numbers(moved, (1,)), x, reach * one) for one in np.eye(len(x))]
            move = self.likeness.step(here, np.array(slopes) / reach)
            before, move, reach = low, np.clip(move, -_FARTHEST, _FARTHEST), _FINER * reach
            for share in _SHARES:
                tried = numbers(x + share * move)
                if self.likeness.cost(tried) < low:
                    x, here, low = x + share * move, tried, self.likeness.cost(tried)
                    break
            if before - low < _SETTLED:
                break
        return at(x), low

    def _slope(self, numbers: Callable[[FloatArray], FloatArray], x: FloatArray, step: FloatArray) -> FloatArray:
        """Return by how much the numbers change per step, by one that shows: of few strays, a few more may be none.

        numbers: of the same draws before and after, so that one simulation tells.
        """
        first, times = numbers(x), 1.0
        moved = numbers(x + step) - first
        while np.linalg.norm(self.likeness.whitened(moved, first)) < _SHOWS and times < _LONGEST:
            times *= 2
            moved = numbers(x + times * step) - first
        return moved / times

    def errors(self, piece: ScatterPiece, every: Sequence[EffectSetting]) -> dict[str, tuple[float, float]]:
        """Return sds below and above the parameters that were fitted, from how the statistics follow each.

        The effect's other parameters are in doubt, too, fitted or not: as far as is usual. So is its form.
        """
        setting = piece.setting
        shapes = {p.name for p in piece.effect.parameters if (setting.id, p.name) in self._shapes}
        parameters = self._parameters(piece.effect)
        usual = shapes | {p.name for p in parameters if p.name not in piece.free}
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
            first, second = (self.likeness.whitened(change, middle) for change in high - low)
            change, chance = 0.5 * (first + second), 0.25 * float((first - second) @ (first - second))
            sure = np.sqrt(max(1 - chance / max(float(change @ change), 1e-9), 0.0))  # other draws alone differ, too
            slopes.append(sure * change / (ends[1] - ends[0]))
        j = np.array(slopes).T
        scale = np.array([p.scale for p in parameters])
        prior = np.array([1.0 if p.name in usual else 1e-4 for p in parameters])
        inverse = np.linalg.inv((j * scale).T @ (j * scale) + np.diag(prior))
        sds = np.sqrt(np.diag(inverse)) * scale
        form = np.array([_of_form(piece, p) if p.name not in shapes else (0.0, 0.0) for p in parameters])
        both = np.hypot(sds[:, np.newaxis], form).tolist()
        return {p.name: (low, high) for p, (low, high) in zip(parameters, both, strict=True) if p.name in piece.free}


def _between(pushes: Sequence[StatisticsChange]) -> Iterator[StatisticsChange]:
    """Yield what sizes of a parameter between those that were simulated do, as if the statistics followed them evenly.

    Of two forms of an effect that which happens to be met by one of the sizes would seem the better one.
    """
    ordered = sorted(pushes, key=lambda push: (push.name, push.value))
    for low, high in pairwise(ordered):
        if low.name == high.name:
            for share in _PARTS:
                change = (1 - share) * low.change + share * high.change
                yield replace(low, value=(1 - share) * low.value + share * high.value, change=change)


def _of_form(piece: ScatterPiece, p: Parameter) -> tuple[float, float]:
    """Return the sds below and above a parameter by which another form passes for another size.

    What cannot change its sign is off by a factor either way, of anything else as much of its size.
    """
    size = abs(piece.setting.parameters[p.name] - p.null) * piece.effect.empirical / NORMAL90
    below = (1 - 1 / _OTHER) * size
    return below, (_OTHER - 1) * size if p.lower >= p.null else below


def _least(p: Parameter) -> float:
    """Return what a further parameter must bring [nat]."""
    return _FREE if p.null > 0 else 0.5 * Z_LOW**2


def _step(p: Parameter, value: float) -> float:
    """Return by how far a parameter is moved to see what it does: what may have either sign can cross zero."""
    share = 0.3 * abs(value - p.null)
    return max(share, 0.1 * p.scale) if p.lower < p.null else share or 0.1 * p.scale


def _sizes(p: Parameter) -> list[float]:
    """Return values to try for a parameter, off its null."""
    values = [p.null + sign * size * p.scale for size in _SIZES for sign in (1.0, -1.0)]
    return [value for value in values if p.lower <= value <= p.upper]

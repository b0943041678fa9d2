# SPDX-License-Identifier: BSD-3-Clause
"""Effects that change how readings scatter, not their mean: likelihood of statistics, simulated with the very effects.

As for the chair, single effects propose, and the evidence of the sets that are fitted decides. The likeliest set is
gone on from, and so is the likeliest that does without each of its effects: two may do together what that one does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from operator import attrgetter

import numpy as np
from scipy.special import expit, softmax

from kurumaisu import effects
from kurumaisu.critic.scatter.scatter_fit import RoughFit, ScatterFit, ScatterPiece, StatisticsChange
from kurumaisu.critic.values.policy import log_prior, occam
from kurumaisu.critic.values.story import Comparison
from kurumaisu.effects import Mechanism
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_QUIET = 3.5  # sds that some statistic must be off by before any effect is tried
_ENOUGH = 5.0  # nats of evidence from which an effect is taken; nulls reach 3
_LEFT = 0.02  # share of an effect's evidence that its own form may leave to one that changes the same numbers
_MOST_LEFT = 15.0  # nats at most: ten numbers off by twice what the likelihood allows for another form
_CURVE_LEFT = 0.1  # share of a curve's evidence likewise: nobody knows whether noise is added or multiplied there
_LARGEST = 6  # effects in a set
_REFITS = 3  # effects whose sizes are fitted beside a set
_PROMISED = 3.0  # nats that such an effect must promise
_CLOSE = 0.35  # share likewise, of what the best of them promises
_HOPELESS = 30.0  # nats by which a set may promise a worse fit than the likeliest has: changes are no sums
_COMPARED = 10  # simulations with the effects, for the report
_score = attrgetter("score")
EffectSet = frozenset[type[Mechanism]]


@dataclass(frozen=True)
class ScatterEffect:
    """Effects on the scatter: a setting each, with the posterior, the log evidence, and sds below and above parameters.

    rivals: posterior of effects that may act in its place.
    """

    setting: EffectSetting
    p: float
    nats: float
    sds: Mapping[str, tuple[float, float]]
    rivals: Mapping[str, float]


@dataclass(frozen=True)
class _Fitted:
    """A fitted set: its effects, the misfit [nat], the log evidence, and that less what each effect must bring."""

    pieces: tuple[ScatterPiece, ...]
    cost: float
    nats: float
    score: float

    @property
    def effects(self) -> EffectSet:
        return frozenset(piece.effect for piece in self.pieces)

    @property
    def settings(self) -> list[EffectSetting]:
        return [piece.setting for piece in self.pieces]


class ScatterSearch:
    """Finds the effects that the statistics call for."""

    def __init__(self, fit: ScatterFit, curve: float = 0.0) -> None:
        """Take the fit; curve: evidence [nat] of a curve in the model, which misses steps, and what noise is like."""
        self._fit, self._enough = fit, max(_MOST_LEFT, _CURVE_LEFT * curve) if curve > 0 else _ENOUGH
        self._likeness = self._fit.likeness
        self._known: dict[EffectSet, _Fitted] = {}

    def run(self) -> list[ScatterEffect]:
        """Return the effects of the likeliest set."""
        if not self._off(self._likeness.offset):
            return []
        pushes = list(self._fit.pushes())
        self._keep(self._weighed((), self._fit.misfit(())))
        gone_on: set[EffectSet] = set()
        while True:
            best = max(self._known.values(), key=_score)
            ways = [one for one in (best, *self._without_each(best)) if one.effects not in gone_on]
            if not ways:
                return self._told(best)
            gone_on.add(ways[0].effects)
            for new in self._proposed(pushes, ways[0], best):
                self._keep(new)

    def compared(self, names: Sequence[str], settings: Sequence[EffectSetting]) -> Comparison:
        """Return the statistics of the measured scans and of simulated ones without and with effects."""
        extended = self._fit.statistics(settings, range(1, _COMPARED + 1))
        blamed = " + ".join(setting.id for setting in settings)
        known = self._likeness
        return Comparison(blamed, tuple(names), known.measured, known.offset, extended, known.sd)

    def _without_each(self, best: _Fitted) -> Iterator[_Fitted]:
        """Yield the best sets that do without one of a set's effects: what its evidence is held against."""
        for piece in best.pieces:
            yield max((one for one in self._known.values() if piece.effect not in one.effects), key=_score)

    def _off(self, numbers: FloatArray) -> bool:
        """Return whether the measured statistics are off simulated ones by more than chance."""
        units = self._likeness.units
        return bool(np.abs(units(self._likeness.measured) - units(numbers)).max() >= _QUIET)

    def _keep(self, new: _Fitted) -> None:
        """Keep a fitted set, if no likelier fit of it is known."""
        known = self._known.get(new.effects)
        if known is None or new.score > known.score:
            self._known[new.effects] = new

    def _proposed(self, pushes: Sequence[StatisticsChange], known: _Fitted, best: _Fitted) -> Iterator[_Fitted]:
        """Yield a set without one of its effects each, and with those that promise most beside it, to be the best."""
        for piece in known.pieces if len(known.pieces) > 1 else ():
            left, cost = self._fit.together([one for one in known.pieces if one is not piece], ())
            yield self._weighed(left, cost)
            for i, one in enumerate(left):  # in another shape it may do what the one that is gone did
                others = [*left[:i], *left[i + 1 :]]
                shaped, misfit = self._fit.shaped(one, cost, [other.setting for other in others])
                if shaped is not one:
                    yield self._weighed([*others, shaped], misfit)
        if len(known.pieces) == _LARGEST:
            return
        starts = sorted(self._starts(pushes, known), key=lambda forms: forms[0].low)[:_REFITS]
        for start in chain(*starts):
            gain = known.cost - start.low
            if gain < max(_PROMISED, _CLOSE * (known.cost - starts[0][0].low)) or start.low > best.cost + _HOPELESS:
                continue
            piece, cost = self._fit.alone(start, known.settings)
            group = [*known.pieces, piece]
            if known.pieces:
                group, cost = self._fit.together(group, ())
            yield self._weighed(group, cost)

    def _starts(self, pushes: Sequence[StatisticsChange], known: _Fitted) -> Iterator[list[RoughFit]]:
        """Yield rough sizes of each form of each other effect beside a set, the best first.

        Or those that it was fitted with in another set. A form may lack a shape yet, by which it is the better one.
        """
        at, plain = (self._fit.statistics(settings, (1, 2)) for settings in (known.settings, ()))
        ranked = sorted(self._known.values(), key=_score)
        fitted = {piece.effect: piece for one in ranked for piece in one.pieces}  # as in the likeliest set
        for effect in self._fit.candidates(set(known.effects)):
            found = []
            if own := [push for push in pushes if push.effect is effect]:
                found += self._fit.rough(own, at)
            if piece := fitted.get(effect):
                change = self._fit.statistics((piece.setting,), (1, 2)) - plain
                found.append(piece.start(self._likeness.cost(at + change)))
            if found:
                yield sorted(found, key=attrgetter("low"))

    def _weighed(self, pieces: Sequence[ScatterPiece], cost: float) -> _Fitted:
        """Return a fitted set with its evidence beside that of none; cost: its misfit [nat]."""
        count, weighed = len(effects.LASER), []
        for piece in pieces:
            gain = self._fit.misfit([one.setting for one in pieces if one is not piece]) - cost
            paid = float(occam(np.sqrt(max(2 * gain, 0.0)))) + piece.price - log_prior(1, count) + log_prior(0, count)
            weighed.append((replace(piece, nats=gain - paid), paid))
        nats = self._fit.misfit(()) - cost - sum(paid for _, paid in weighed)
        out = tuple(piece for piece, _ in weighed)
        return _Fitted(out, cost, nats, nats - sum(self._least(out, piece) for piece in out))

    def _least(self, pieces: Sequence[ScatterPiece], new: ScatterPiece) -> float:
        """Return the evidence from which an effect is taken beside others [nat]: they may act in another form."""
        stronger = [piece for piece in pieces if piece.nats > new.nats]
        left = (_LEFT * piece.nats * self._fit.overlap(piece, new) ** 2 for piece in stronger)
        return max([self._enough, *(min(_MOST_LEFT, nats) for nats in left)])

    def _told(self, best: _Fitted) -> list[ScatterEffect]:
        """Return the effects of a set, each weighed against all sets that were fitted.

        Where the whole does not fit, evidence for a part of it is worth as much less.
        """
        heat = self._likeness.heat(self._fit.statistics(best.settings, (1, 2)))
        out = []
        for piece in best.pieces:
            others = best.effects - {piece.effect}
            nats = best.nats - max(one.nats for one in self._known.values() if one.effects <= others)
            some = float(expit(nats / heat))
            # Of sets in which it acts, or something in its place.
            every = [one for one in self._known.values() if not one.effects <= others]
            shares = softmax([one.score / heat for one in every]) * some
            own = float(sum(p for p, one in zip(shares, every, strict=True) if piece.effect in one.effects))
            rivals = dict[str, float]()
            for p, one in zip(shares.tolist(), every, strict=True):
                for effect in one.effects - best.effects if piece.effect not in one.effects else ():
                    rivals[effect.id] = rivals.get(effect.id, 0.0) + p
            out.append(ScatterEffect(piece.setting, own, nats, self._fit.errors(piece, best.settings), rivals))
        return out

# SPDX-License-Identifier: BSD-3-Clause
"""Effects that change how readings scatter, not their mean: likelihood of statistics, simulated with the very effects.

One effect is added at a time; those that change the same numbers are then fitted together, and what is no longer needed
goes. What seemed to act when its company was not yet known is weighed against its rivals again at the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter

import numpy as np
from scipy.special import logsumexp

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
_WEAK = 0.05  # share of the strongest effect's evidence, from which another one is beyond doubt
_LARGEST = 6  # effects in a set
_REFITS = 4  # effects that are refitted
_CLOSE = 0.35  # share of what the best of them gains that another one must gain, to be refitted
_COMPARED = 10  # simulations with the effects, for the report
_OVERLAP = 0.3  # cosine of two effects' changes of the statistics, from which they are fitted together


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


_cost, _nats = itemgetter(1), attrgetter("nats")  # of what was fitted; of a piece


def _without_piece(pieces: Sequence[ScatterPiece], one: ScatterPiece) -> list[ScatterPiece]:
    return [piece for piece in pieces if piece.effect is not one.effect]


def _of_any(piece: ScatterPiece) -> float:
    """Return the evidence [nat] that a piece or one of its rivals acts."""
    return float(logsumexp([piece.nats, *(rival.nats for rival in piece.rivals)]))


def _by_effect(pieces: Sequence[ScatterPiece]) -> list[list[ScatterPiece]]:
    """Return the pieces of each effect."""
    effects_there = dict.fromkeys(piece.effect for piece in pieces)
    return [[piece for piece in pieces if piece.effect is effect] for effect in effects_there]


class ScatterSearch:
    """Finds the effects that the statistics call for."""

    def __init__(self, fit: ScatterFit, curve: float = 0.0) -> None:
        """Take the fit; curve: evidence [nat] of a curve in the model, which misses steps, and what noise is like."""
        self._fit, self._enough = fit, max(_MOST_LEFT, _CURVE_LEFT * curve) if curve > 0 else _ENOUGH
        self._likeness = self._fit.likeness

    def run(self) -> list[ScatterEffect]:
        """Return the effects, added while the evidence grows."""
        if not self._off(self._likeness.offset):
            return []
        pushes = list(self._fit.pushes())
        chosen: list[ScatterPiece] = []
        gone: set[type[Mechanism]] = set()
        while len(chosen) < _LARGEST:
            new = self._step(pushes, chosen, gone)
            if new is None or new.nats < self._least(chosen, new):
                break
            chosen = self._straightened(pushes, self._settled(pushes, chosen, new, gone))
        chosen = self._certain(self._polished(chosen))
        settings = [piece.setting for piece in chosen]
        return [
            ScatterEffect(
                piece.setting,
                piece.p,
                piece.nats,
                self._fit.errors(piece, settings),
                {rival.setting.id: rival.p for rival in piece.rivals},
            )
            for piece in chosen
        ]

    def compared(self, names: Sequence[str], settings: Sequence[EffectSetting]) -> Comparison:
        """Return the statistics of the measured scans and of simulated ones without and with effects."""
        extended = self._fit.statistics(settings, range(1, _COMPARED + 1))
        blamed = " + ".join(setting.id for setting in settings)
        known = self._likeness
        return Comparison(blamed, tuple(names), known.measured, known.offset, extended, known.sd)

    def _off(self, numbers: FloatArray) -> bool:
        """Return whether the measured statistics are off simulated ones by more than chance."""
        units = self._likeness.units
        return bool(np.abs(units(self._likeness.measured) - units(numbers)).max() >= _QUIET)

    def _heat(self, settings: Sequence[EffectSetting]) -> float:
        return self._likeness.heat(self._fit.statistics(settings, (1, 2)))

    def _step(
        self, pushes: Sequence[StatisticsChange], chosen: Sequence[ScatterPiece], gone: set[type[Mechanism]]
    ) -> ScatterPiece | None:
        """Return the effect to add; None where there is too little."""
        beside = [piece.setting for piece in chosen]
        at = self._fit.statistics(beside, (1, 2))
        here = self._likeness.cost(at)
        without = {*gone, *(piece.effect for piece in chosen)}
        by_effect = {
            effect: [push for push in pushes if push.effect is effect] for effect in self._fit.candidates(without)
        }
        starts = [self._fit.rough(own, at) for own in by_effect.values() if own]
        starts = sorted((start for start in starts if start.low < here), key=attrgetter("low"))
        tried: list[ScatterPiece] = []
        for start in starts[:_REFITS]:
            if here - start.low < _CLOSE * (here - starts[0].low):
                break
            piece, misfit = self._fit.alone(start, beside)
            tried.append(_valued(piece, here - misfit))
        best = _weighed(tried) if tried else None
        if (best is None or best.nats < self._least(chosen, best)) and self._off(at):
            tried = [*tried, *self._halved(chosen, without, here)]
            best = _weighed([max(same, key=_nats) for same in _by_effect(tried)]) if tried else None
        if best is None or best.nats < 0:
            return None
        return _weighed([best, *best.rivals], self._heat([*beside, best.setting]))

    def _halved(
        self, chosen: Sequence[ScatterPiece], without: set[type[Mechanism]], here: float
    ) -> Iterator[ScatterPiece]:
        """Yield rivals of the chosen effects, each fitted together with the one that was taken for it.

        Of two that act, each alone explains nearly all, and the other one added to that much of it then nothing.
        """
        for piece in chosen:
            beside = [other.setting for other in chosen if other is not piece]
            for rival in piece.rivals:
                if rival.effect not in without and self._fit.overlap(piece, rival) > _OVERLAP:
                    new, misfit = self._fit.halves(piece, rival, beside)
                    yield _valued(new, here - misfit)

    def _straightened(self, pushes: Sequence[StatisticsChange], chosen: Sequence[ScatterPiece]) -> list[ScatterPiece]:
        """Return the pieces, those of several parameters begun anew with the plainest where that is better.

        Before the others were known, its further parameters may have bent to do what they do: beams that are lost where
        they meet walls obliquely, say, hide that these are read noisily. No small step leads back from there.
        """
        out = list(chosen)
        for i, old in enumerate(chosen):
            beside = [piece.setting for piece in out if piece.effect is not old.effect]
            if len(old.free) < 2 or not beside:
                continue
            plain = self._fit.plain(self._begun(pushes, old, beside))
            (new,), cost = self._fit.together([plain], beside)
            if cost + new.price < self._fit.misfit([*beside, old.setting]) + old.price:
                out[i] = replace(old, setting=new.setting, free=new.free)
        return out

    def _begun(
        self, pushes: Sequence[StatisticsChange], piece: ScatterPiece, beside: Sequence[EffectSetting]
    ) -> RoughFit:
        """Return rough sizes of a piece's effect beside others, whatever it had been fitted to."""
        own = [push for push in pushes if push.effect is piece.effect]
        return self._fit.rough(own, self._fit.statistics(beside, (1, 2)))

    def _certain(self, chosen: Sequence[ScatterPiece]) -> list[ScatterPiece]:
        """Return the pieces weighed in the company that is there last, without those that it makes superfluous."""
        if len(chosen) < 2:
            return list(chosen)
        known = {piece.effect: piece.rivals for piece in chosen}
        while True:
            weighed = self._reweighed(chosen)
            weak = [piece for piece in weighed if _of_any(piece) < self._least(_without_piece(weighed, piece), piece)]
            if not weak or len(weighed) < 2:
                return weighed
            left = [
                replace(one, rivals=known.get(one.effect, ())) for one in _without_piece(weighed, min(weak, key=_nats))
            ]
            chosen = self._polished(left)

    def _reweighed(self, chosen: Sequence[ScatterPiece]) -> list[ScatterPiece]:
        """Return the pieces, each weighed against its rivals and none beside all others, not known when it came.

        Where the whole does not fit, evidence for another part of it is worth as much less, that it acts, too.
        """
        out = list(chosen)
        for i, piece in enumerate(chosen):
            others = _without_piece(out, piece)
            there = {other.effect for other in others}
            beside = [other.setting for other in others]
            without = self._without(piece, others)
            rivals = [rival for rival in piece.rivals if rival.effect not in there]
            tried = [self._fit.together([one], beside) for one in (piece, *rivals)]
            valued = [_valued(one, without - misfit) for (one,), misfit in tried]
            heat = self._heat([*beside, max(valued, key=_nats).setting])
            out[i] = _weighed(valued, heat, heat)
        swapped = any(one.effect is not other.effect for one, other in zip(out, chosen, strict=True))
        return self._polished(out) if swapped else out

    def _without(self, piece: ScatterPiece, others: Sequence[ScatterPiece]) -> float:
        """Return the misfit of the others without a piece, those like it fitted to what it would leave them."""
        like = [other for other in others if self._fit.overlap(other, piece) > _OVERLAP]
        rest = [other.setting for other in others if other not in like]
        return self._fit.together(like, rest)[1] if like else self._fit.misfit(rest)

    def _least(self, chosen: Sequence[ScatterPiece], new: ScatterPiece) -> float:
        """Return the evidence from which an effect is taken beside others [nat]: they may act in another form."""
        left = (_LEFT * piece.nats * self._fit.overlap(piece, new) ** 2 for piece in chosen)
        return max(self._enough, *(min(_MOST_LEFT, nats) for nats in left)) if chosen else self._enough

    def _settled(
        self,
        pushes: Sequence[StatisticsChange],
        chosen: Sequence[ScatterPiece],
        new: ScatterPiece,
        gone: set[type[Mechanism]],
    ) -> list[ScatterPiece]:
        """Return the pieces with a new one, fitted together with those like it; what it makes superfluous is gone."""
        like = [piece for piece in chosen if self._fit.overlap(piece, new) > _OVERLAP]
        rest = [piece for piece in chosen if piece not in like]
        if not like:
            return [*chosen, new]
        beside = [piece.setting for piece in rest]
        group, cost = self._fit.together([*like, new], beside)
        for old in like:
            fewer, more = min(self._without_it(pushes, _without_piece(group, old), beside), key=_cost)
            z = np.sqrt(max(2 * (more - cost), 0.0))
            nats = more - cost - float(occam(np.array(z))) - old.price
            if nats < _ENOUGH:
                group, cost = fewer, more
                gone.add(old.effect)
            else:
                group = [replace(piece, nats=nats) if piece.effect is old.effect else piece for piece in group]
        return [*rest, *group]

    def _without_it(
        self, pushes: Sequence[StatisticsChange], left: Sequence[ScatterPiece], beside: Sequence[EffectSetting]
    ) -> Iterator[tuple[list[ScatterPiece], float]]:
        """Yield fits of those that are left of a group, and their misfits: as they are, and one of them begun anew.

        Beside the one that is gone, their further parameters did what it did not.
        """
        yield self._fit.together(left, beside)
        for piece in left:
            others = _without_piece(left, piece)
            known = (*beside, *(other.setting for other in others))
            one, cost = self._fit.alone(self._begun(pushes, piece, known), known)
            yield [*others, replace(piece, setting=one.setting, free=one.free)], cost

    def _polished(self, chosen: Sequence[ScatterPiece]) -> list[ScatterPiece]:
        """Return all pieces fitted together, without weak ones that stood in for wrong sizes of others."""
        if len(chosen) < 2:
            return list(chosen)
        group, cost = self._fit.together(chosen, ())
        strong = max(piece.nats for piece in group)
        for old in sorted(group, key=lambda piece: piece.nats):
            others = [piece for piece in group if piece.effect is not old.effect]
            # What it was worth when it came: the others were not yet fitted as well as now.
            still = self._fit.misfit([piece.setting for piece in others]) - cost
            if not others or (old.nats > _WEAK * strong and still >= self._least(others, old)):
                continue
            fewer, more = self._fit.together(others, ())
            z = np.sqrt(max(2 * (more - cost), 0.0))
            if more - cost - float(occam(np.array(z))) - old.price < self._least(others, old):
                group, cost = fewer, more
        return group


def _valued(piece: ScatterPiece, gain: float) -> ScatterPiece:
    """Return a piece with its log evidence, for what it gains [nat] of log likelihood."""
    count, z = len(effects.LASER), np.sqrt(max(2 * gain, 0.0))
    cost = float(occam(np.array(z))) + piece.price
    return replace(piece, nats=gain - cost + log_prior(1, count) - log_prior(0, count))


def _weighed(tried: Sequence[ScatterPiece], heat: float = 1.0, doubt: float = 1.0) -> ScatterPiece:
    """Return the likeliest of some pieces with its posterior, and the others as its rivals with theirs.

    heat: by how much what the likeliest leaves is more than chance [1]; where none of them fits, odds between them are
    worth as much less. doubt: likewise, of the odds that any of them acts.
    """
    nats = np.array([piece.nats for piece in tried])
    some = -np.expm1(-logsumexp([0.0, *(nats / doubt)]))
    shares = some * np.exp(nats / heat - logsumexp(nats / heat))
    every = [replace(piece, p=float(p), rivals=()) for piece, p in zip(tried, shares, strict=True)]
    best = max(every, key=_nats)
    return replace(best, rivals=tuple(piece for piece in every if piece is not best))

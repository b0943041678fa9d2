# SPDX-License-Identifier: BSD-3-Clause
"""First values of parameters whose derivative says little: what every size does to the rates, weighed at once.

The steps of a converter fit the voltages of a drive at one size and miss them at the next, so the likelihood of the
size is a comb. What a change of the rates does to the reference is linear, though: worked out once for short times,
it tells what any change would explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic import replay
from kurumaisu.critic.catalogue import Term, settings_of
from kurumaisu.critic.drive import GRID, Drive
from kurumaisu.critic.noise import Noise, whitened
from kurumaisu.critic.smooth_columns import Sensitivity
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_CELLS = 20  # of the grid for which a change of the rates is held
_TOTAL, _LEAST = 180.0, 10.0  # [s] of all drives, and of one drive at least: a first value needs no more
_ALIKE = (0.4, 0.8)  # correlation of neighbouring sizes: below, there is one between them; above, they may be farther
_SHOWS = 3.0  # whitened norm below which nobody can see a size
_GROWTH = (1e-4, 0.2)  # from one size to the next, as a share: least and most
_SIZES = 500  # at most
_BEST = 8  # that are tried


Way = tuple[object, ...]  # an effect's parameter, with the form in which it acts
Walked = dict[Way, list[tuple[float, Sequence[FloatArray]]]]


@dataclass(frozen=True)
class _Size:
    """A value; what it adds to v and w in the bins of each drive, and of all, (bins,); gram @ that; its square."""

    value: float
    changes: Sequence[FloatArray]
    change: FloatArray
    gram: FloatArray
    square: float


class Comb:
    """What changes of the rates explain in some drives, about the model without effects."""

    def __init__(self, drives: Sequence[Drive], model: Model, noise: Noise, walked: Walked) -> None:
        """Take the beginnings of the drives; walked: what sizes have been found to do, whatever the noise."""
        self._model, self._walked = model, walked
        share = max(_TOTAL / len(drives), _LEAST)
        self._drives = [_begin(drive, share) for drive in drives[: int(_TOTAL / share)]]
        self._plain = [replay.motion(drive, model, ()) for drive in self._drives]
        self._columns: list[FloatArray] = []
        for drive, plain in zip(self._drives, self._plain, strict=True):
            held = np.repeat(np.eye(-(-len(drive.v) // _CELLS)), _CELLS, axis=0)[: len(drive.v)]
            sensitivity = Sensitivity(drive, plain)
            both = np.column_stack([sensitivity.increments(channel, held) for channel in ("v", "w")])
            self._columns.append(whitened(drive, both, noise)[0])
        self._grams = [columns.T @ columns for columns in self._columns]
        self._known: dict[Way, list[_Size]] = {}

    def starts(self, term: Term, fixed: Sequence[Term], residual: Sequence[FloatArray]) -> list[tuple[float, float]]:
        """Return the most promising values of a term beside fixed ones, and how far the next ones are from each.

        residual: whitened, of each drive.
        """
        key = (term.key, *((other.key, other.parameter.lower) for other in fixed))
        if key not in self._known:
            if key in self._walked:
                self._known[key] = [self._marked(value, changes) for value, changes in self._walked[key]]
            else:
                self._known[key] = list(self._walk(term, fixed))
                self._walked[key] = [(size.value, size.changes) for size in self._known[key]]
        sizes = self._known[key]
        if not sizes:
            return []
        pull = np.concatenate([c.T @ r[: len(c)] for c, r in zip(self._columns, residual, strict=False)])
        gained = np.array([float(size.change @ pull) - 0.5 * size.square for size in sizes])
        peaks = np.flatnonzero((gained >= np.append(gained[1:], -np.inf)) & (gained >= np.append(-np.inf, gained[:-1])))
        best = peaks[np.argsort(-gained[peaks])][:_BEST]
        apart = np.diff([size.value for size in sizes], append=1.1 * sizes[-1].value)
        return [(sizes[k].value, float(abs(apart[k]))) for k in best]

    def _walk(self, term: Term, fixed: Sequence[Term]) -> Iterator[_Size]:
        """Yield sizes from where they show on, as far apart as their marks differ; either way where there are two."""
        p = term.parameter
        for sign, room in ((-1.0, term.null - p.lower), (1.0, p.upper - term.null)):
            if room > 0:
                yield from self._one_way(term, fixed, sign, room)

    def _one_way(self, term: Term, fixed: Sequence[Term], sign: float, room: float) -> Iterator[_Size]:
        size, growth = abs(term.step) * term.parameter.scale / 4, _GROWTH[1]
        before: _Size | None = None
        for _ in range(_SIZES):
            if size > room:
                return
            value = term.null + sign * size
            here = self._marked(value, self._change(term, fixed, value))
            if here.square < _SHOWS**2:
                size *= 1 + _GROWTH[1] / 2
                continue
            alike = 1.0 if before is None else float(before.gram @ here.change) / np.sqrt(before.square * here.square)
            if alike < _ALIKE[0] and growth > _GROWTH[0]:
                size, growth = size / (1 + growth) * (1 + growth / 2), growth / 2
                continue
            yield here
            before = here
            growth = min(1.5 * growth, _GROWTH[1]) if alike > _ALIKE[1] else growth
            size *= 1 + growth

    def _marked(self, value: float, changes: Sequence[FloatArray]) -> _Size:
        gram = np.concatenate([gram @ change for gram, change in zip(self._grams, changes, strict=True)])
        change = np.concatenate(changes)
        return _Size(value, changes, change, gram, float(change @ gram))

    def _change(self, term: Term, fixed: Sequence[Term], value: float) -> list[FloatArray]:
        terms = (term, *fixed)
        settings = settings_of(terms, np.array([value, *(other.parameter.lower for other in fixed)]))
        moved = [replay.motion(drive, self._model, settings) for drive in self._drives]
        pairs = zip(moved, self._plain, strict=True)
        return [np.concatenate([_means(a.v - b.v), _means(a.w - b.w)]) for a, b in pairs]


def _begin(drive: Drive, seconds: float) -> Drive:
    """Return so much of a drive from its start on."""
    count = max(int(np.searchsorted(drive.times, drive.times[0] + seconds, side="right")), 3)
    cells = min(int((drive.times[:count][-1] - drive.start) / GRID) + 2, len(drive.v))
    known = {name: values[:cells] for name, values in drive.known.items()}
    short = replace(drive, v=drive.v[:cells], w=drive.w[:cells], known=known)
    return short.seen_at(drive.times[:count], drive.poses[:count])


def _means(values: FloatArray) -> FloatArray:
    """Return the means over bins; the last one may be short."""
    starts = np.arange(0, len(values), _CELLS)
    return np.asarray(np.add.reduceat(values, starts) / np.diff(np.append(starts, len(values))))

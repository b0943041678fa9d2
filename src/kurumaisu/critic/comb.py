# SPDX-License-Identifier: BSD-3-Clause
"""First values of parameters whose derivative says little: what every size does to the rates, weighed at once.

The steps of a converter fit the voltages of a drive at one size and miss them at the next, so the likelihood of the
size is a comb. What a change of the rates does to the reference is linear, though: worked out once for short times,
it tells what any change would explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic import replay
from kurumaisu.critic.catalogue import Term, settings_of
from kurumaisu.critic.drive import GRID, Drive, split
from kurumaisu.critic.noise import Noise, whitened
from kurumaisu.critic.smooth_columns import Sensitivity
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_BIN = 0.2  # [s] for which a change of the rates is held
_PIECE = 60.0  # [s] of a drive that is weighed at once
_PIECES = 8  # at most: a first value needs no more
_ALIKE = (0.6, 0.9)  # correlation of neighbouring sizes: below, there is one between them; above, they may be farther
_SHOWS = 3.0  # whitened norm below which nobody can see a size
_GROWTH = (1e-4, 0.3)  # from one size to the next, as a share: least and most
_SIZES = 900  # at most
_BEST = 8  # that are tried


@dataclass(frozen=True)
class _Size:
    """A value with what it adds to v and w in all bins, (bins,); gram @ that; and its squared whitened norm."""

    value: float
    change: FloatArray
    gram: FloatArray
    square: float


class Comb:
    """What changes of the rates explain in some drives, about the model without effects."""

    def __init__(self, drives: Sequence[Drive], model: Model, noise: Noise) -> None:
        self._drives, self._model = drives, model
        self._plain = [replay.motion(drive, model, ()) for drive in drives]
        self._rows: list[tuple[int, slice]] = []  # of the whole residual: the drive, and the rows of the piece
        self._bins: list[tuple[int, int, int]] = []  # of each piece: the drive, its first cell, cells for each bin
        self._columns: list[FloatArray] = []
        self._grams: list[FloatArray] = []
        self._known: dict[tuple[object, ...], list[_Size]] = {}
        for i, drive in enumerate(drives):
            parts = max(1, round((drive.times[-1] - drive.times[0]) / _PIECE))
            at = 0
            for piece in split(drive, parts):
                count = 3 * (len(piece.times) - 1)
                if len(self._columns) < _PIECES:
                    self._add(i, piece, noise, slice(at, at + count))
                at += count

    def _add(self, i: int, piece: Drive, noise: Noise, rows: slice) -> None:
        cells = round(_BIN / GRID)
        first = max(0, int((piece.times[0] - piece.start) / GRID))
        last = min(len(piece.v), int((piece.times[-1] - piece.start) / GRID) + 1)
        count = -(-(last - first) // cells)
        held = np.zeros((len(piece.v), count))
        held[np.arange(first, last), (np.arange(first, last) - first) // cells] = 1.0
        sensitivity = Sensitivity(piece, self._plain[i])
        both = np.column_stack([sensitivity.increments(channel, held) for channel in ("v", "w")])
        self._columns.append(whitened(piece, both, noise)[0])
        self._grams.append(self._columns[-1].T @ self._columns[-1])
        self._rows.append((i, rows))
        self._bins.append((i, first, last))

    def starts(self, term: Term, fixed: Sequence[Term], residual: Sequence[FloatArray]) -> list[float]:
        """Return the most promising values of a term beside fixed ones; residual: whitened, of each drive."""
        key = (term.key, *((other.key, other.parameter.lower) for other in fixed))
        if key not in self._known:
            self._known[key] = list(self._walk(term, fixed))
        sizes = self._known[key]
        pull = np.concatenate([c.T @ residual[i][rows] for c, (i, rows) in zip(self._columns, self._rows, strict=True)])
        gained = np.array([float(size.change @ pull) - 0.5 * size.square for size in sizes])
        peaks = np.flatnonzero((gained >= np.append(gained[1:], -np.inf)) & (gained >= np.append(-np.inf, gained[:-1])))
        return [sizes[k].value for k in peaks[np.argsort(-gained[peaks])][:_BEST]]

    def _walk(self, term: Term, fixed: Sequence[Term]) -> Iterator[_Size]:
        """Yield sizes from where they show on, as far apart as their marks differ."""
        p, size, growth = term.parameter, term.step * term.parameter.scale / 4, _GROWTH[1]
        before: _Size | None = None
        for _ in range(_SIZES):
            value = term.null + size
            if not p.lower <= value <= p.upper:
                return
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
        return _Size(value, change, gram, float(change @ gram))

    def _change(self, term: Term, fixed: Sequence[Term], value: float) -> list[FloatArray]:
        terms = (term, *fixed)
        settings = settings_of(terms, np.array([value, *(other.parameter.lower for other in fixed)]))
        moved = [replay.motion(drive, self._model, settings) for drive in self._drives]
        out = []
        for i, first, last in self._bins:
            differences = (moved[i].v - self._plain[i].v, moved[i].w - self._plain[i].w)
            out.append(np.concatenate([_means(d[first:last]) for d in differences]))
        return out


def _means(values: FloatArray) -> FloatArray:
    """Return the means over bins; the last one may be short."""
    starts = np.arange(0, len(values), round(_BIN / GRID))
    return np.asarray(np.add.reduceat(values, starts) / np.diff(np.append(starts, len(values))))

# SPDX-License-Identifier: BSD-3-Clause
"""What single candidates would explain of what a fit leaves: they propose what is fitted next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key, Term
from kurumaisu.critic.engine.covariance import Covariance
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.values.prior import occam
from kurumaisu.types import FloatArray

_FACTORS = (0.25, 1.0, 4.0, 16.0, 64.0)  # of a term's step: sizes that are tried first, either way
_ALIKE = 0.9  # correlation of neighbouring sizes' signals, at least
_CLOSER = 3  # times a gap is halved to reach it
_STRAIGHT = 0.998  # correlation of the least and the largest size's signals from which one stands for all
_SHARES = (0.1, 10.0)  # of a signal by which its size is mended
_NOTHING = 1e-3  # whitened norm of a signal that is none


@dataclass(frozen=True)
class Signals:
    """What a candidate does: values (n, terms), whitened signals (rows, n); of (n,): which amplitude each moves."""

    candidate: Candidate
    values: FloatArray
    columns: FloatArray
    of: FloatArray


@dataclass(frozen=True)
class Guess:
    """A candidate with first values, and what it may explain [nat], by lines, less what it costs."""

    candidate: Candidate
    start: Mapping[Key, float]
    nats: float


class Dictionary:
    """The signals of all candidates about the model, each at sizes that cover what it may do."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._here = problem.residual((), np.empty(0))
        self.signals: list[Signals] = [found for c in problem.candidates if (found := self._signals(c)) is not None]

    def _signals(self, candidate: Candidate) -> Signals | None:
        terms = candidate.terms
        nulls = np.array([term.parameter.lower if term.fixed else term.null for term in terms])
        if candidate.fixed:
            rows, columns, of = [nulls], [self._column(terms, nulls)], [-1]
        else:
            rows, columns, of = [], [], []
            for i, term in enumerate(terms):
                if term.fixed or term.shape or term.rough:
                    continue
                for values, column in self._sizes(terms, nulls, i):
                    rows.append(values)
                    columns.append(column)
                    of.append(i)
        loud = [k for k, column in enumerate(columns) if np.linalg.norm(column) > _NOTHING]
        if not loud:
            return None
        return Signals(
            candidate,
            np.array([rows[k] for k in loud]),
            np.array([columns[k] for k in loud]).T,
            np.array([of[k] for k in loud]),
        )

    def _column(self, terms: Sequence[Term], values: FloatArray) -> FloatArray:
        return np.asarray(self._here - self._problem.residual(terms, values))

    def _sizes(self, terms: Sequence[Term], nulls: FloatArray, i: int) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield values with one amplitude moved, and their signals, so close that neighbours are alike."""
        term, p = terms[i], terms[i].parameter

        def at(size: float) -> tuple[FloatArray, FloatArray]:
            values = np.where(np.arange(len(nulls)) == i, float(np.clip(term.null + size, p.lower, p.upper)), nulls)
            return values, self._column(terms, values)

        for sign in (1.0, -1.0):
            room = (p.upper - term.null) if sign > 0 else (term.null - p.lower)
            sizes = [f * abs(term.step) * p.scale for f in _FACTORS if f * abs(term.step) * p.scale < room]
            sizes = [*sizes, room] if room > 0 and (not sizes or room < 4 * sizes[-1]) else sizes
            found = [(size, *at(sign * size)) for size in sizes]
            found = [one for one in found if np.linalg.norm(one[2]) > _NOTHING]
            if not found:
                continue
            if _correlation(found[0][2], found[-1][2]) > _STRAIGHT:
                yield found[len(found) // 2][1:]
                continue
            for _ in range(_CLOSER):
                gaps = [k for k in range(len(found) - 1) if _correlation(found[k][2], found[k + 1][2]) < _ALIKE]
                for k in reversed(gaps):
                    size = float(np.sqrt(found[k][0] * found[k + 1][0]))
                    found.insert(k + 1, (size, *at(sign * size)))
                if not gaps:
                    break
            yield from (one[1:] for one in found if np.linalg.norm(one[2]) > _NOTHING)


def scan(dictionary: Dictionary, fit: Fit, also: FloatArray | None = None) -> list[Guess]:
    """Return what each candidate would explain beside a fit, best first; also (rows, k): of a curve beside it."""
    beside = fit.beside
    missed = beside.covariance
    if also is not None:
        missed = Covariance(np.column_stack([missed.columns, also]))
    inverse = beside.residual - missed.directions @ (missed.lost * (missed.directions.T @ beside.residual))
    taken = fit.ids
    guesses: list[Guess] = []
    for signals in dictionary.signals:
        if signals.candidate.id in taken:
            continue
        columns = signals.columns
        pull = columns.T @ inverse
        own = beside.own.T @ columns
        lost = missed.directions.T @ columns
        square = np.sum(columns**2, axis=0) - np.sum(own**2, axis=0) - missed.lost @ lost**2
        pull = pull - own.T @ (beside.own.T @ inverse)
        whole = np.sum(columns**2, axis=0)
        known = square > 1e-6 * whole
        z = np.where(known, pull / np.sqrt(np.maximum(square, 1e-12)), 0.0)
        guesses += _guesses(signals, z, np.where(known, pull / np.maximum(square, 1e-12), 0.0))
    return sorted(guesses, key=lambda guess: -guess.nats)


def _guesses(signals: Signals, z: FloatArray, shares: FloatArray) -> Iterator[Guess]:
    """Yield the candidate with its best size, along each of its amplitudes together; shares: of each signal."""
    terms = signals.candidate.terms
    values = np.array([term.parameter.lower if term.fixed else term.null for term in terms])
    nats = -float(np.log(signals.candidate.ways))
    for i in np.unique(signals.of):
        mine = np.flatnonzero(signals.of == i)
        best = mine[int(np.argmax(z[mine]))]
        if z[best] <= 0 and len(np.unique(signals.of)) == 1:
            return
        if i < 0:  # as it is, or not at all
            nats += (shares[best] - 0.5) * (z[best] / max(shares[best], 1e-9)) ** 2
            continue
        nats += 0.5 * max(float(z[best]), 0.0) ** 2 - float(occam(max(float(z[best]), 0.0)))
        if z[best] > 0:
            p = terms[i].parameter
            size = (signals.values[best, i] - terms[i].null) * float(np.clip(shares[best], *_SHARES))
            values[i] = np.clip(terms[i].null + size, p.lower, p.upper)
    start = {term.key: float(value) for term, value in zip(terms, values, strict=True) if not term.shape}
    yield Guess(signals.candidate, start, nats)


def _correlation(one: FloatArray, other: FloatArray) -> float:
    norms = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / norms if norms > 0 else 1.0

# SPDX-License-Identifier: BSD-3-Clause
"""First values of parameters whose derivative says little: what every size does to the rates, weighed at once.

The steps of a converter fit the voltages of a drive at one size and miss them at the next, so the likelihood of the
size has many peaks. What a change of the rates does to the reference is linear, though: worked out once for short
times, it tells what any change would explain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.base.sensitivity import Sensitivity
from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import Key, Term, settings_of
from kurumaisu.critic.noise.base_noise import Noise, whitened
from kurumaisu.effects import Motion
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

if TYPE_CHECKING:
    from kurumaisu.critic.engine.evidence import Problem

_CELLS = 20  # of the grid for which a change of the rates is held
_TOTAL, _LEAST = 180.0, 10.0  # [s] of all drives, and of one drive at least: a first value needs no more
_ALIKE = (0.4, 0.8)  # correlation of neighbouring sizes: below, there is one between them; above, they may be farther
_GROWTH = (1e-4, 0.2)  # from one size to the next, as a share: least and most
# Least way from one size to the next: by so many steps it moves the largest value that there may be. Where a voltage
# that is held crosses an edge nothing is alike, however close.
_SHIFT = 0.1
_SIZES = 900  # at most
_SEEN = 3.0  # z of a size below which there is none worth a look: what cuts off does more than what rounds
_HALVINGS = 6  # of the way between two sizes: the narrowest peaks are that much closer than rates tell
_FAINT = 0.2  # of the norm of its neighbour
_KNOTS = 8  # of a free curve over a rate, per direction
_AT = np.arange(_KNOTS)
_FEW = 0.2  # share of a change below which its peaks are not looked at by themselves
_NOTHING = 1e-9  # share of the largest direction below which it is none
_BEST = 6  # that are tried
_PRECISION = np.float32  # of what only first values come of: half the room and half the time


Way = tuple[object, ...]  # an effect's parameter, with the form in which it acts
Walk = tuple[float, FloatArray]  # a size with what it changes, (bins,)
Walked = dict[Way, tuple[FloatArray, FloatArray]]  # sizes (k,), and what each changes, (k, bins)
_STARTS = (1.0, 4.0, 16.0)  # steps from null, either way, from which a fit may start
_PLACES = 17  # that are tried on a peak
_ROUNDS, _BETTER = 8, 0.1  # how often a peak is left for a likelier one close by, and by how much that is so [nat]
STEP_EVIDENCE = 4.0  # [nat] less is not worth a closer look: a peak costs more


@dataclass(frozen=True)
class StepSize:
    """A value; how far the next one that was weighed is from it; what it explains, in nats, as far as lines go."""

    value: float
    apart: float
    nats: float


class StepLikelihood:
    """What changes of the rates explain in some drives, about the model without effects."""

    def __init__(self, drives: Sequence[Drive], model: Model, noise: Noise, walked: Walked) -> None:
        """Take the beginnings of the drives; walked: what sizes have been found to do, whatever the noise."""
        self._model, self._walked = model, walked
        share = max(_TOTAL / len(drives), _LEAST)
        self._drives = [_begin(drive, share) for drive in drives[: int(_TOTAL / share)]]
        self._plain = [replay.motion(drive, model, ()) for drive in self._drives]
        self._columns: list[FloatArray] = []
        for drive, plain in zip(self._drives, self._plain, strict=True):
            cells = np.arange(len(drive.v))
            held = csr_array((np.ones(len(cells)), (cells, cells // _CELLS)))
            sensitivity = Sensitivity(drive, plain)
            both = np.column_stack([sensitivity.increments(channel, held) for channel in ("v", "w")])
            self._columns.append(whitened(drive, both, noise)[0].astype(_PRECISION))
        self._grams = [columns.T @ columns for columns in self._columns]
        self._smooth = _smooth(self._plain)
        self._squares: dict[Way, FloatArray] = {}

    def starts(self, term: Term, fixed: Sequence[Term], residual: Sequence[FloatArray]) -> list[StepSize]:
        """Return the most promising values of a term beside fixed ones; residual: of each drive, whitened."""
        key = _way(term, fixed)
        values, changes = self._sizes(term, fixed)
        if not len(values):
            return []
        if key not in self._squares:
            self._squares[key] = self._products(changes)[0]
        left = (r[: len(c)].astype(_PRECISION) for c, r in zip(self._columns, residual, strict=False))
        pull = np.concatenate([c.T @ r for c, r in zip(self._columns, left, strict=True)])
        gained = changes @ pull - 0.5 * self._squares[key]
        peaks = np.flatnonzero((gained >= np.append(gained[1:], -np.inf)) & (gained >= np.append(-np.inf, gained[:-1])))
        best = peaks[np.argsort(-gained[peaks])][:_BEST]
        apart = np.abs(np.diff(values, append=1.1 * values[-1]))
        return [StepSize(float(values[k]), float(apart[k]), float(gained[k])) for k in best]

    def apart(self, term: Term, fixed: Sequence[Term], value: float) -> float:
        """Return how far apart the sizes about a value are that were weighed."""
        values, _ = self._sizes(term, fixed)
        if len(values) < 2:
            return 0.0
        i = int(np.clip(np.searchsorted(values, value), 1, len(values) - 1))
        return float(values[i] - values[i - 1])

    def _sizes(self, term: Term, fixed: Sequence[Term]) -> tuple[FloatArray, FloatArray]:
        """Return sizes (k,) of a term beside fixed ones, in order, and what each changes, (k, bins)."""
        key = _way(term, fixed)
        if key not in self._walked:
            self._walked[key] = self._close(term, fixed, list(self._walk(term, fixed)))
        return self._walked[key]

    def _close(self, term: Term, fixed: Sequence[Term], found: Sequence[Walk]) -> tuple[FloatArray, FloatArray]:
        """Return sizes with what they change, and more between neighbours of which the drives see no likeness.

        What steers and what drives show by so different amounts that rates alike may hide peaks of the weaker one.
        """
        values, changes = np.array([value for value, _ in found]), np.array([change for _, change in found])
        if len(values) < 2:
            return values, changes
        steps = self._steps_alone(changes)
        squares, between = self._products(steps, np.roll(steps, -1, axis=0))
        between = between[:-1]
        for _ in range(_HALVINGS):
            seen = np.minimum(squares[:-1], squares[1:]) > _FAINT**2 * np.maximum(squares[:-1], squares[1:])
            apart = (values[1:] / values[:-1] > 1 + _GROWTH[0]) & seen
            far = np.flatnonzero(apart & (between < _ALIKE[0] * np.sqrt(squares[:-1] * squares[1:])))
            if not len(far) or len(values) >= _SIZES:
                break
            more = np.sqrt(values[far] * values[far + 1]) * np.sign(values[far])
            own = np.array([self._change(term, fixed, float(value)) for value in more])
            cut = self._steps_alone(own)
            square, before, after = self._products(cut, steps[far], steps[far + 1])
            between = np.insert(between, far + 1, after)
            between[far + np.arange(len(far))] = before
            values, squares = np.insert(values, far + 1, more), np.insert(squares, far + 1, square)
            changes, steps = np.insert(changes, far + 1, own, axis=0), np.insert(steps, far + 1, cut, axis=0)
        return values, changes

    def _products(self, changes: FloatArray, *others: FloatArray) -> list[FloatArray]:
        """Return the square of what each of some changes (k, bins) does, and its products with those of others, (k,).

        Most change one rate only, and not at rest.
        """
        out = [np.zeros(len(changes)) for _ in (changes, *others)]
        for gram, *parts in zip(self._grams, *(self._parts(each) for each in (changes, *others)), strict=True):
            use = np.flatnonzero(np.any([part.any(axis=0) for part in parts], axis=0))
            loud = [part[:, use].astype(_PRECISION) for part in parts]
            seen = loud[0] @ gram[np.ix_(use, use)]
            for total, part in zip(out, loud, strict=True):
                total += np.einsum("kb,kb->k", seen, part)
        return out

    def _parts(self, changes: FloatArray) -> list[FloatArray]:
        """Return what belongs to each drive of changes (k, bins)."""
        return np.split(changes, np.cumsum([len(gram) for gram in self._grams])[:-1], axis=1)

    def _walk(self, term: Term, fixed: Sequence[Term]) -> Iterator[Walk]:
        """Yield sizes with what they change, as far apart as that differs; either way where there are two."""
        p = term.parameter
        for sign, room in ((-1.0, term.null - p.lower), (1.0, p.upper - term.null)):
            if room > 0:
                yield from reversed(list(self._one_way(term, fixed, sign, room)))

    def _one_way(self, term: Term, fixed: Sequence[Term], sign: float, room: float) -> Iterator[Walk]:
        """Yield sizes from the largest on down: the smaller, the closer, so there may be too many of those."""
        size, growth = room, _GROWTH[1]
        least = abs(term.step) * term.parameter.scale / 3
        before: FloatArray | None = None
        for _ in range(_SIZES):
            value = term.null + sign * size
            change = self._change(term, fixed, value)
            if size < least and float(self._products(change[np.newaxis])[0][0]) < _SEEN**2:
                return
            here = self._steps_alone(change)
            alike = 1.0 if before is None else _alike(before, here)
            if alike < _ALIKE[0] and growth > max(_GROWTH[0], _SHIFT * size / room):
                size, growth = size * (1 + growth) / (1 + growth / 2), growth / 2
                continue
            yield value, change
            before = here
            growth = min(1.5 * growth, _GROWTH[1]) if alike > _ALIKE[1] else growth
            size /= 1 + growth

    def _steps_alone(self, changes: FloatArray) -> FloatArray:
        """Return of changes (..., bins) what no smooth law of either rate does, which all sizes have in common.

        Where the rest of a step is cut off, its mean is lost at any size: seen with it, all sizes are alike. All of a
        change that has hardly any peaks.
        """
        rest = changes - (changes @ self._smooth) @ self._smooth.T
        few = np.linalg.norm(rest, axis=-1) < _FEW * np.linalg.norm(changes, axis=-1)
        return np.asarray(np.where(few[..., np.newaxis], changes, rest))

    def _change(self, term: Term, fixed: Sequence[Term], value: float) -> FloatArray:
        """Return what a value adds to v and w in the bins of all drives, (bins,)."""
        terms = (term, *fixed)
        settings = settings_of(terms, np.array([value, *(other.parameter.lower for other in fixed)]))
        moved = [replay.motion(drive, self._model, settings) for drive in self._drives]
        pairs = zip(moved, self._plain, strict=True)
        return np.concatenate([_means(rate) for a, b in pairs for rate in (a.v - b.v, a.w - b.w)])


def _way(term: Term, fixed: Sequence[Term]) -> Way:
    return (term.key, *((other.key, other.parameter.lower) for other in fixed))


def _smooth(motions: Sequence[Motion]) -> FloatArray:
    """Return orthonormal columns (bins, k): free curves over either rate, in either direction, of a few knots."""
    tops = [max(float(np.abs(getattr(motion, name)).max(initial=0.0)) for motion in motions) for name in "vw"]
    blocks = []
    for motion in motions:
        for own, (rate, top) in enumerate(zip((motion.v, motion.w), tops, strict=True)):
            hats = np.zeros((-(-len(rate) // _CELLS), 4 * _KNOTS))
            for side, sign in enumerate((1.0, -1.0)):
                heights = np.maximum(
                    1 - np.abs(sign * rate[:, np.newaxis] / max(top, _NOTHING) * (_KNOTS - 1) - _AT), 0.0
                )
                heights *= (sign * rate > 0)[:, np.newaxis]
                first = (2 * own + side) * _KNOTS
                hats[:, first : first + _KNOTS] = np.column_stack([_means(hat) for hat in heights.T])
            blocks.append(hats)
    left, sizes, _ = np.linalg.svd(np.concatenate(blocks), full_matrices=False)
    return np.asarray(left * (sizes > _NOTHING * max(sizes[0], _NOTHING)))


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


def _alike(one: FloatArray, other: FloatArray) -> float:
    """Return the correlation of two changes, 0 of a faint one with a loud one and 1 of two that are nothing.

    Between nothing and much lies what a threshold that is seldom met does.
    """
    norms = sorted(float(np.linalg.norm(change)) for change in (one, other))
    if norms[1] == 0:
        return 1.0
    return float(one @ other) / (norms[0] * norms[1]) if norms[0] > _FAINT * norms[1] else 0.0


class StartValues:
    """First values; of what is rough, by the likelihood of what every size would explain."""

    def __init__(self, problem: Problem, walked: Walked) -> None:
        """Take what is fitted; walked: what sizes have been found to do, whatever the noise."""
        self._problem, self._walked = problem, walked

    @cached_property
    def _likelihood(self) -> StepLikelihood:
        return StepLikelihood(self._problem.drives, self._problem.model, self._problem.noise, self._walked)

    def first(self, terms: Sequence[Term], start: Mapping[Key, float]) -> FloatArray:
        """Return first values: those given; for others, one after the other, the best of some steps from null."""
        lower = np.array([term.parameter.lower for term in terms])
        upper = np.array([term.parameter.upper for term in terms])
        values = np.array([start.get(term.key, term.null) for term in terms])
        values = np.clip(values, lower, upper)
        for i, term in enumerate(terms):
            if term.key in start or term.shape or term.fixed:
                continue
            steps = [sign * n * term.step * term.parameter.scale for n in _STARTS for sign in (1, -1)]
            values = self._best(terms, values, i) if term.rough else values
            values = self._nearest(terms, values, i, [term.null + step for step in steps])
        return values

    def likeliest(self, terms: Sequence[Term], solution: least_squares.Solution) -> least_squares.Solution:
        """Return a solution in which what is rough is where none close by is likelier.

        The peak on which it began was the best one before the others were fitted.
        """
        rough = [i for i, term in enumerate(terms) if term.rough and not term.fixed]
        for _ in range(_ROUNDS if rough else 0):
            values = solution.values
            for i in rough:
                apart = self._likelihood.apart(terms[i], _form(terms, terms[i].id), float(values[i]))
                for way in (apart, apart / _PLACES):
                    values = self._nearest(terms, values, i, values[i] + way * np.linspace(-1.0, 1.0, _PLACES))
            left = self._problem.residual(terms, values)
            if 0.5 * float(solution.residual @ solution.residual - left @ left) < _BETTER:
                break
            again = least_squares.least_squares(self._problem, terms, values)
            if again.cost >= solution.cost:
                break
            solution = again
        return solution

    def step_evidence(self, rough: Sequence[Term], terms: Sequence[Term], values: FloatArray) -> float:
        """Return what the best peak of an effect with rough terms explains beside others, by lines, in nats."""
        residual = self._problem.residuals(terms, values)
        form = [term for term in rough if term.fixed]
        starts = [self._likelihood.starts(term, form, residual) for term in rough if term.rough]
        return max((found[0].nats for found in starts if found), default=0.0)

    def _best(self, terms: Sequence[Term], values: FloatArray, i: int) -> FloatArray:
        """Return values with the best peak of one of them, and the best place on it."""
        starts = self._likelihood.starts(terms[i], _form(terms, terms[i].id), self._problem.residuals(terms, values))
        if not starts or starts[0].nats < STEP_EVIDENCE:
            return np.where(np.arange(len(values)) == i, starts[0].value if starts else values[i], values)
        apart = {start.value: start.apart for start in starts}
        found = self._nearest(terms, values, i, apart)
        places = np.linspace(-1.0, 1.0, _PLACES) * apart.get(float(found[i]), 0.0)
        return self._nearest(terms, found, i, found[i] + places[places != 0])

    def _nearest(self, terms: Sequence[Term], values: FloatArray, i: int, guesses: Iterable[float]) -> FloatArray:
        """Return values with the best of some guesses of one of them, or of itself where it is not null."""
        p, own = terms[i].parameter, values[i]
        inside = [guess for guess in guesses if p.lower <= guess <= p.upper]
        inside += [own] if own != terms[i].null or not inside else []
        tried = [np.where(np.arange(len(values)) == i, guess, values) for guess in inside]
        return min(tried, key=lambda guess: float(np.sum(self._problem.residual(terms, guess) ** 2)))


def _form(terms: Sequence[Term], name: str) -> list[Term]:
    """Return the fixed terms that say in which form an effect acts."""
    return [term for term in terms if term.id == name and term.fixed]

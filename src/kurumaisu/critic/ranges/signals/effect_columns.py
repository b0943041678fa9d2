# SPDX-License-Identifier: BSD-3-Clause
"""What each effect adds to the mean readings: finite differences of the very effects that the simulator runs.

No effect is named: how a parameter acts (at once, as a square, only beside another, at random) is found by trying.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots, acts_on_readings, hits_of, predict, thin
from kurumaisu.effects import Mechanism, Parameter
from kurumaisu.params import EffectSetting
from kurumaisu.types import BoolArray, FloatArray, IntArray

STEP = 0.2  # of a finite difference, in units of a parameter's scale
_NOTHING = 1e-9  # [m] a change that is none
_SAME = 0.98  # correlation from which two forms of an effect are one
_PROBE = 12  # scans on which it is tried how a parameter acts
_FINER = tuple(2.0 ** np.arange(-0.375, 0.4, 0.0625))  # about a value of the grid
_BETWEEN = np.pi / 16 * np.linspace(-1, 1, 9)  # [rad] about such a direction
_AROUND = 127  # shapes that are tried to say a sum of two as one
_RANK = 1e-3  # singular values below this share of the largest do not count
# Times the usual value, the longest time that is tried: longer ones have no source, and every offset would be a set
# with one. The shortest that is tried, as a share of the usual value or of a short recording.
_LONG, _SHORT = 2.0**1.5, 1 / 16
_HALF_TURN = 8  # directions in half a turn of two parameters that act by their squares


@dataclass(frozen=True)
class Column:
    """A parameter's mark on the readings: change [m] per scale, or per squared scale where `squared`."""

    parameter: Parameter
    squared: bool
    beside: Mapping[str, float]


@dataclass(frozen=True)
class Form:
    """An effect with its shape settled: at: values of the parameters that only shape it; columns: of the others.

    start: index of the first column in the whole matrix. between: two columns at the bounds of a parameter which they
    follow in a straight line: of shares of both, those of one sign are within its bounds.
    """

    id: str
    at: Mapping[str, float]
    columns: tuple[Column, ...]
    start: int
    between: bool = False

    @property
    def span(self) -> slice:
        """Where its columns are in the whole matrix."""
        return slice(self.start, self.start + len(self.columns))


class EffectColumns:
    """Finds the marks of effects on the mean of some shots."""

    def __init__(self, shots: Shots) -> None:
        self._shots = shots
        self.seen = hits_of(shots, (), 0)
        self._own = {setting.id: setting.parameters for setting in shots.own}
        self.base = predict(shots, (), self.seen, 0)
        self._halves: dict[tuple[str, str], bool] = {}
        self._probe = EffectColumns(thin(shots, _PROBE)) if len(shots.stamps) > _PROBE else self

    def thinned(self, rows: IntArray) -> EffectColumns:
        """Return some of the scans alone."""
        out, seen = copy(self), self.seen
        parts = {name: getattr(seen, name)[rows] for name in ("ranges", "level", "incidence", "returns", "origins")}
        out.seen = BeamHits(beams=tuple(seen.beams[row] for row in rows.tolist()), **parts)
        out.base = self.base[rows]
        return out

    def change(self, effect: type[Mechanism], values: Mapping[str, float], seed: int = 0) -> FloatArray:
        """Return the change (k, b) [m] of the mean by an effect with values in place of the model's."""
        setting = EffectSetting(effect.id, {**self.null(effect), **values})
        moved = effect.id not in self._own and issubclass(effect, effects.ReadingEffect)
        seen = self.seen if moved else hits_of(self._shots, (setting,), seed, like=self.seen)
        return np.asarray(predict(self._shots, (setting,), seen, seed) - self.base)

    def together(self, settings: Sequence[EffectSetting]) -> FloatArray:
        """Return the change (k, b) [m] of the mean by effects with these values in place of the model's."""
        seen = hits_of(self._shots, settings, 0, like=self.seen)
        return np.asarray(predict(self._shots, settings, seen, 0) - self.base)

    def null(self, effect: type[Mechanism]) -> dict[str, float]:
        """Return an effect's parameters in the model criticised."""
        own = self._own.get(effect.id, {})
        return {p.name: own.get(p.name, p.null) for p in effect.parameters}

    def forms(self, ids: frozenset[str] | None = None) -> tuple[list[Form], NDArray[np.float32]]:
        """Return the forms of all effects that change the mean, and their columns (k, b, p), per scale.

        ids: the effects to look for; None for all.
        """
        forms: list[Form] = []
        columns: list[FloatArray] = []
        for effect in (*effects.LASER, *effects.WORLD):
            if ids is not None and effect.id not in ids:
                continue
            if issubclass(effect, effects.LaserEffect) and not acts_on_readings(effect.id):
                continue
            for at, marks, values in self._of(effect):
                ends = {p.name: {p.lower, p.upper} for p in effect.parameters if p.lower > 0}
                between = len(marks) == 2 and any(
                    {mark.beside.get(name) for mark in marks} == both for name, both in ends.items()
                )
                forms.append(Form(effect.id, at, tuple(marks), len(columns), between))
                columns += [value.astype(np.float32) for value in values]
        nothing = np.empty((*self.base.shape, 0), dtype=np.float32)
        return forms, np.stack(columns, axis=-1) if columns else nothing

    def finer(self, form: Form) -> Iterator[tuple[dict[str, float], FloatArray]]:
        """Yield shapes between those of the grid, about a form's, and its columns (k, b, m) there."""
        effect = effects.by_id(form.id)
        if form.columns[0].squared and len(form.at) == 2:
            first, second = form.at
            middle = np.arctan2(form.at[second], form.at[first])
            for angle in middle + _BETWEEN:
                at = {first: float(np.cos(angle)), second: float(np.sin(angle))}
                yield at, self._along(effect, at)[:, :, np.newaxis]
            return
        grids = {p.name for p in effect.parameters if p.name in form.at and geometric(p)}
        for factors in product(*(_FINER for _ in grids)):
            at = {**form.at, **{name: form.at[name] * f for name, f in zip(sorted(grids), factors, strict=True)}}
            if grids and all(p.lower <= at.get(p.name, p.lower) <= p.upper for p in effect.parameters):
                slopes = [self._slope(effect, column.parameter, {**at, **column.beside}) for column in form.columns]
                yield at, np.stack(slopes, axis=-1)

    def joined(self, form: Form, coefficients: FloatArray) -> dict[str, float]:
        """Return the parameters whose one column is a sum of those of a form that spans them by several."""
        effect, lead = effects.by_id(form.id), form.columns[0].parameter
        probe = self._probe
        target = sum(
            c * probe._slope(effect, lead, {**form.at, **column.beside})
            for c, column in zip(coefficients.tolist(), form.columns, strict=True)
        )
        flat = np.nan_to_num(np.asarray(target)).ravel()
        (name,) = form.columns[0].beside
        shape = next(p for p in effect.parameters if p.name == name)
        tried = []
        low, high = (-np.pi, np.pi) if shape.unit == "rad" else (shape.lower, shape.upper)
        for value in np.linspace(max(shape.lower, low), min(shape.upper, high), _AROUND).tolist():
            column = np.nan_to_num(probe._slope(effect, lead, {**form.at, name: value})).ravel()
            size = float(flat @ column) / max(float(column @ column), 1e-300)
            # Of a shape and its opposite, the one whose size is positive.
            tried.append((float(np.sum((flat - size * column) ** 2)) * (1 if size > 0 else 2), value, size))
        _, value, size = min(tried)
        return {
            **form.at,
            name: value,
            lead.name: float(np.clip(lead.null + size * lead.scale, lead.lower, lead.upper)),
        }

    def _of(self, effect: type[Mechanism]) -> Iterator[tuple[dict[str, float], list[Column], list[FloatArray]]]:
        acting, squares, shaping = self._probe.sort(effect)
        if squares:
            yield from self._squares(effect, squares)
        if not acting:
            return
        pairs, grids = self._probe.spanned(effect, acting, shaping)
        known: list[FloatArray] = []
        for chosen in product(*grids.values()):
            at = dict(zip(grids, chosen, strict=True))
            marks, values = [], []
            for parameter in acting:
                for beside in pairs:
                    marks.append(Column(parameter, squared=False, beside=beside))
                    values.append(self._slope(effect, parameter, {**at, **beside}))
            span = _span(values)
            if not any(_alike(span, other) for other in known):
                known.append(span)
                yield {**at, **pairs[0]}, marks, values

    def sort(self, effect: type[Mechanism]) -> tuple[list[Parameter], list[Parameter], list[Parameter]]:
        """Return parameters that act at once, those that act by their square, and those that only shape others."""
        acting, squares, shaping = [], [], []
        for parameter in effect.parameters:
            up = self._moved(effect, parameter, 1.0, 0)
            if effect.random and not np.array_equal(up, self._moved(effect, parameter, 1.0, 1), equal_nan=True):
                continue  # what it adds is drawn: no mean
            down = self._moved(effect, parameter, -1.0, 0) if parameter.lower < parameter.null else -up
            if _largest(up) < _NOTHING:
                shaping.append(parameter)
            elif _typical(up + down, either := (up != 0) | (down != 0)) > _typical(up - down, either):
                squares.append(parameter)
            else:
                acting.append(parameter)
        return acting, squares, shaping

    def _moved(self, effect: type[Mechanism], parameter: Parameter, steps: float, seed: int) -> FloatArray:
        value = np.clip(self.null(effect)[parameter.name] + steps * parameter.scale, parameter.lower, parameter.upper)
        return self.change(effect, {parameter.name: float(value)}, seed)

    def _slope(self, effect: type[Mechanism], parameter: Parameter, beside: Mapping[str, float]) -> FloatArray:
        """Return the change per scale, from both sides where bounds allow: one side sees half the curvature."""
        null = self.null(effect)[parameter.name]
        if issubclass(effect, effects.ReadingEffect) and effect.id not in self._own and self._linear(effect, parameter):
            step = STEP * parameter.scale if parameter.upper > null else -STEP * parameter.scale
            moved = self.change(effect, {**beside, parameter.name: null + step})
            return np.asarray(moved * (parameter.scale / step))
        ends = np.clip([null - STEP * parameter.scale, null + STEP * parameter.scale], parameter.lower, parameter.upper)
        low, high = (
            np.float64(0.0) if end == null else self.change(effect, {**beside, parameter.name: end})
            for end in ends.tolist()
        )
        return np.asarray((high - low) * (parameter.scale / (ends[1] - ends[0])))

    def _linear(self, effect: type[Mechanism], parameter: Parameter) -> bool:
        """Return whether half of a parameter does half of what the whole does; a few scans show it."""
        known = self._probe._halves
        if (effect.id, parameter.name) not in known:
            whole, half = (self._probe._moved(effect, parameter, steps, 0) for steps in (1.0, 0.5))
            known[effect.id, parameter.name] = _largest(whole - 2 * half) < _NOTHING
        return known[effect.id, parameter.name]

    def _squares(
        self, effect: type[Mechanism], squares: Sequence[Parameter]
    ) -> Iterator[tuple[dict[str, float], list[Column], list[FloatArray]]]:
        """Yield a form per direction in which parameters that act by their square may go together."""
        for signs in directions(len(squares)):
            sizes = {p.name: sign for p, sign in zip(squares, signs, strict=True)}
            lead = next(p for p in squares if sizes[p.name])
            yield sizes, [Column(lead, squared=True, beside={})], [self._along(effect, sizes)]

    def _along(self, effect: type[Mechanism], sizes: Mapping[str, float]) -> FloatArray:
        """Return the change by parameters together, of these sizes in units of their scales."""
        null, scales = self.null(effect), {p.name: p.scale for p in effect.parameters}
        return self.change(effect, {name: null[name] + size * scales[name] for name, size in sizes.items()})

    def spanned(
        self, effect: type[Mechanism], acting: Sequence[Parameter], shaping: Sequence[Parameter]
    ) -> tuple[list[dict[str, float]], dict[str, list[float]]]:
        """Return settings beside which columns span all shapes of some parameters, and the others' grids."""
        pairs: list[dict[str, float]] = [{}]
        grids: dict[str, list[float]] = {}
        for parameter in shaping:
            if chosen := [form[parameter.name] for form in effect.forms if parameter.name in form]:
                grids[parameter.name] = chosen
                continue
            grid = grid_of(parameter, float(np.ptp(self._shots.stamps)) or 1.0)
            units = np.array([_unit(self._slope(effect, acting[0], {parameter.name: value})) for value in grid])
            sizes = np.linalg.svd(units, compute_uv=False)
            rank = int(np.sum(sizes > _RANK * sizes[0]))
            if rank == 2 and geometric(parameter) and self._straight(effect, acting[0], parameter):
                pairs = [{**pair, parameter.name: end} for pair in pairs for end in (parameter.lower, parameter.upper)]
            elif rank > 2 or (rank == 2 and geometric(parameter)):  # within bounds, which a sum of two would ignore
                grids[parameter.name] = grid
            elif rank == 2:
                other = int(np.argmin(np.abs(units @ units[0])))
                pairs = [{**pair, parameter.name: grid[i]} for pair in pairs for i in (0, other)]
        return pairs, grids

    def _straight(self, effect: type[Mechanism], acting: Parameter, shaping: Parameter) -> bool:
        """Return whether a column follows a parameter that shapes it in a straight line from bound to bound."""
        values = (shaping.lower, 0.5 * (shaping.lower + shaping.upper), shaping.upper)
        low, middle, high = (np.nan_to_num(self._slope(effect, acting, {shaping.name: value})) for value in values)
        return _rms(middle - 0.5 * (low + high)) < _RANK * _rms(high - low)


def _unit(column: FloatArray) -> FloatArray:
    flat = np.nan_to_num(column).ravel()
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-300))


def _span(columns: Sequence[FloatArray]) -> FloatArray:
    """Return an orthonormal basis (n, m) of what columns span."""
    basis, sizes, _ = np.linalg.svd(np.stack([_unit(column) for column in columns], axis=1), full_matrices=False)
    return np.asarray(basis[:, sizes > _RANK * sizes[0]])


def _alike(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two bases span nearly the same."""
    if one.shape != other.shape:
        return False
    return bool(np.linalg.svd(one.T @ other, compute_uv=False).min(initial=1.0) > _SAME)


def _largest(values: FloatArray) -> float:
    """Return the largest size of what is known; 0 where beams meet nothing."""
    return float(np.max(np.abs(values), initial=0.0, where=~np.isnan(values)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nansum(values**2) / max(np.count_nonzero(~np.isnan(values)), 1)))


def _typical(values: FloatArray, where: BoolArray) -> float:
    """Return the middle size of what is known, of some: a beam that passes an edge is off by metres, either way."""
    known = np.abs(values[where & ~np.isnan(values)])
    return float(np.median(known)) if len(known) else 0.0


def directions(count: int) -> list[tuple[float, ...]]:
    """Return sizes of parameters that act by their squares; of two, directions over half a turn."""
    if count == 2:
        return [
            (round(float(np.cos(a)), 12), round(float(np.sin(a)), 12))
            for a in np.pi / _HALF_TURN * np.arange(_HALF_TURN)
        ]
    every = product((-1.0, 0.0, 1.0), repeat=count)
    return [signs for signs in every if next((sign for sign in signs if sign), 0.0) > 0]


def grid_of(parameter: Parameter, span: float) -> list[float]:
    """Return values of a parameter that only shapes an effect; span [s]: of the scans, for a parameter in seconds.

    The longest time comes first: of shapes that are alike the first is kept, and that one is most like a constant.
    Where none is usual, none comes before it.
    """
    if parameter.unit == "s":
        usual = parameter.null or parameter.scale
        longest, shortest = _LONG * usual, _SHORT * min(span, usual)
        values = longest * 2.0 ** -np.arange(0, np.log2(longest / shortest) + 0.1, 0.5)
        if not parameter.null:
            values = np.r_[0.0, values]
    elif parameter.lower > 0:
        values = parameter.null * 2.0 ** np.arange(-3, 1.6, 0.25)
    else:
        values = parameter.null + parameter.scale * np.arange(0, 3.1, 0.5)
    return [float(value) for value in values if parameter.lower <= value <= parameter.upper] or [parameter.null]


def geometric(parameter: Parameter) -> bool:
    """Return whether a parameter's grid is of factors."""
    return parameter.unit == "s" or parameter.lower > 0

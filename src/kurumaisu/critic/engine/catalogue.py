# SPDX-License-Identifier: BSD-3-Clause
"""What the critic may fit: the parameters of the catalogue, and which of them these drives can show."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from kurumaisu import effects
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

Key = tuple[str, str]  # id and parameter
SHOWS = 3.0  # whitened norm from which a parameter can be seen at all
_TYPICAL = 8.0  # whitened norm of the step by which a parameter is judged
_NEAR = 0.4  # of the log of the norm
_TRIALS = 12
_FARTHEST = 2.0**7  # scales
_USUAL = 0.7  # that an effect which has several forms acts in the usual one, before the data
_SUDDEN = 0.1  # share of what a step does, below which half a step does nothing
_STRAIGHT = 0.9  # correlation of the changes by a step and by two from which a derivative says what a parameter does


@dataclass(frozen=True)
class Term:
    """One parameter of one effect as the critic may fit it.

    null: its value in the model criticised; step: from there to where it shows typically, in units of its scale;
    shape: it changes how another parameter of the effect shows, and nothing by itself; rough: twice the step does not
    do twice the same, so that a derivative says little; sudden: half the step does nothing, as below a threshold.
    """

    id: str
    parameter: Parameter
    null: float
    step: float = 0.2
    shape: bool = False
    rough: bool = False
    sudden: bool = False

    @property
    def key(self) -> Key:
        """Return the id and the parameter's name."""
        return self.id, self.parameter.name

    @property
    def fixed(self) -> bool:
        """Tell whether there is nothing to fit."""
        return self.parameter.lower == self.parameter.upper


@dataclass(frozen=True)
class Candidate:
    """One way in which an effect may act: terms that are fitted, or fixed ones.

    ways: one over the probability that it acts in this way, before the data; usual: it is no unusual form.
    """

    id: str
    terms: tuple[Term, ...]
    ways: float
    usual: bool = True

    @property
    def fixed(self) -> bool:
        """Tell whether there is nothing to fit."""
        return all(term.fixed for term in self.terms)

    @property
    def rough(self) -> bool:
        """Tell whether a linearisation says little about it."""
        return any(term.rough for term in self.terms)


def catalogue(model: Model, ids: frozenset[str] | None = None) -> tuple[Term, ...]:
    """Return a term for every parameter of every effect that changes the mean motion and has a size to fit.

    ids: of these effects only.
    """
    own = {setting.id: setting.parameters for setting in model.effects}
    return tuple(
        Term(effect.id, parameter, own.get(effect.id, {}).get(parameter.name, parameter.null))
        for effect in effects.of_base(voltages=model.robot.voltages)
        if not effect.random and not effect.choices and (ids is None or effect.id in ids)
        for parameter in effect.parameters
        if effect.id in own or all(parameter.name not in form for form in effect.forms)
    )


def settings_of(terms: Sequence[Term], values: FloatArray) -> tuple[EffectSetting, ...]:
    """Return the effects of these terms; parameters that have none are left to the model."""
    by_id: dict[str, dict[str, float]] = {}
    for term, value in zip(terms, values, strict=True):
        by_id.setdefault(term.id, {})[term.parameter.name] = float(value)
    return tuple(EffectSetting(name, parameters) for name, parameters in by_id.items())


Norm = Callable[[tuple[EffectSetting, ...]], float]


def showing(terms: Iterable[Term], norm: Norm) -> tuple[Term, ...]:
    """Return the terms that these drives can show, with their steps; norm: of the change that settings make."""
    by_id: dict[str, list[Term]] = {}
    for term in terms:
        by_id.setdefault(term.id, []).append(term)
    return tuple(term for own in by_id.values() for term in _showing(own, norm))


def _showing(own: Sequence[Term], norm: Norm) -> Iterator[Term]:
    """Yield those of one effect: amplitudes first, then the shapes, which show beside an amplitude only."""
    nulls = np.array([term.null for term in own])

    def at(moves: dict[int, float]) -> float:
        values = nulls.copy()
        for i, step in moves.items():
            values[i] += step * own[i].parameter.scale
        return norm(settings_of(own, values))

    found: dict[int, Term] = {}
    for i, term in enumerate(own):
        step = _typical_step(term, lambda step, i=i: at({i: step}))  # type: ignore[misc]
        if step is not None:
            found[i] = replace(term, step=step)
    yield from found.values()
    for i, term in enumerate(own):
        if i not in found and term.null != 0 and found:
            loud = {j: other.step for j, other in found.items()}
            if abs(at({**loud, i: 0.5}) - at(loud)) > 1e-3:
                yield replace(term, step=0.2, shape=True)


def roughened(terms: Iterable[Term], moved: Callable[[tuple[EffectSetting, ...]], FloatArray]) -> Iterator[Term]:
    """Yield the terms, marked where another step does not do its share of the same; moved: the change by settings."""
    for term in terms:
        if term.shape:
            yield term
            continue
        p = term.parameter
        steps = np.clip(term.null + np.array([0.5, 1.0, 2.0]) * term.step * p.scale, p.lower, p.upper)
        half, one, two = (moved(settings_of([term], np.array([value]))) for value in steps)
        norms = float(np.linalg.norm(one) * np.linalg.norm(two))
        sudden = float(np.linalg.norm(half)) < _SUDDEN * float(np.linalg.norm(one))
        yield replace(term, rough=norms > 0 and float(one @ two) < _STRAIGHT * norms, sudden=sudden)


def _typical_step(term: Term, norm: Callable[[float], float]) -> float | None:
    """Return the step whose change has about the norm _TYPICAL; the largest one that shows, or None.

    A change that is in proportion to the step takes two trials; one with a threshold is bracketed.
    """
    p = term.parameter
    room = (p.upper - term.null) / p.scale
    sign = 1.0 if room > 0 else -1.0
    largest = min(abs(room if room > 0 else (p.lower - term.null) / p.scale), _FARTHEST)
    low, high, step = 0.0, np.inf, min(0.25, largest)
    for _ in range(_TRIALS):
        shown = norm(sign * step)
        if abs(np.log(max(shown, 1e-9) / _TYPICAL)) < _NEAR:
            return sign * step
        if shown < _TYPICAL:
            if step >= largest:
                return sign * step if shown >= SHOWS else None
            low = step
        else:
            high = step
        guess = step * float(np.clip(_TYPICAL / max(shown, 1e-9), 1e-2, 8.0))
        if not low < guess < high:
            guess = float(np.sqrt(max(low, high / 100) * high))
        step = min(guess, largest)
    return sign * min(high, largest)


def candidates(terms: Sequence[Term], model: Model, ids: frozenset[str] | None = None) -> tuple[Candidate, ...]:
    """Return the ways in which the effects of these terms may act, and those that can act or not; ids: among these."""
    found: list[Candidate] = []
    own = {setting.id for setting in model.effects}
    for effect in effects.of_base(voltages=model.robot.voltages):
        if effect.choices and effect.id not in own:
            for choice in effect.choices if ids is None or effect.id in ids else ():
                fixed = tuple(_fixed(effect.id, parameter, choice) for parameter in effect.parameters)
                found.append(Candidate(effect.id, fixed, len(effect.choices)))
            continue
        amplitudes = [term for term in terms if term.id == effect.id and not term.shape]
        shapes = [term for term in terms if term.id == effect.id and term.shape]
        if not amplitudes:
            continue
        sizes = range(1, len(amplitudes) + 1) if effect.separable else [len(amplitudes)]
        subsets = [subset for size in sizes for subset in combinations(amplitudes, size)]
        forms = () if effect.id in own else effect.forms_of(model.robot.track)
        for terms_of, ways, usual in _forms(effect, forms):
            # Of a converter nothing is smooth: what an unusual form makes of large sizes, nobody has looked at.
            simple = usual or effect.stage > effects.Stage.CONVERTER
            ways_of = [subset if simple else tuple(replace(term, rough=True) for term in subset) for subset in subsets]
            found += [
                Candidate(effect.id, (*own_terms, *shapes, *terms_of), ways * len(subsets), usual)
                for own_terms in ways_of
            ]
    return tuple(found)


def _forms(
    effect: type[effects.BaseEffect], forms: Sequence[Mapping[str, float]]
) -> Iterator[tuple[tuple[Term, ...], float, bool]]:
    """Yield the fixed terms of each form, one over its probability, and whether it is the usual one."""
    if not forms:
        yield (), 1.0, True
    for i, form in enumerate(forms):
        fixed = tuple(_fixed(effect.id, parameter, form) for parameter in effect.parameters if parameter.name in form)
        usual = _USUAL if len(forms) > 1 else 1.0
        yield fixed, (len(forms) - 1) / (1 - usual) if i else 1 / usual, i == 0


def _fixed(name: str, parameter: Parameter, values: Mapping[str, float]) -> Term:
    value = values[parameter.name]
    return Term(name, replace(parameter, lower=value, upper=value), parameter.null)

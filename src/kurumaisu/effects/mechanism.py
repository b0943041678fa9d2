# SPDX-License-Identifier: BSD-3-Clause
"""What all effects have in common: an id, parameters with bounds, and words for report and catalogue."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Parameter:
    """A number of an effect.

    null: value at which the effect is absent; scale: a typical size; lower, upper: bounds of a fit.
    """

    name: str
    unit: str
    null: float
    scale: float
    lower: float
    upper: float


class Mechanism:
    """One way in which a real chair or laser departs from equations (1)-(4).

    sentence: for the report; formula: what apply does, in the symbols of docs/effects.md; source: where the form is
    known from. separable: each parameter is a peculiarity by itself (one per axis), so one may act without the other.
    empirical: the formula is the simplest of a family of curves, of which a chair may follow another.
    choices: where not empty, the only parameters that a critic considers: the effect acts so, or not at all.
    forms: where not empty, the values of some parameters that a critic considers, the usual ones first; it fits the
    other parameters. A setting may leave them out, which means the usual ones.
    """

    id: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    sentence: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]
    separable: ClassVar[bool] = False
    empirical: ClassVar[bool] = False
    choices: ClassVar[tuple[Mapping[str, float], ...]] = ()
    forms: ClassVar[tuple[Mapping[str, float], ...]] = ()
    random: ClassVar[bool] = False  # it draws noise, so its mean effect is none, or not the whole of it

    since = 0.0  # [s] after the reset: when it began to act, which is the time 0 of its formula

    def __init__(self, values: Mapping[str, float]) -> None:
        """Take a value for each parameter. Raise Error for one that is missing, unknown or out of its bounds."""
        self.change(values)

    def change(self, values: Mapping[str, float]) -> None:
        """Go on with other values from the state that it is in. Raise Error, with nothing changed, as at the start."""
        self.check(values)
        self.values = {**self.usual(), **values}

    @classmethod
    def usual(cls) -> dict[str, float]:
        """Return the parameters that say which form it has, as they usually are."""
        return dict(cls.forms[0]) if cls.forms else {}

    @classmethod
    def forms_of(cls, track: float | None) -> tuple[Mapping[str, float], ...]:
        """Return the forms that a robot may show whose wheels are so far apart [m]; None: as far as a wheelchair's."""
        return cls.forms

    @classmethod
    def check(cls, values: Mapping[str, float]) -> None:
        """Raise Error for a parameter that is missing, unknown or out of its bounds."""
        names = [parameter.name for parameter in cls.parameters]
        whole = {**cls.usual(), **values}
        if sorted(whole) != sorted(names):
            raise Error(f"{cls.id}: needs the parameters {', '.join(names)}; got {', '.join(values) or 'none'}")
        for parameter in cls.parameters:
            value = whole[parameter.name]
            if not parameter.lower <= value <= parameter.upper:
                limits = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
                raise Error(f"{cls.id}: {parameter.name} must be {limits}: {value:g}")


class WorldEffect(Mechanism, ABC):
    """An effect on the world's walls."""

    def __init__(self, values: Mapping[str, float], rng: np.random.Generator) -> None:
        super().__init__(values)
        self.rng = rng

    @abstractmethod
    def apply(self, segments: FloatArray) -> FloatArray:
        """Return walls (m, 4), x and y of both ends [m], as they are in truth."""

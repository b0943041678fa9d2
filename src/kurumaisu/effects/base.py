# SPDX-License-Identifier: BSD-3-Clause
"""What an effect is: one mechanism by which a real chair departs from equations (1)-(3).

The simulator applies effects chunk by chunk as time goes on, the critic to a whole run at once; because an
effect keeps its state between chunks, both get the same motion from the same code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import ClassVar

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray


class Stage(IntEnum):
    """Where in the drive chain an effect acts; effects apply in this order."""

    TRANSPORT = 0  # command to motor controller
    THRESHOLD = 1  # what the joystick input swallows
    GAIN = 2  # steady state
    RESPONSE = 3  # motors, chair and floor


class Rate(Enum):
    """The rate in which an effect shows."""

    V = "forward speed"
    W = "yaw rate"


class Follows(Enum):
    """The quantity that an effect follows, so that a residual drawn over it shows the effect's shape."""

    V = "forward speed asked for"
    W = "yaw rate asked for"
    V_CHANGE = "change of the forward speed asked for"
    W_CHANGE = "change of the yaw rate asked for"


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


@dataclass(frozen=True)
class Motion:
    """Rates on a uniform time grid: dt [s]; v [m/s] and w [rad/s], both (n,)."""

    dt: float
    v: FloatArray
    w: FloatArray


@dataclass(frozen=True)
class Context:
    """What effects may know of the chair."""

    translation: AxisLaw
    steering: AxisLaw
    rng: np.random.Generator


class Effect(ABC):
    """One mechanism with its parameters and the state it has reached."""

    id: ClassVar[str]
    stage: ClassVar[Stage]
    parameters: ClassVar[tuple[Parameter, ...]]
    sentence: ClassVar[str]
    shows_in: ClassVar[Rate]
    follows: ClassVar[Follows]
    random: ClassVar[bool] = False  # it draws noise, so its mean effect on the motion is none

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        names = [parameter.name for parameter in self.parameters]
        if sorted(values) != sorted(names):
            raise Error(f"{self.id}: needs the parameters {', '.join(names)}; got {', '.join(values) or 'none'}")
        for parameter in self.parameters:
            value = values[parameter.name]
            if not parameter.lower <= value <= parameter.upper:
                limits = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
                raise Error(f"{self.id}: {parameter.name} must be {limits}: {value:g}")
        self.values = dict(values)
        self.context = context

    @abstractmethod
    def apply(self, motion: Motion) -> Motion:
        """Return the motion with this effect, continuing from where the last chunk ended."""

# SPDX-License-Identifier: BSD-3-Clause
"""Effects of the base: on the voltages, on the rates that they make, and on what a reference sees of the motion.

The simulator applies effects chunk by chunk as time goes on, the critic to a whole run at once; because an
effect keeps its state between chunks, both get the same motion from the same code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import ClassVar

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.effects.mechanism import Mechanism, Parameter
from kurumaisu.types import BoolArray, FloatArray

RESTS = 1.0e-3  # [m/s], [rad/s] up to which its brakes hold a chair at rest: one that lags never quite comes to rest
LATE = "share of the step before the change"  # no name that a recording could have


class Stage(IntEnum):
    """Where in the drive chain an effect acts; effects apply in this order, those of a stage in the catalogue's."""

    CONVERTER = 0  # D/A converter: what the motor controller is given
    CONTROLLER = 1  # what the motor controller makes of the voltages
    TRANSPORT = 2  # command to motor controller
    THRESHOLD = 3  # what the joystick input swallows
    GAIN = 4  # steady state
    RESPONSE = 5  # motors and chair
    FLOOR = 6  # what the wheels make of it on the floor
    REFERENCE = 7  # what measures the motion


class Rate(Enum):
    """The rate in which an effect shows."""

    V = "forward speed"
    W = "yaw rate"


class Follows(Enum):
    """The quantity that an effect follows, so that a residual drawn over it shows the effect's shape."""

    V = "commanded forward speed"
    W = "commanded yaw rate"
    V_CHANGE = "change of the commanded forward speed"
    W_CHANGE = "change of the commanded yaw rate"


@dataclass(frozen=True)
class Volts:
    """What the D/A converter puts out: v_f, v_s [V]; signs of the rates meant, NaN where unknown; all (n,)."""

    v_f: FloatArray
    v_s: FloatArray
    sign_v: FloatArray
    sign_w: FloatArray


@dataclass(frozen=True)
class Motion:
    """Rates on a uniform time grid: dt [s]; v forward, u leftward [m/s] and w [rad/s], all (n,).

    u: None where the chair does not slip, which is 0 throughout. heading [rad] in the map at the first sample; None
    where nobody knows it: an effect that needs it then goes on from where its own sum of the turns has come.
    known: what else somebody knows of each step, (n,) each: v_asked, w_asked before all effects, x, y [m], heading
    [rad], v_f, v_s [V], quantities of a recording by their names; LATE: the share of the step that had passed when
    what was asked for changed, 0 where it did not.
    """

    dt: float
    v: FloatArray
    w: FloatArray
    u: FloatArray | None = None
    heading: float | None = None
    known: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def moving(self) -> BoolArray:
        """Return in which steps the chair does not rest, (n,)."""
        return np.asarray((np.abs(self.v) > RESTS) | (np.abs(self.w) > RESTS))


@dataclass(frozen=True)
class Reference:
    """What a reference measures: times (...) [s], poses (..., 3) in the map, rates (..., 3) forward, leftward, yaw.

    start: when the drive began [s], if its times go on from those of the drives before it. known: what somebody knows
    of each time, (...) each, as Motion has it, where poses and rates are not as those of the chair.
    """

    times: FloatArray
    poses: FloatArray
    rates: FloatArray
    start: float = 0.0
    known: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True)
class Context:
    """What effects may know of the chair."""

    translation: AxisLaw
    steering: AxisLaw
    rng: np.random.Generator


class BaseEffect(Mechanism):
    """An effect somewhere in the drive chain. shows_in, follows: where a residual drawn over it shows its shape.

    in_odometry: whatever it does, odometry has it, whether of the wheels or of what was put out; of_voltages: it acts
    on voltages, so that a robot without them cannot have it; of_wheels: it is what other radii and another track of two
    sides of wheels do.
    """

    stage: ClassVar[Stage]
    in_odometry: ClassVar[bool] = False
    of_voltages: ClassVar[bool] = False
    of_wheels: ClassVar[bool] = False
    shows_in: ClassVar[Rate]
    follows: ClassVar[Follows]

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        super().__init__(values)
        self.context = context


class Effect(BaseEffect, ABC):
    """An effect on the rates, with the state it has reached."""

    @abstractmethod
    def apply(self, motion: Motion) -> Motion:
        """Return the motion with this effect, continuing from where the last chunk ended."""

    def settle(self, motion: Motion) -> None:
        """Begin in the middle of a drive: as if the rates of this one step had been held for long."""


class VoltageEffect(BaseEffect, ABC):
    """An effect on the voltages, before they become rates."""

    of_voltages = True

    @abstractmethod
    def apply(self, volts: Volts) -> Volts:
        """Return the voltages with this effect, continuing from where the last chunk ended."""


class ReferenceEffect(BaseEffect, ABC):
    """An effect on what is measured of the motion; it has no state.

    of_times: it moves the times of what is measured.
    """

    stage = Stage.REFERENCE
    of_times: ClassVar[bool] = False

    @abstractmethod
    def apply(self, reference: Reference) -> Reference:
        """Return what the reference measures."""


__all__ = [
    "LATE",
    "BaseEffect",
    "Context",
    "Effect",
    "Follows",
    "Motion",
    "Parameter",
    "Rate",
    "Reference",
    "ReferenceEffect",
    "Stage",
    "VoltageEffect",
    "Volts",
]

# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of effects: one mechanism per file, and ALL, the only list of them.

Effects of one stage act in the order of the list, whatever a file's order.
"""

from collections import Counter
from dataclasses import dataclass
from typing import TypeVar

from kurumaisu.effects.accel_limit import AccelLimit
from kurumaisu.effects.backlash import Backlash
from kurumaisu.effects.base import (
    BaseEffect,
    Context,
    Effect,
    Follows,
    Motion,
    Parameter,
    Rate,
    Reference,
    ReferenceEffect,
    Stage,
    VoltageEffect,
    Volts,
)
from kurumaisu.effects.battery_sag import BatterySag
from kurumaisu.effects.caster_reversal import CasterReversal
from kurumaisu.effects.clock_scale import ClockScale
from kurumaisu.effects.cross import CrossVToW, CrossWToV
from kurumaisu.effects.curvature import CurvatureV, CurvatureW
from kurumaisu.effects.dac_quantisation import DacQuantisation
from kurumaisu.effects.dac_zero import DacZeroF, DacZeroS
from kurumaisu.effects.dead_zone import DeadZoneV, DeadZoneW
from kurumaisu.effects.delay import Delay
from kurumaisu.effects.gain import GainV, GainW
from kurumaisu.effects.lag import LagV, LagW
from kurumaisu.effects.lateral_slip import LateralSlip
from kurumaisu.effects.left_right_gain import LeftRightGain
from kurumaisu.effects.marker import MarkerX, MarkerY
from kurumaisu.effects.mechanism import Mechanism
from kurumaisu.effects.payload import Payload
from kurumaisu.effects.process_noise import ProcessNoise
from kurumaisu.effects.reverse_gain import ReverseGain
from kurumaisu.effects.saturation import Saturation
from kurumaisu.effects.sign import Sign
from kurumaisu.effects.slope import Slope
from kurumaisu.effects.steering_law import SteeringLaw
from kurumaisu.effects.understeer import Understeer
from kurumaisu.effects.veer import Veer
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting

# What the critic looks for.
CRITICISED: tuple[type[Effect], ...] = (
    GainV,
    GainW,
    LeftRightGain,
    Veer,
    DeadZoneV,
    DeadZoneW,
    Delay,
    LagV,
    LagW,
    ProcessNoise,
)

BASE: tuple[type[BaseEffect], ...] = (
    *CRITICISED,
    DacZeroF,
    DacZeroS,
    DacQuantisation,
    SteeringLaw,
    Sign,
    Backlash,
    ReverseGain,
    CurvatureV,
    CurvatureW,
    Saturation,
    BatterySag,
    CrossWToV,
    CrossVToW,
    AccelLimit,
    Payload,
    Understeer,
    CasterReversal,
    LateralSlip,
    Slope,
    MarkerX,
    MarkerY,
    ClockScale,
)

# What the simulator can run.
ALL: tuple[type[Mechanism], ...] = (*BASE,)

_M = TypeVar("_M", bound=Mechanism)


@dataclass(frozen=True)
class Chain:
    """The effects on the base, each kind in the order in which they act."""

    volts: tuple[VoltageEffect, ...]
    rates: tuple[Effect, ...]
    reference: tuple[ReferenceEffect, ...]


def by_id(name: str) -> type[Mechanism]:
    """Return the effect of an id. Raise Error when it is not in the catalogue."""
    for effect in ALL:
        if effect.id == name:
            return effect
    raise Error(f"effects: {name!r} is not in the catalogue: {', '.join(effect.id for effect in ALL)}")


def fluctuation(sd_v: float, sd_w: float, tau: float) -> EffectSetting:
    """Return noise of the rates, sd [m/s], [rad/s] and time constant [s], as a model file has it."""
    return EffectSetting(ProcessNoise.id, {"sd_v": sd_v, "sd_w": sd_w, "tau": tau})


def build(settings: tuple[EffectSetting, ...], context: Context) -> Chain:
    """Return the effects on the base among those of a model file.

    Raise Error for an unknown id, an id given twice, or parameters that do not fit.
    """
    built = [effect(setting.parameters, context) for effect, setting in _chosen(BaseEffect, settings)]
    built.sort(key=lambda effect: (effect.stage, BASE.index(type(effect))))
    return Chain(
        tuple(effect for effect in built if isinstance(effect, VoltageEffect)),
        tuple(effect for effect in built if isinstance(effect, Effect)),
        tuple(effect for effect in built if isinstance(effect, ReferenceEffect)),
    )


def _chosen(family: type[_M], settings: tuple[EffectSetting, ...]) -> list[tuple[type[_M], EffectSetting]]:
    """Return the effects of a family with their settings. Raise Error for any id unknown or given twice."""
    twice = [name for name, count in Counter(setting.id for setting in settings).items() if count > 1]
    if twice:
        raise Error(f"effects: {twice[0]!r} is given twice")
    found = [(by_id(setting.id), setting) for setting in settings]
    return [(effect, setting) for effect, setting in found if issubclass(effect, family)]


__all__ = [
    "ALL",
    "BASE",
    "CRITICISED",
    "Chain",
    "Context",
    "Effect",
    "Follows",
    "Mechanism",
    "Motion",
    "Parameter",
    "Rate",
    "Reference",
    "ReferenceEffect",
    "Stage",
    "VoltageEffect",
    "Volts",
    "build",
    "by_id",
    "fluctuation",
]

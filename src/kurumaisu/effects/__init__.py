# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of effects: one mechanism per file, and ALL, the only list of them.

Effects of one stage act in the order of the list, whatever a file's order.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from kurumaisu.effects.accel_limit import AccelLimit
from kurumaisu.effects.backlash import Backlash
from kurumaisu.effects.base import (
    LATE,
    RESTS,
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
from kurumaisu.effects.first_order import FirstOrder
from kurumaisu.effects.gain import GainV, GainW
from kurumaisu.effects.lag import LagV, LagW
from kurumaisu.effects.laser import (
    LAGGED,
    LAGS,
    LASER,
    BeamEffect,
    Beams,
    Echoes,
    LaserEffect,
    LaserStage,
    ReadingEffect,
)
from kurumaisu.effects.laser.chain import LaserChain, incidence, slanted
from kurumaisu.effects.laser.smooth import RANGE_COVARIATES, smooth_range_id, smooth_reading_of, smooth_scatter_id
from kurumaisu.effects.lateral_slip import LateralSlip
from kurumaisu.effects.left_right_gain import LeftRightGain
from kurumaisu.effects.map_error import MapError
from kurumaisu.effects.marker import MarkerX, MarkerY, MarkerYaw
from kurumaisu.effects.mechanism import Mechanism, WorldEffect
from kurumaisu.effects.payload import Payload
from kurumaisu.effects.process_noise import ProcessNoise
from kurumaisu.effects.reverse_gain import ReverseGain
from kurumaisu.effects.saturation import Saturation
from kurumaisu.effects.sign import Sign
from kurumaisu.effects.slope import Slope
from kurumaisu.effects.smooth import (
    CHANNELS,
    REFERENCE_CHANNELS,
    SMOOTH,
    SmoothReference,
    constant_of,
    curve,
    factor,
    smooth_id,
    smooth_of,
)
from kurumaisu.effects.smooth_covariates import (
    CONSTANTS,
    COVARIATES,
    MEANINGS,
    MOVING,
    PERIODIC,
    RECORDING_TIME,
    Follower,
)
from kurumaisu.effects.steering_law import SteeringLaw
from kurumaisu.effects.understeer import Understeer
from kurumaisu.effects.veer import Veer
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import EffectSetting

# What the critic looks for.
BASE: tuple[type[BaseEffect], ...] = (
    CrossVToW,  # of the voltage as it is put out, before anything is made of it
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
    AccelLimit,
    Payload,
    Understeer,
    CasterReversal,
    LateralSlip,
    Slope,
    CrossWToV,
    MarkerX,
    MarkerY,
    MarkerYaw,
    ClockScale,
)

WORLD: tuple[type[WorldEffect], ...] = (MapError,)

# What the simulator can run.
ALL: tuple[type[Mechanism], ...] = (*BASE, *LASER, *WORLD)
_BY_ID = {effect.id: effect for effect in ALL}
_PLACES = {effect.id: place for place, effect in enumerate(ALL)}


@dataclass(frozen=True)
class Chain:
    """The effects on the base, each kind in the order in which they act."""

    volts: tuple[VoltageEffect, ...] = ()
    rates: tuple[Effect, ...] = ()
    reference: tuple[ReferenceEffect, ...] = ()

    @property
    def all(self) -> tuple[BaseEffect, ...]:
        """Every kind."""
        return *self.volts, *self.rates, *self.reference


_NOTHING = Chain()
_Acting = TypeVar("_Acting", bound=Mechanism)


def of_base(*, voltages: bool) -> tuple[type[BaseEffect], ...]:
    """Return the effects on the base that a robot can have, with voltages or without."""
    return tuple(effect for effect in BASE if voltages or not effect.of_voltages)


def by_id(name: str) -> type[Mechanism]:
    """Return the effect of an id, be it a smooth one. Raise Error when it is neither that nor in the catalogue."""
    known = _BY_ID.get(name)
    if known is not None:
        return known
    smooth = smooth_of(name)
    if smooth is not None:
        return smooth
    reading = smooth_reading_of(name)
    if reading is not None:
        return reading
    raise Error(f"effects: {name!r} is not in the catalogue; {hint(name, _BY_ID, 'docs/effects.md')}")


def fluctuation(sd_v: float, sd_w: float, tau: float) -> EffectSetting:
    """Return steady noise of the rates, sd [m/s], [rad/s] and time constant [s], as a model file has it."""
    return EffectSetting(ProcessNoise.id, {"sd_v": sd_v, "sd_w": sd_w, "tau": tau, "growth": 0.0})


def check(settings: tuple[EffectSetting, ...]) -> None:
    """Raise Error for an unknown id, an id given twice, or parameters that do not fit, of a model file."""
    for effect, values in _chosen(settings):
        effect.check(values)


def build(settings: tuple[EffectSetting, ...], context: Context, acting: Chain = _NOTHING) -> Chain:
    """Return the effects on the base among those of a model file.

    acting: those so far; what is still among the settings goes on from the state that it is in, with other values.
    Raise Error for an unknown id, an id given twice, or parameters that do not fit.
    """
    known = {effect.id: effect for effect in acting.all}
    built = [
        _go_on(known[effect.id], values) if effect.id in known else effect(values, context)
        for effect, values in _chosen(settings)
        if issubclass(effect, BaseEffect)
    ]
    built.sort(key=lambda effect: effect.stage)
    return Chain(
        tuple(effect for effect in built if isinstance(effect, VoltageEffect)),
        tuple(effect for effect in built if isinstance(effect, Effect)),
        tuple(effect for effect in built if isinstance(effect, ReferenceEffect)),
    )


def build_laser(
    settings: tuple[EffectSetting, ...], rng: np.random.Generator, acting: Sequence[LaserEffect] = ()
) -> LaserChain:
    """Return the effects on a laser among those of a model file; acting, and raises, as in build.

    Each draws from a generator of its own, so that its noise does not depend on which others there are.
    """
    known = {effect.id: effect for effect in acting}
    seed = int(rng.integers(2**63))
    built = [
        _go_on(known[effect.id], values)
        if effect.id in known
        else effect(values, np.random.default_rng([seed, LASER.index(effect) if effect in LASER else len(LASER)]))
        for effect, values in _chosen(settings)
        if issubclass(effect, LaserEffect)
    ]
    return LaserChain(sorted(built, key=lambda effect: effect.stage))


def build_world(settings: tuple[EffectSetting, ...], rng: np.random.Generator) -> tuple[WorldEffect, ...]:
    """Return the effects on the world's walls among those of a model file; raises as build does."""
    return tuple(effect(values, rng) for effect, values in _chosen(settings) if issubclass(effect, WorldEffect))


def of_world(settings: tuple[EffectSetting, ...]) -> list[EffectSetting]:
    """Return those of a model file that act on the world's walls; raises as build does."""
    return [EffectSetting(effect.id, dict(v)) for effect, v in _chosen(settings) if issubclass(effect, WorldEffect)]


def _go_on(effect: _Acting, values: Mapping[str, float]) -> _Acting:
    """Return an effect that acts already, with values that may be others."""
    if values != effect.values:
        effect.change(values)
    return effect


def _chosen(settings: tuple[EffectSetting, ...]) -> list[tuple[type[Mechanism], Mapping[str, float]]]:
    """Return effects and parameters in the catalogue's order. Raise Error for an id unknown or given twice."""
    twice = [name for name, count in Counter(setting.id for setting in settings).items() if count > 1]
    if twice:
        raise Error(f"effects: {twice[0]!r} is given twice")
    found = [(by_id(setting.id), setting.parameters) for setting in settings]
    return sorted(found, key=lambda pair: (_PLACES.get(pair[0].id, len(ALL)), pair[0].id))


__all__ = [
    "ALL",
    "BASE",
    "CHANNELS",
    "CONSTANTS",
    "COVARIATES",
    "LAGGED",
    "LAGS",
    "LASER",
    "LATE",
    "MEANINGS",
    "MOVING",
    "PERIODIC",
    "RANGE_COVARIATES",
    "RECORDING_TIME",
    "REFERENCE_CHANNELS",
    "RESTS",
    "SMOOTH",
    "WORLD",
    "BaseEffect",
    "BeamEffect",
    "Beams",
    "Chain",
    "Context",
    "Echoes",
    "Effect",
    "FirstOrder",
    "Follower",
    "Follows",
    "LaserChain",
    "LaserEffect",
    "LaserStage",
    "Mechanism",
    "Motion",
    "Parameter",
    "Rate",
    "ReadingEffect",
    "Reference",
    "ReferenceEffect",
    "SmoothReference",
    "Stage",
    "VoltageEffect",
    "Volts",
    "WorldEffect",
    "build",
    "build_laser",
    "build_world",
    "by_id",
    "check",
    "constant_of",
    "curve",
    "factor",
    "fluctuation",
    "incidence",
    "of_base",
    "of_world",
    "slanted",
    "smooth_id",
    "smooth_range_id",
    "smooth_scatter_id",
]

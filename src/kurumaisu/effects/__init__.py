# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of effects: one mechanism per file, and ALL, the only list of them."""

from kurumaisu.effects.base import Context, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.effects.dead_zone import DeadZoneV, DeadZoneW
from kurumaisu.effects.delay import Delay
from kurumaisu.effects.gain import GainV, GainW
from kurumaisu.effects.lag import LagV, LagW
from kurumaisu.effects.left_right_gain import LeftRightGain
from kurumaisu.effects.process_noise import ProcessNoise
from kurumaisu.effects.veer import Veer
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting

ALL: tuple[type[Effect], ...] = (
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


def by_id(name: str) -> type[Effect]:
    """Return the effect of an id. Raise Error when it is not in the catalogue."""
    for effect in ALL:
        if effect.id == name:
            return effect
    raise Error(f"effects: {name!r} is not in the catalogue: {', '.join(effect.id for effect in ALL)}")


def fluctuation(sd_v: float, sd_w: float, tau: float) -> EffectSetting:
    """Return noise of the rates, sd [m/s], [rad/s] and time constant [s], as a model file has it."""
    return EffectSetting(ProcessNoise.id, {"sd_v": sd_v, "sd_w": sd_w, "tau": tau})


def build(settings: tuple[EffectSetting, ...], context: Context) -> tuple[Effect, ...]:
    """Return the effects of a model file in the order in which they act.

    Raise Error for an unknown id, an id given twice, or parameters that do not fit.
    """
    ids = [setting.id for setting in settings]
    for name in ids:
        if ids.count(name) > 1:
            raise Error(f"effects: {name!r} is given twice")
    effects = [by_id(setting.id)(setting.parameters, context) for setting in settings]
    return tuple(sorted(effects, key=lambda effect: effect.stage))


__all__ = [
    "ALL",
    "Context",
    "Effect",
    "Follows",
    "Motion",
    "Parameter",
    "Rate",
    "Stage",
    "build",
    "by_id",
    "fluctuation",
]

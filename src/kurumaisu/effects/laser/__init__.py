# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of a laser's effects. Those of one stage act in the order of the list."""

from kurumaisu.effects.laser.base import LAGGED, LAGS, BeamEffect, Beams, Echoes, LaserEffect, LaserStage, ReadingEffect
from kurumaisu.effects.laser.beam_bias import BeamBias
from kurumaisu.effects.laser.beam_correlation import BeamCorrelation
from kurumaisu.effects.laser.clock_skew import ClockSkew
from kurumaisu.effects.laser.common_mode import CommonMode
from kurumaisu.effects.laser.crosstalk import Crosstalk
from kurumaisu.effects.laser.cyclic import Cyclic
from kurumaisu.effects.laser.dropout import Dropout
from kurumaisu.effects.laser.heavy_tails import HeavyTails
from kurumaisu.effects.laser.incidence import IncidenceBias, IncidenceNoise
from kurumaisu.effects.laser.latency import Latency
from kurumaisu.effects.laser.mixed_pixels import MixedPixels
from kurumaisu.effects.laser.mount import MountX, MountY, MountYaw
from kurumaisu.effects.laser.quantisation import Quantisation
from kurumaisu.effects.laser.range_bias import RangeOffset, RangeQuadratic, RangeScale
from kurumaisu.effects.laser.range_noise import RangeNoise
from kurumaisu.effects.laser.reflectance import Reflectance
from kurumaisu.effects.laser.saturation import LaserSaturation
from kurumaisu.effects.laser.sweep import Sweep
from kurumaisu.effects.laser.temperature import Temperature
from kurumaisu.effects.laser.tilt import Tilt
from kurumaisu.effects.laser.warmup import WarmUp

LASER: tuple[type[LaserEffect], ...] = (
    MountX,
    MountY,
    MountYaw,
    Tilt,
    Sweep,
    Latency,
    ClockSkew,
    RangeOffset,
    RangeScale,
    RangeQuadratic,
    WarmUp,
    Temperature,
    Cyclic,
    IncidenceBias,
    Reflectance,
    BeamBias,
    RangeNoise,
    IncidenceNoise,
    CommonMode,
    BeamCorrelation,
    HeavyTails,
    MixedPixels,
    Dropout,
    LaserSaturation,
    Crosstalk,
    Quantisation,
)

__all__ = ["LAGGED", "LAGS", "LASER", "BeamEffect", "Beams", "Echoes", "LaserEffect", "LaserStage", "ReadingEffect"]

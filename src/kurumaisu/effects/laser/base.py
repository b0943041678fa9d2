# SPDX-License-Identifier: BSD-3-Clause
"""Effects of a laser: on where its beams leave from and when, and on what they read.

Each works on one scan as arrays over its beams, and knows no scene, so any simulated ranger can have them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar

import numpy as np

from kurumaisu.effects.mechanism import Mechanism
from kurumaisu.types import FloatArray

LAGGED = frozenset({"temperature"})  #: what is recorded that may act late
#: [s] Time constants of what is known of its past.
LAGS = np.r_[0.0, np.geomspace(2.0, 2048.0, 21)]


class LaserStage(IntEnum):
    """When an effect acts on a scan; effects apply in this order, those of a stage in the catalogue's."""

    GEOMETRY = 0  # where beams leave from, and when
    BIAS = 1  # the mean reading
    SPREAD = 2  # the standard deviation of its noise
    NOISE = 3  # the noise itself
    OUTLIER = 4  # readings that are something else
    GRID = 5  # the values a reading can have


@dataclass(frozen=True)
class Beams:
    """Where the beams of a scan leave from, and when.

    stamp [s]: what the message will say; times (n,) [s] at which the beams are fired; mount (3,): base_from_laser;
    height [m] of the laser above the floor; bearings, elevations (n,) [rad] in the frame that the mount gives; start
    [s]: of the run.
    """

    stamp: float
    times: FloatArray
    mount: FloatArray
    height: float
    bearings: FloatArray
    elevations: FloatArray
    start: float = 0.0

    @classmethod
    def single(cls, stamp: float = 0.0) -> Beams:
        """Return one beam, straight ahead from base_link and fired at its stamp, to see what becomes of it."""
        return cls(stamp, np.array([stamp]), np.zeros(3), 0.0, np.zeros(1), np.zeros(1))


@dataclass(frozen=True)
class Echoes:
    """What the beams of a scan met, and what becomes of it on the way to a reading; all arrays are (n,).

    Or of k scans in the order of their stamps: arrays are (k, n), bearings (n,), stamp and what is known (k, 1).
    stamp [s]; bearings [rad] as the message gives them; ranges [m], true; incidence [rad], 0 along the wall's normal,
    and where no effect of the chain is oblique; returns [1]: reflectance, 1 being the surface that the laser's law was
    measured on; mean, sd [m] of a reading; noise [1]: standard deviates; readings [m]: made of the three after the
    stage NOISE, until then they mean nothing.
    origins (n, 3): the laser's pose in the map when each beam is fired, None where nobody knows it.
    known: what else was recorded at the stamp, by name, such as temperature [deg C]; past: of
    LAGGED, behind by first-order lags of LAGS, (k, l), where more than the present is known.
    farthest [m]: the most that the laser reads.
    A beam that met nothing has a range of +inf in the stages OUTLIER and GRID, and of 0 before them.
    """

    stamp: float | FloatArray
    bearings: FloatArray
    ranges: FloatArray
    incidence: FloatArray
    returns: FloatArray
    mean: FloatArray
    sd: FloatArray
    noise: FloatArray
    readings: FloatArray
    origins: FloatArray | None = None
    known: Mapping[str, float | FloatArray] = field(default_factory=dict)
    past: Mapping[str, FloatArray] = field(default_factory=dict)
    farthest: float = 0.0


class LaserEffect(Mechanism):
    """An effect on the scans of one laser."""

    stage: ClassVar[LaserStage]

    def __init__(self, values: Mapping[str, float], rng: np.random.Generator) -> None:
        super().__init__(values)
        self.rng = rng


class BeamEffect(LaserEffect, ABC):
    """An effect on where the beams leave from, and when; it has no state."""

    stage = LaserStage.GEOMETRY

    @abstractmethod
    def apply(self, beams: Beams) -> Beams:
        """Return the beams as they are in truth."""


class ReadingEffect(LaserEffect, ABC):
    """An effect on the readings of a scan, with the state that the scans before have left."""

    oblique: ClassVar[bool] = False  # it needs the incidence, which costs more rays

    @abstractmethod
    def apply(self, echoes: Echoes) -> Echoes:
        """Return the echoes with this effect; scans come in the order of their stamps, one by one or many at once."""

    def draws(self, count: int, echoes: Echoes) -> FloatArray:
        """Return so many even numbers from 0 to 1 for each reading, (count, ...), scan by scan."""
        shape = echoes.readings.shape
        return np.moveaxis(self.rng.random((*shape[:-1], count, shape[-1])), -2, 0)

# SPDX-License-Identifier: BSD-3-Clause
"""What the simulated chair is told, and what is seen of it."""

from __future__ import annotations

from dataclasses import dataclass

from kurumaisu.effects import Reference
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.sim.sensors.suite import Reading
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Command:
    """What the D/A puts out: voltages [V], and the signs of the rates they stand for, NaN where unknown."""

    v_f: float
    v_s: float
    sign_v: float
    sign_w: float


NEUTRAL = Command(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Observation:
    """The truth after a step, and the scan that ended in it, if one did.

    time [s] since the reset; pose (3,) of base_link in the map, theta not wrapped; rates (3,) over the step:
    forward, leftward [m/s], yaw [rad/s]; contact: an obstacle limited the motion; reference: what is measured of
    time, pose and rates, with the effects that act on that; readings: of further sensors that were due.
    """

    time: float
    pose: FloatArray
    rates: FloatArray
    contact: bool
    scan: Scan | None
    reference: Reference
    readings: tuple[Reading, ...]

# SPDX-License-Identifier: BSD-3-Clause
"""What a step of the simulator returns; arrays that nobody changes afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kurumaisu.sim.rangers.scans import Scans
from kurumaisu.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from kurumaisu.effects import Reference
    from kurumaisu.sim.robots.devices import Value
    from kurumaisu.sim.sensors.suite import Reading


@dataclass(frozen=True)
class Observation:
    """What is true and what is believed after a step, a row for each robot.

    time [s] since the reset; poses (n, 4): true x, y, z, heading in the map; odometry (n, 3): x, y, heading as the
    robots believe; velocities (n, 3): forward, leftward, turn as commanded and bounded [m/s, rad/s], also of those
    who are stalled (n,): kept from their last move; dropped: commands since the reset with numbers that are none;
    readings: of those sensors of a sensors.yaml that were due; devices: of those of the world file that were asked for
    and due, by the numbers of their models; reference: what a reference measures of the truth, where effects act on
    that, a row for each robot.
    """

    time: float
    poses: FloatArray
    odometry: FloatArray
    velocities: FloatArray
    stalled: BoolArray
    scans: Scans
    dropped: int
    readings: tuple[Reading, ...]
    devices: Mapping[int, Value]
    reference: Reference | None

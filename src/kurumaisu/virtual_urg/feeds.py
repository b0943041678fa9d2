# SPDX-License-Identifier: BSD-3-Clause
"""What a virtual sensor sees that stands alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.effects import LaserChain
from kurumaisu.params import Laser, Mount, load_model, shipped
from kurumaisu.sim.chair.body import seat
from kurumaisu.sim.chair.scanner import Scanner
from kurumaisu.sim.chair.sight import Sight
from kurumaisu.sim.chair.world import ChairWorld
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.types import FloatArray
from kurumaisu.virtual_urg.models import Sensor
from kurumaisu.world import Start, load_world

Feed = Callable[[], FloatArray]  # the ranges (steps,) [m] of the next turn: NaN an error, +inf no return


def wall(sensor: Sensor, distance: float, seed: int) -> Feed:
    """Look at an endless wall across the sensor's front at a distance [m], with the model file's equation (4)."""
    error = _laser(sensor).error
    cosine = np.cos(sensor.bearings)
    ranges = np.full(sensor.steps, np.inf)
    np.divide(distance, cosine, out=ranges, where=cosine > 0)
    rng = np.random.default_rng(seed)
    return lambda: error.reading(ranges, rng.standard_normal(sensor.steps))


def world(sensor: Sensor, path: Path, pose: FloatArray, seed: int) -> Feed:
    """Stand in a world at a pose (3,) of the sensor [m, m, rad], with the model file's equation (4); nothing moves.

    Raise Error for a world that cannot be read.
    """
    chassis = load_model(shipped("launch/md100.yaml")).chassis
    place = replace(load_world(path), starts=(Start("laser", pose),))
    around = ChairWorld(seat(place, chassis), chassis, load_dynamics(shipped("launch/physical.yaml")), None)
    scanner = Scanner(_laser(sensor), Sight(around), LaserChain([]), np.random.default_rng(seed))
    turns = 0
    scanner.observe(0.0, pose)

    def see() -> FloatArray:
        nonlocal turns
        scan = None
        while scan is None:
            turns += 1
            scan = scanner.observe(turns * sensor.scan_time, pose)
        return scan.ranges

    return see


def _laser(sensor: Sensor) -> Laser:
    """Return the model file's laser with this sensor's fan and timing, at base_link's origin."""
    laser = load_model(shipped("launch/md100.yaml")).laser
    return replace(
        laser,
        mount=Mount(0.0, 0.0, laser.mount.z, 0.0),
        angle_min=float(sensor.bearings[0]),
        angle_increment=sensor.increment,
        beams=sensor.steps,
        scan_time=sensor.scan_time,
        time_increment=sensor.step_time,
    )

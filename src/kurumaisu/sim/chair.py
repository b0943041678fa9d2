# SPDX-License-Identifier: BSD-3-Clause
"""The chair simulated: voltages in, poses and scans out; one seed, one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.sim.body import ChairBody
from kurumaisu.sim.plant import Plant
from kurumaisu.sim.scanner import Scan, Scanner
from kurumaisu.sim.settings import Physics
from kurumaisu.types import FloatArray
from kurumaisu.world import World


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
    forward, leftward [m/s], yaw [rad/s]; contact: an obstacle limited the motion.
    """

    time: float
    pose: FloatArray
    rates: FloatArray
    contact: bool
    scan: Scan | None


class ChairSimulator:
    """One chair in one world."""

    def __init__(self, model: Model, world: World, physics: Physics) -> None:
        """Build the world; the effects that act are the model's. Call reset before step.

        Raise Error if the world has no start pose or the chair does not fit there.
        """
        self._model = model
        self._physics = physics
        self._world = world
        self._scene = Scene(world.segments)
        if self._new_body().touches():
            raise Error(f"{world.path}: the chair, as large as in the model, overlaps a wall at its start pose")

    def reset(self, seed: int) -> Observation:
        """Put the chair back to its start, at rest, and start time and randomness anew."""
        plant_rng, laser_rng = (np.random.default_rng(sequence) for sequence in np.random.SeedSequence(seed).spawn(2))
        self._plant = Plant(self._model, self._physics.step, plant_rng)
        self._scanner = Scanner(self._model.laser, self._scene, laser_rng)
        self._steps = 0
        self._body = self._new_body()
        scan = self._scanner.observe(0.0, self._body.pose)
        return Observation(0.0, self._body.pose, np.zeros(3), False, scan)

    def step(self, command: Command) -> Observation:
        """Advance by one physics step with the command held."""
        v, w = self._plant.from_voltages(
            np.array([command.v_f]),
            np.array([command.v_s]),
            np.array([command.sign_v]),
            np.array([command.sign_w]),
        )
        rates, contact = self._body.move(float(v[0]), float(w[0]))
        self._steps += 1
        time = self._steps * self._physics.step
        pose = self._body.pose
        return Observation(time, pose, rates, contact, self._scanner.observe(time, pose))

    def _new_body(self) -> ChairBody:
        return ChairBody(self._model.chassis, self._world.obstacles, self._physics, self._world.start)

    @property
    def step_time(self) -> float:
        """Length of a step [s]."""
        return self._physics.step

    @property
    def ambiguous_samples(self) -> int:
        """Steps since the reset whose voltages stood for two rates."""
        return self._plant.ambiguous_samples

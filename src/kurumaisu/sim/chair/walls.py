# SPDX-License-Identifier: BSD-3-Clause
"""The chair's world with its walls where the effects on them say, also in the middle of a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import Chassis, EffectSetting
from kurumaisu.sim.chair.body import Scene
from kurumaisu.sim.chair.world import ChairWorld
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray

_STREAM = 3  # which one of a seed's is drawn from


@dataclass(frozen=True)
class Walls:
    """Builds worlds of one scene."""

    scene: Scene
    chassis: Chassis
    dynamics: Dynamics

    def as_drawn(self) -> ChairWorld:
        """Return the world as its file has it."""
        return ChairWorld(self.scene, self.chassis, self.dynamics, None)

    def built(self, settings: tuple[EffectSetting, ...], seed: int) -> ChairWorld:
        """Return the world with the effects on walls among these; one seed, one world. Raise Error as they do."""
        if not effects.of_world(settings):
            return self.as_drawn()
        stream = np.random.SeedSequence(seed).spawn(_STREAM + 1)[_STREAM]

        def distort(walls: FloatArray) -> FloatArray:
            for effect in effects.build_world(settings, np.random.default_rng(stream)):
                walls = effect.apply(walls)
            return walls

        return ChairWorld(self.scene, self.chassis, self.dynamics, distort)

    def among(self, before: ChairWorld, settings: tuple[EffectSetting, ...], seed: int) -> ChairWorld:
        """Return the world so built, with all that moves as it is in another. Raise Error if the chair has no room."""
        world = self.built(settings, seed)
        world.restore(before.state())
        if world.overlaps():
            raise Error("effects: a wall would be inside the chair: drive away from it, or restart with the effect")
        return world

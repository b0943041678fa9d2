# SPDX-License-Identifier: BSD-3-Clause
"""A run from commands that are known beforehand."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kurumaisu.sim.options import Options
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.types import FloatArray
from kurumaisu.world import World


def run(world: World, options: Options, commands: Iterable[FloatArray], seed: int = 0) -> FloatArray:
    """Return the robots' true poses (steps, n, 4) after each of the commands, (n, 3) as Simulator.step wants them."""
    simulator = Simulator(world, options)
    simulator.reset(seed)
    poses = [simulator.step(row).poses for row in commands]
    return np.array(poses).reshape(-1, len(simulator.robots), 4)

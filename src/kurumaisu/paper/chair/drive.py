# SPDX-License-Identifier: BSD-3-Clause
"""The drive of figures 3 to 6 on the simulator, without ROS; the same files drive the chair."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu.critic.experiment.rehearse import Rehearsal, manner
from kurumaisu.critic.values.recording import Recording
from kurumaisu.experiments import Script, load_script
from kurumaisu.params import Model, shipped
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.world import load_world

IDENTIFICATION, HELD_OUT = "launch/paper/identification.yaml", "launch/paper/held_out.yaml"


def script(name: str) -> Script:
    """Return a script of launch/paper."""
    return load_script(shipped(name))


def uneven(model: Model) -> Model:
    """Return the chair on the floor that all simulated experiments have."""
    return with_effects(model, shipped("launch/uneven_floor.yaml"))


class SimulatedTrack:
    """A simulated chair on which drives are recorded."""

    def __init__(self, model: Model, name: str = IDENTIFICATION) -> None:
        """Build the simulator for a drive of launch/paper."""
        self._script = script(name)
        world = load_world(shipped(f"worlds/{self._script.world}"))
        self._rehearsal = Rehearsal(model, world, load_dynamics(shipped("launch/physical.yaml")), manner())

    def record(self, seed: int) -> Recording:
        """Return a drive. Raise Error when the chair leaves the box."""
        return self._rehearsal.run(self._script, np.random.default_rng(seed))


def recorded(model: Model, name: str, seed: int) -> Recording:
    """Return one drive of launch/paper on a chair. Raise Error when it leaves the box."""
    return SimulatedTrack(model, name).record(seed)


def model_of(path: Path | None) -> Path:
    """Return a model file, the package's own where none is named."""
    return shipped("launch/md100.yaml") if path is None else path

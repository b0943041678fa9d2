# SPDX-License-Identifier: BSD-3-Clause
"""Scripted experiments on the simulator, without ROS: what the critic would be given after one on the chair."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.experiment import simulated
from kurumaisu.critic.experiment.simulated import Manner, Notes
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.errors import Error
from kurumaisu.experiments import Place, Script, samples
from kurumaisu.params import Model
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command, Observation
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import World


class Rehearsal:
    """A chair in a world on which scripts are run; the effects of its model act, its critic need not know them."""

    def __init__(self, model: Model, world: World, dynamics: Dynamics, manner: Manner) -> None:
        """Build the simulator. Raise Error as ChairSimulator does."""
        self._model = model
        self._manner = manner
        self._simulator = ChairSimulator(model, world, dynamics)

    def run(self, script: Script, rng: np.random.Generator) -> Recording:
        """Return the recording of a script from the world's start on, at rest; a run per place, or one.

        Raise Error when the chair touches something or leaves the script's box.
        """
        observation = self._simulator.reset(int(rng.integers(2**31)))
        if script.kind == "places":
            runs = self._stand(script, observation, rng)
        else:
            inputs = self._inputs(script)
            steps = simulated.held(inputs["voltage"], self._simulator.step_time)
            runs = [self._drive(script, observation, steps).run(script.name, rng, inputs)]
        return simulated.recording(script.name, runs, self._model, self._manner)

    def _inputs(self, script: Script) -> dict[str, FloatArray]:
        """Return the tables command (n, 3) of a drive, and voltage (n, 5): t, v_f, v_s, v, w, NaN where unknown."""
        rows = samples(script.phases, self._manner.period)
        t = rows[:, 0]
        if script.kind == "sweep":
            if not self._model.robot.voltages:
                raise Error(f"{script.name}: asks for voltages, and {self._model.robot.kind} has none")
            unknown = np.full(len(t), np.nan)
            return {"voltage": np.column_stack([t, np.zeros(len(t)), rows[:, 1], unknown, unknown])}
        return {"command": rows, "voltage": simulated.voltages(self._model, self._manner.limits, rows)}

    def _drive(self, script: Script, observation: Observation, steps: list[Command]) -> Notes:
        """Return what is noted of a drive."""
        start, notes = observation.pose, Notes(self._model, self._manner, observation)
        for command in steps:
            observation = self._simulator.step(command)
            self._watch(script, start, observation)
            notes.add(observation)
        return notes

    def _stand(self, script: Script, observation: Observation, rng: np.random.Generator) -> list[Run]:
        start = observation.pose
        name = self._simulator.chair.name or ""
        runs = []
        for number, place in enumerate(script.places, 1):
            self._put(name, start, place)
            steps = [NEUTRAL] * round(place.seconds / self._simulator.step_time)
            notes = self._drive(script, self._simulator.step(NEUTRAL), steps)
            runs.append(notes.run(f"place_{number}", rng, {}))
        return runs

    def _put(self, name: str, start: FloatArray, place: Place) -> None:
        x, y, heading = geometry.compose(start, place.pose)
        self._simulator.set_pose(name, [x, y, 0.0, heading])

    def _watch(self, script: Script, start: FloatArray, observation: Observation) -> None:
        if observation.contact:
            raise Error(f"{script.name}: the chair touches something at {observation.time:.2f} s")
        if script.kind != "places" and script.box.excess(geometry.between(start, observation.pose)) > 0:
            raise Error(f"{script.name}: the chair leaves its box at {observation.time:.2f} s")

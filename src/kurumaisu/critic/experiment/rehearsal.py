# SPDX-License-Identifier: BSD-3-Clause
"""Scripted experiments on the simulator, without ROS: what the critic would be given after one on the chair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.errors import Error
from kurumaisu.experiments import Limits, Place, Script, samples
from kurumaisu.params import Model
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command, Observation
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import World


@dataclass(frozen=True)
class Manner:
    """How the base and the reference work.

    period [s] of the base's loop; limits: the base's own, which bound what a script asks for;
    pose_every [s]; position_sd [m], heading_sd [rad] of the reference.
    """

    period: float
    limits: Limits
    pose_every: float
    position_sd: float
    heading_sd: float


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
            poses, scans = self._drive(script, observation, self._steps(inputs["voltage"]))
            runs = [self._run(script.name, poses, scans, rng, inputs)]
        laser, sd = self._model.laser, (self._manner.position_sd, self._manner.heading_sd)
        return Recording(
            script.name,
            tuple(runs),
            train=tuple(run.name for run in runs),
            laser=LaserMount(
                laser.mount.x, laser.mount.y, laser.mount.yaw, laser.angle_min, laser.angle_increment, laser.beams
            ),
            truth=sd if min(sd) > 0 else None,
        )

    def _inputs(self, script: Script) -> dict[str, FloatArray]:
        """Return the tables command (n, 3) of a drive, and voltage (n, 5): t, v_f, v_s, v, w, NaN where unknown."""
        rows = samples(script.phases, self._manner.period)
        t = rows[:, 0]
        if script.kind == "sweep":
            unknown = np.full(len(t), np.nan)
            return {"voltage": np.column_stack([t, np.zeros(len(t)), rows[:, 1], unknown, unknown])}
        limits = self._manner.limits
        v, w = np.clip(rows[:, 1], -limits.v_reverse, limits.v_forward), np.clip(rows[:, 2], -limits.w, limits.w)
        volts = self._model.translation.volts(v), self._model.steering.volts(w)
        return {"command": rows, "voltage": np.column_stack([t, *volts, v, w])}

    def _steps(self, voltage: FloatArray) -> list[Command]:
        """Return what is held during each step of the simulator."""
        step = self._simulator.step_time
        times = step * np.arange(round(voltage[-1, 0] / step))
        held = voltage[np.searchsorted(voltage[:, 0], times + 1e-9, side="right") - 1]
        return [Command(row[1], row[2], *np.sign(row[3:])) for row in held]

    def _drive(
        self, script: Script, observation: Observation, steps: list[Command]
    ) -> tuple[list[Observation], list[Observation]]:
        """Return the observations at which the reference measures, and those that brought a scan."""
        start, poses, scans = observation.pose, [observation], []
        for command in steps:
            observation = self._simulator.step(command)
            self._watch(script, start, observation)
            if observation.time >= poses[-1].time + self._manner.pose_every - 1e-9:
                poses.append(observation)
            if observation.scan is not None:
                scans.append(observation)
        return poses, scans

    def _stand(self, script: Script, observation: Observation, rng: np.random.Generator) -> list[Run]:
        start = observation.pose
        name = self._simulator.chair.name or ""
        runs = []
        for number, place in enumerate(script.places, 1):
            self._put(name, start, place)
            steps = [NEUTRAL] * round(place.seconds / self._simulator.step_time)
            poses, scans = self._drive(script, self._simulator.step(NEUTRAL), steps)
            runs.append(self._run(f"place_{number}", poses, scans, rng, {}))
        return runs

    def _put(self, name: str, start: FloatArray, place: Place) -> None:
        x, y, heading = geometry.compose(start, place.pose)
        self._simulator.set_pose(name, [x, y, 0.0, heading])

    def _watch(self, script: Script, start: FloatArray, observation: Observation) -> None:
        if observation.contact:
            raise Error(f"{script.name}: the chair touches something at {observation.time:.2f} s")
        if script.kind != "places" and script.box.excess(geometry.between(start, observation.pose)) > 0:
            raise Error(f"{script.name}: the chair leaves its box at {observation.time:.2f} s")

    def _run(
        self,
        name: str,
        poses: list[Observation],
        scans: list[Observation],
        rng: np.random.Generator,
        inputs: dict[str, FloatArray],
    ) -> Run:
        seen = np.array([[float(o.reference.times), *o.reference.poses] for o in poses])
        sd = np.array([self._manner.position_sd, self._manner.position_sd, self._manner.heading_sd])
        seen[:, 1:] += sd * rng.standard_normal((len(seen), 3))
        since = poses[0].time  # a scan begun before the chair was put here saw another place
        ranges = np.array([[o.scan.time, *o.scan.ranges] for o in scans if o.scan and o.scan.time >= since - 1e-9])
        beams = tuple(f"r{i}" for i in range(self._model.laser.beams))
        command, voltage = inputs.get("command"), inputs.get("voltage")
        known = () if voltage is None or np.isnan(voltage[:, 3]).any() else ("v", "w")
        return Run(
            name,
            command=None if command is None else Series.of_table(command, "v", "w"),
            voltage=None if voltage is None else Series.of_table(voltage[:, : 3 + len(known)], "v_f", "v_s", *known),
            pose=Series.of_table(seen, "x", "y", "theta"),
            scan=Series.of_table(ranges, *beams) if len(ranges) and np.isfinite(ranges[:, 1:]).any() else None,
        )

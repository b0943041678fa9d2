# SPDX-License-Identifier: BSD-3-Clause
"""What a drive of the simulated chair leaves behind: a recording as the critic is given one of the real chair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.experiments import Limits
from kurumaisu.params import Model
from kurumaisu.sim.chair.simulator import Command, Observation
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Manner:
    """How the base and the reference work.

    period [s] of the base's loop; limits: the base's own, which bound what is asked for;
    pose_every [s]; position_sd [m], heading_sd [rad] of the reference.
    """

    period: float
    limits: Limits
    pose_every: float
    position_sd: float
    heading_sd: float


def voltages(model: Model, limits: Limits, rows: FloatArray) -> FloatArray:
    """Return the table (n, 5) of t, v_f, v_s, v, w that the base makes of commands (n, 3) of t, v, w."""
    v, w = np.clip(rows[:, 1], -limits.v_reverse, limits.v_forward), np.clip(rows[:, 2], -limits.w, limits.w)
    return np.column_stack([rows[:, 0], model.translation.volts(v), model.steering.volts(w), v, w])


def held(voltage: FloatArray, step: float) -> list[Command]:
    """Return what is held during each step [s] of the simulator, until the last row of a table of voltages."""
    times = step * np.arange(round(voltage[-1, 0] / step))
    rows = voltage[np.searchsorted(voltage[:, 0], times + 1e-9, side="right") - 1]
    return [Command(row[1], row[2], *np.sign(row[3:])) for row in rows]


class Notes:
    """Takes down the observations at which the reference measures, and those that brought a scan."""

    def __init__(self, model: Model, manner: Manner, start: Observation) -> None:
        self._model, self._manner = model, manner
        self._poses, self._scans = [start], list[Observation]()

    def add(self, observation: Observation) -> None:
        """Hear of a step."""
        if observation.time >= self._poses[-1].time + self._manner.pose_every - 1e-9:
            self._poses.append(observation)
        if observation.scan is not None:
            self._scans.append(observation)

    def run(self, name: str, rng: np.random.Generator, inputs: dict[str, FloatArray]) -> Run:
        """Return it all as a run; inputs: tables command (n, 3), voltage (n, 5) with NaN where rates are unknown."""
        poses = self._poses
        seen = np.array([[float(o.reference.times), *o.reference.poses] for o in poses])
        sd = np.array([self._manner.position_sd, self._manner.position_sd, self._manner.heading_sd])
        seen[:, 1:] += sd * rng.standard_normal((len(seen), 3))
        since = poses[0].time  # a scan begun before the chair was put here saw another place
        ranges = np.array(
            [[o.scan.time, *o.scan.ranges] for o in self._scans if o.scan and o.scan.time >= since - 1e-9]
        )
        beams = tuple(f"r{i}" for i in range(self._model.laser.beams))
        command, voltage = inputs.get("command"), inputs.get("voltage")
        if voltage is not None and not self._model.robot.voltages:
            command, voltage = voltage[:, [0, 3, 4]], None  # what the limits left of what was asked for
        known = () if voltage is None or np.isnan(voltage[:, 3]).any() else ("v", "w")
        return Run(
            name,
            command=None if command is None else Series.of_table(command, "v", "w"),
            voltage=None if voltage is None else Series.of_table(voltage[:, : 3 + len(known)], "v_f", "v_s", *known),
            pose=Series.of_table(seen, "x", "y", "theta"),
            scan=Series.of_table(ranges, *beams) if len(ranges) and np.isfinite(ranges[:, 1:]).any() else None,
        )


def recording(name: str, runs: list[Run], model: Model, manner: Manner) -> Recording:
    """Return the recording of some runs of a chair, all to fit by."""
    laser, sd = model.laser, (manner.position_sd, manner.heading_sd)
    mount = laser.mount
    return Recording(
        name,
        tuple(runs),
        train=tuple(run.name for run in runs),
        laser=LaserMount(mount.x, mount.y, mount.yaw, laser.angle_min, laser.angle_increment, laser.beams),
        truth=sd if min(sd) > 0 else None,
        robot=None if model.robot.voltages else model.robot,
    )

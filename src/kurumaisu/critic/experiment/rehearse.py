# SPDX-License-Identifier: BSD-3-Clause
"""critic rehearse NAME: run a scripted experiment on the simulator, without ROS, and write it as a recording."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from kurumaisu import geometry, program, settings
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.values.recording import LaserMount, Recording, Run, Series
from kurumaisu.errors import Error, failed
from kurumaisu.experiments import Limits, Script, base_limits, load_script, names, samples, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command, Observation
from kurumaisu.sim.settings import Dynamics, load_dynamics, with_effects
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import World, load_world


def main(arguments: Sequence[str] | None = None) -> int:
    """Rehearse experiments; return 0, or 1 when one cannot be run."""
    options = _parser().parse_args(arguments)
    try:
        for name in options.names:
            write(options.output, rehearse(name, options.model, options.effects, options.seed))
    except Error as error:
        return failed("critic rehearse", error)
    print(f"recording: {options.output}")
    return 0


def rehearse(name: str, model: Path, effects: Path | None, seed: int) -> Recording:
    """Return the recording of one of the package's experiments, or of a file's, on a chair with these effects.

    Raise Error naming what is wrong with a file, or what happened to the chair.
    """
    script = load_script(Path(name)) if name.endswith(".yaml") else shipped_script(name)
    chair = load_model(model) if effects is None else with_effects(load_model(model), effects)
    world = load_world(shipped(f"worlds/{script.world}"))
    dynamics = load_dynamics(shipped("launch/physical.yaml"))
    return Rehearsal(chair, world, dynamics, manner()).run(script, np.random.default_rng(seed))


def manner() -> Manner:
    """Return how base and reference work, launch/rehearsal.yaml and base_node.yaml. Raise Error naming file and key."""
    reference = settings.load(shipped("launch/rehearsal.yaml")).section("reference")
    found = Manner(
        limits=base_limits(),
        pose_every=reference.number("every", above=0),
        position_sd=reference.number("position_sd", at_least=0),
        heading_sd=reference.number("heading_sd", at_least=0),
    )
    reference.end()
    return found


def write(folder: Path, recording: Recording) -> None:
    """Add the runs of a recording to a folder of CSV tables with its meta.yaml. Raise Error for what is in the way."""
    for run in recording.runs:
        name = run.name if len(recording.runs) == 1 else f"{recording.name}_{run.name}"
        write_csv_run(folder / name, run)
    laser, truth = recording.laser, recording.truth
    meta: dict[str, object] = {} if laser is None else {"laser": laser.known}
    if truth is not None:
        meta["truth"] = {"position_sd": truth[0], "heading_sd": truth[1]}
    if recording.robot is not None:
        meta["robot"] = recording.robot.said
    write_whole({folder / "meta.yaml": yaml.safe_dump(meta, sort_keys=False)})


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="critic rehearse", description="Run experiments on the simulator alone.")
    parser.add_argument("names", nargs="+", metavar="NAME", help=f"of {', '.join(names())}; or a .yaml file")
    parser.add_argument("-o", "--output", type=Path, default=Path("rehearsed"), help="folder to write into")
    parser.add_argument("--model", type=Path, default=shipped("launch/md100.yaml"), help="model file of the chair")
    parser.add_argument("--effects", type=Path, help="file of effects besides the model's own")
    parser.add_argument("--seed", type=int, default=1)
    return parser


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
            steps = held(inputs["voltage"], self._simulator.step_time)
            runs = [self._drive(script, observation, steps).run(script.name, rng, inputs)]
        return recording(script.name, runs, self._model, self._manner)

    def _inputs(self, script: Script) -> dict[str, FloatArray]:
        """Return the tables command (n, 3) of a drive, and voltage (n, 5): t, v_f, v_s, v, w, NaN where unknown."""
        rows = samples(script.phases, PERIOD)
        t = rows[:, 0]
        if script.kind == "sweep":
            if not self._model.robot.voltages:
                raise Error(f"{script.name}: asks for voltages, and {self._model.robot.kind} has none")
            unknown = np.full(len(t), np.nan)
            return {"voltage": np.column_stack([t, np.zeros(len(t)), rows[:, 1], unknown, unknown])}
        return {"command": rows, "voltage": voltages(self._model, self._manner.limits, rows)}

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
            x, y, heading = geometry.compose(start, place.pose)
            self._simulator.set_pose(name, [x, y, 0.0, heading])
            steps = [NEUTRAL] * round(place.seconds / self._simulator.step_time)
            notes = self._drive(script, self._simulator.step(NEUTRAL), steps)
            runs.append(notes.run(f"place_{number}", rng, {}))
        return runs

    def _watch(self, script: Script, start: FloatArray, observation: Observation) -> None:
        if observation.contact:
            raise Error(f"{script.name}: the chair touches something at {observation.time:.2f} s")
        if script.kind != "places" and script.box.excess(geometry.between(start, observation.pose)) > 0:
            raise Error(f"{script.name}: the chair leaves its box at {observation.time:.2f} s")


@dataclass(frozen=True)
class Manner:
    """How the base and the reference work.

    limits: the base's own, which bound what is asked for;
    pose_every [s]; position_sd [m], heading_sd [rad] of the reference.
    """

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

# SPDX-License-Identifier: BSD-3-Clause
"""critic rehearse NAME: run a scripted experiment on the simulator, without ROS, and write it as a recording."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from kurumaisu import program, settings
from kurumaisu.critic.data.csv_writer import write_csv_run
from kurumaisu.critic.experiment.rehearsal import Rehearsal
from kurumaisu.critic.experiment.simulated import Manner
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error, failed
from kurumaisu.experiments import base_limits, load_script, names, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.whole_files import write_whole
from kurumaisu.world import load_world


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
        period=PERIOD,
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

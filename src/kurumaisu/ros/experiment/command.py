# SPDX-License-Identifier: BSD-3-Clause
"""critic experiment NAME: run a scripted experiment on the chair, or on the simulator behind the same topics."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import rospy

from kurumaisu import program, settings
from kurumaisu.errors import Error, one_line
from kurumaisu.experiments import Script, load_script, names, shipped_script
from kurumaisu.experiments.supervisor import read_care
from kurumaisu.params import load_model, shipped
from kurumaisu.ros import life, parent_launch
from kurumaisu.ros.experiment.drive import run_drive
from kurumaisu.ros.experiment.places import run_places
from kurumaisu.ros.experiment.surroundings import ExperimentSpace

_HELP = """
Run a scripted experiment on the chair, or on the simulator behind the same
topics. It begins when the chair stands; Ctrl-C stops it.

subscribes to:
  ground_truth, odom  where the chair is
  active_input        the input that drives: on any other the experiment stops
  collision
publishes:
  experiment_vel      commands for base_node; a sweep sends voltages instead
parameters:
  launch/experiment_node.yaml, by --settings

Exit code: 0 done, 1 refused or stopped, 2 wrong usage.
More: docs/experiments.md
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an experiment; return 0 when it is done, 1 when it was refused or stopped."""
    given = rospy.myargv(sys.argv if arguments is None else ["experiment", *arguments])[1:]
    options = _parser().parse_args(given)
    try:
        script = load_script(options.file) if options.file else shipped_script(options.name)
    except Error as error:
        return _stopped(options.name, one_line(error))
    return life.run("experiment", partial(_tell, script, options), anonymous=True)


def _tell(script: Script, options: argparse.Namespace, own: life.Life) -> int:
    try:
        why = _run(script, options, own.asked.is_set)
    except Error as error:
        why = one_line(error)
    if why:
        return _stopped(options.name, why)
    words = f"experiment: {options.name}: done, {script.seconds:.0f} s{_hint(options.bag)}"
    parent_launch.done(words, options.ends_launch, own.asked)
    return 0


def _stopped(name: str, why: str) -> int:
    print(f"experiment: {name}: {why}", file=sys.stderr)
    return 1


def _run(script: Script, options: argparse.Namespace, stop: Callable[[], bool]) -> str:
    """Return why it was stopped, '' when it is done. Raise Error when it is refused."""
    care = read_care(settings.load(options.settings))
    model = load_model(options.model)
    ground = ExperimentSpace(script, model.chassis, care, options.world)
    if stop():
        return "interrupted"
    print(f"experiment: {options.name}: {script.seconds:.0f} s; Ctrl-C stops it", file=sys.stderr, flush=True)
    if script.kind == "places":
        return run_places(script, care, ground, stop, options.bag)
    return run_drive(script, care, model, ground, stop, options.bag)


def _hint(bag: Path | None) -> str:
    return "" if bag is None else f"; now: critic {bag}"


def _parser() -> argparse.ArgumentParser:
    parser = program.node_parser("critic experiment", _HELP)
    parser.add_argument("name", help=f"one of {', '.join(names())}; or any name for a --file")
    parser.add_argument("--file", type=Path, help="your own script")
    parser.add_argument("--bag", type=Path, help="record into this bag (a folder of bags, where there are places)")
    parser.add_argument("--world", help="world file to check for space, or none (default: the simulator's)")
    parser.add_argument("--model", type=Path, default=shipped("launch/md100.yaml"), help="model file of the chair")
    parser.add_argument("--settings", type=Path, default=shipped("launch/experiment_node.yaml"))
    parent_launch.add_option(parser)
    return parser

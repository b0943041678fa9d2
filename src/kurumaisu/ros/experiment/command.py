# SPDX-License-Identifier: BSD-3-Clause
"""critic experiment NAME: run a scripted experiment on the chair, or on the simulator behind the same topics."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

import rospy

from kurumaisu import program, settings
from kurumaisu.errors import Error, one_line
from kurumaisu.experiments import Script, load_script, names, shipped_script
from kurumaisu.experiments.supervisor import read_care
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.experiment.drive import run_drive
from kurumaisu.ros.experiment.places import run_places
from kurumaisu.ros.experiment.surroundings import ExperimentSpace
from kurumaisu.ros.graph import wait_until_gone

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
_LONGEST = 10.0  # [s] of wall time for stopping when killed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an experiment; return 0 when it is done, 1 when it was refused or stopped."""
    given = rospy.myargv(sys.argv if arguments is None else ["experiment", *arguments])[1:]
    options = _parser().parse_args(given)
    try:
        script = load_script(options.file) if options.file else shipped_script(options.name)
        # Its own handler of Ctrl-C: ROS's closes the topics before the chair has been told to stop.
        rospy.init_node("experiment", anonymous=True, disable_signals=True)
        why = _run(script, options)
    except Error as error:
        why = one_line(error)
    if why:
        print(f"experiment: {options.name}: {why}", file=sys.stderr)
        return 1
    print(f"experiment: {options.name}: done, {script.seconds:.0f} s{_hint(options.bag)}")
    return 0


def _run(script: Script, options: argparse.Namespace) -> str:
    """Return why it was stopped, '' when it is done. Raise Error when it is refused."""
    care = read_care(settings.load(options.settings))
    model = load_model(options.model)
    stop = _Stop()
    try:
        ground = ExperimentSpace(script, model.chassis, care, options.world)
        print(f"experiment: {options.name}: {script.seconds:.0f} s; Ctrl-C stops it", file=sys.stderr, flush=True)
        if script.kind == "places":
            return run_places(script, care, ground, stop, options.bag)
        return run_drive(script, care, model, ground, stop, options.bag)
    finally:
        stop.heeded.set()
        if stop.killed:  # ROS signs off in a thread of its own, which the end of the program would cut short
            wait_until_gone(_LONGEST)


class _Stop:
    """Whether somebody wants it to end: Ctrl-C, kill, rosnode kill."""

    def __init__(self) -> None:
        self.heeded = threading.Event()
        self.killed = False  # by ROS
        self._signalled = False
        rospy.on_shutdown(self._shut_down)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def __call__(self) -> bool:
        return self._signalled or rospy.is_shutdown()

    def _shut_down(self) -> None:
        """Keep the topics open until the chair has been told to stop: rosnode kill closes them after this."""
        self.killed = self._signalled = True
        self.heeded.wait(_LONGEST)

    def _note(self, _number: int, _frame: object) -> None:
        self._signalled = True


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
    return parser

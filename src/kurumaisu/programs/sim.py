# SPDX-License-Identifier: BSD-3-Clause
"""kurumaisu sim [FILE.world]: drive the simulated chair by commands, and write what was measured as a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from kurumaisu import program, settings
from kurumaisu.critic.data.csv_reader import read_table
from kurumaisu.critic.experiment import rehearse
from kurumaisu.critic.experiment.rehearse import Notes, manner, write
from kurumaisu.critic.view.command import Opened, port_number, stay, viewer_settings
from kurumaisu.errors import Error, failed
from kurumaisu.params import Model, load_model, shipped
from kurumaisu.programs.live import LiveChair, Stick
from kurumaisu.sim.chair.simulator import ChairSimulator
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.types import FloatArray
from kurumaisu.viewer import Hub, Server
from kurumaisu.world import load_world

_LONGEST = 86_400.0  # [s] of a drive: all that is measured is kept in memory
_EPILOG = """\
examples:
  kurumaisu sim -v 0.3 -w 0.2 --seconds 20         driven/drive
  kurumaisu sim --commands drive.csv -o mine       columns t, v, w; each row holds
                                                   until the next, the last one ends it
  kurumaisu critic driven                          what the critic says of it
  kurumaisu sim --viewer                           prints the address of a page

More: docs/without_ros.md"""


def main(arguments: list[str] | None = None) -> int:
    """Drive; return 0, or 1 for bad input, which is told on one line."""
    parser = _parser()
    options = parser.parse_args(arguments)
    given = (options.v, options.w, options.seconds) != (None, None, None)
    if options.commands is not None and given:
        parser.error("--commands says what -v, -w and --seconds would")
    if options.viewer and (given or options.commands is not None):
        parser.error("--viewer: the page says what -v, -w, --seconds and --commands would")
    try:
        if options.viewer:
            _serve(options)
        else:
            _drive(options)
    except Error as error:
        return failed("sim", error)
    return 0


def _chair(options: argparse.Namespace) -> tuple[Model, ChairSimulator]:
    model = load_model(options.model)
    model = model if options.effects is None else with_effects(model, options.effects)
    return model, ChairSimulator(model, load_world(options.world), load_dynamics(shipped("launch/physical.yaml")))


def _serve(options: argparse.Namespace) -> None:
    model, simulator = _chair(options)
    simulator.reset(options.seed)
    how = viewer_settings(options.port)
    drive = settings.load(shipped("launch/viewer.yaml")).section("drive")
    stick = Stick(*(drive.number(name, above=0) for name in ("v", "w", "dead_man")))
    hub = Hub()
    chair = LiveChair(hub, options.world.stem, simulator, model, options.model, stick, manner().limits, how.rate)
    stay(Opened(chair, Server(how, hub, chair, control=True), f"{model.name} in {options.world}"))


def _drive(options: argparse.Namespace) -> None:
    rows = _constant(options) if options.commands is None else commands(options.commands)
    (model, simulator), how = _chair(options), manner()
    rng = np.random.default_rng(options.seed)
    seen = simulator.reset(int(rng.integers(2**31)))
    notes, touches, touched = Notes(model, how, seen), 0, False
    volts = rehearse.voltages(model, how.limits, rows)
    for command in rehearse.held(volts, simulator.step_time):
        seen = simulator.step(command)
        notes.add(seen)
        touches += seen.contact and not touched
        touched = seen.contact
    run = notes.run("drive", rng, {"command": rows, "voltage": volts})
    write(options.output, rehearse.recording("drive", [run], model, how))
    x, y, heading = seen.pose
    print(
        f"{seen.time:.2f} s driven, now at x {x:.3f}, y {y:.3f} m, {np.degrees(heading):.1f} deg; "
        f"touched something {touches} times\nrecording: {options.output}"
    )


def commands(path: Path) -> FloatArray:
    """Return the rows (n, 3) of t [s], v [m/s], w [rad/s] in a table. Raise Error naming file and row."""
    columns, table, _ = read_table(path, ("t", "v", "w"))
    rows = table[:, [columns.index(name) for name in ("t", "v", "w")]]
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise Error(f"{path}:{bad[0] + 2}: every cell must be a number")
    if len(rows) < 2 or rows[0, 0] < 0 or rows[-1, 0] > _LONGEST or (np.diff(rows[:, 0]) <= 0).any():
        raise Error(f"{path}: t must increase, from 0 or later to at most {_LONGEST:g} s, in two rows or more")
    return rows if rows[0, 0] == 0 else np.concatenate([np.zeros((1, 3)), rows])


def _constant(options: argparse.Namespace) -> FloatArray:
    v, w, seconds = (
        given if given is not None else usual
        for given, usual in ((options.v, 0.2), (options.w, 0.0), (options.seconds, 10.0))
    )
    if not np.isfinite([v, w]).all() or not 0 < seconds <= _LONGEST:
        raise Error(f"-v and -w must be numbers, --seconds more than 0 and at most {_LONGEST:g}: {v} {w} {seconds}")
    return np.array([[0.0, v, w], [seconds, 0.0, 0.0]])


def _parser() -> argparse.ArgumentParser:
    about = "Drive the simulated chair by commands, and write what was measured as a recording."
    parser = program.text_parser("kurumaisu sim", about, _EPILOG)
    add = parser.add_argument
    usual = "of this package, worlds/arena.world"
    add("world", type=Path, nargs="?", default=shipped("worlds/arena.world"), metavar="FILE", help=f"world ({usual})")
    add("-v", type=float, metavar="M/S", help="velocity ahead that is asked for (0.2)")
    add("-w", type=float, metavar="RAD/S", help="rate of turn that is asked for (0)")
    add("--seconds", type=float, metavar="S", help="how long (10)")
    add("--commands", type=Path, metavar="FILE.csv", help="a table of commands in place of one")
    add(
        "--model",
        type=Path,
        default=shipped("launch/md100.yaml"),
        metavar="FILE",
        help="model of the chair (md100.yaml)",
    )
    add("--effects", type=Path, metavar="FILE", help="file of effects besides the model's own")
    add("--seed", type=int, default=1, metavar="N", help="of all that is drawn (1)")
    add("--viewer", action="store_true", help="drive by hand, on a page for browsers; writes nothing")
    add("--port", type=port_number, metavar="N", help="of the page; 0 takes a free one (launch/viewer.yaml's)")
    add("-o", "--output", type=Path, default=Path("driven"), metavar="FOLDER", help="folder to write into (driven)")
    return parser

# SPDX-License-Identifier: BSD-3-Clause
"""paper FIGURES: repeat the paper's experiments on the simulator, or evaluate recordings of the chair."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.paper.commands import drive, wall
from kurumaisu.params import shipped


def main(arguments: Sequence[str] | None = None) -> int:
    """Repeat figures; return 0, 1 when something is refused or does not agree with the paper's equations."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same sums, however many cores there are
    options = _parser().parse_args(arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # what was started is ended on the way out
    command: Callable[[argparse.Namespace], int] = options.command
    try:
        return command(options)
    except Error as error:
        return failed("paper", error)


def _drive(options: argparse.Namespace) -> int:
    if options.through_base:
        from kurumaisu.ros.paper import figures

        return figures.drive(
            options.model, options.out, seed=options.seed, speed=options.speed, settings=options.settings
        )
    return drive.figures_drive(
        options.model,
        options.recordings,
        options.out,
        seed=options.seed,
        keep=options.keep,
        settings=options.settings,
    )


def _wall(options: argparse.Namespace) -> int:
    return wall.figures_wall_of(options.model, options.recordings, options.out, **_of_wall(options))


def _conjecture(options: argparse.Namespace) -> int:
    return wall.asked(options.model, options.recordings, options.out, say=drive.say, **_of_wall(options))


def _of_wall(options: argparse.Namespace) -> dict[str, Any]:
    return {"distances": options.distances, "seed": options.seed, "settings": options.settings}


def _dac(options: argparse.Namespace) -> int:
    from kurumaisu.ros.paper import figures

    return figures.dac(options.model, options.out, options.speeds)


def _simulated_wall(options: argparse.Namespace) -> int:
    from kurumaisu.ros.paper import figures

    return figures.simulated_wall(
        options.model, options.out, seed=options.seed, speed=options.speed, settings=options.settings
    )


def _all(options: argparse.Namespace) -> int:
    from kurumaisu.ros.paper import figures

    return figures.everything(options.model, options.out, seed=options.seed, settings=options.settings)


def _odometry(options: argparse.Namespace) -> int:
    from kurumaisu.ros.tools.replay_odometry import check

    return max(check(bag) for bag in options.bags)


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="paper", description=__doc__)
    parts = parser.add_subparsers(required=True, metavar="FIGURES")
    drive = _part(parts, "drive", _drive, "figures 3 to 6, equations (1) and (2): a drive")
    drive.add_argument(
        "recordings", nargs="*", type=Path, help="bags or folders of a real drive; none: a simulated one"
    )
    drive.add_argument(
        "--keep", action="append", default=[], metavar="BRANCH", help="take a refused branch from the model"
    )
    drive.add_argument(
        "--through-base", action="store_true", help="drive the simulator through base_node and its limits: needs ROS"
    )
    drive.add_argument("--speed", type=float, default=4.0, help="simulated seconds per second, with --through-base")
    wall = _part(parts, "wall", _wall, "figures 7 to 9, equation (4): scans of a wall at known distances")
    wall.add_argument("recordings", nargs="*", type=Path, help="scans of a real wall; none: of the simulated board")
    wall.add_argument(
        "--distances", nargs="+", type=float, default=[], help="[m] of the runs, by name; none: the paper's"
    )
    conjecture = _part(
        parts, "conjecture", _conjecture, "does noise rise with range, or with incidence? The critic's answer"
    )
    conjecture.add_argument(
        "recordings", nargs="*", type=Path, help="of a wall, with its world; none: simulated data of both kinds"
    )
    conjecture.add_argument(
        "--distances",
        nargs="+",
        type=float,
        default=[],
        help="[m] of the runs, by name: fits the law straight ahead first",
    )
    dac = _part(parts, "dac", _dac, "figure 10: voltages at the D/A converter")
    dac.add_argument("--speeds", type=Path, help="script of speeds, instead of launch/paper/figure_10.yaml")
    simulated = _part(
        parts, "simulated-wall", _simulated_wall, "figures 11 and 12: a simulated wall, through the driver"
    )
    simulated.add_argument("--speed", type=float, default=2.0, help="simulated seconds per second")
    _part(parts, "all", _all, "all figures, one after the other")
    odometry = parts.add_parser("odometry", help="recompute odometry from a bag's voltages; compare with the recorded")
    odometry.set_defaults(command=_odometry)
    odometry.add_argument("bags", nargs="+", type=Path)
    return parser


def _part(
    parts: argparse._SubParsersAction[program.Parser],
    name: str,
    command: Callable[[argparse.Namespace], int],
    words: str,
) -> argparse.ArgumentParser:
    part: argparse.ArgumentParser = parts.add_parser(name, help=words, description=words)
    part.set_defaults(command=command)
    part.add_argument("--out", type=Path, required=True, help="folder for figures, data and model files")
    part.add_argument("--model", type=Path, default=shipped("launch/md100.yaml"), help="model file of the chair")
    part.add_argument("--seed", type=int, default=1, help="seed of the simulated noise")
    part.add_argument("--settings", type=Path, help="settings, instead of launch/paper.yaml")
    return part

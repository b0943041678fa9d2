# SPDX-License-Identifier: BSD-3-Clause
"""calibrate: the voltage law of one's own chair and equation (4) of one's own laser, step by step."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.paper.chair import advice
from kurumaisu.paper.commands import calibrate
from kurumaisu.paper.options import load_options
from kurumaisu.params import shipped


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a step; return 0, or 1 when something is refused or no better than what was there."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same sums, however many cores there are
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    try:
        return command(options)
    except Error as error:
        return failed("calibrate", error)


def _plan(options: argparse.Namespace) -> int:
    print("\n".join(advice.plan(load_options(options.settings))))
    return 0


def _record(options: argparse.Namespace) -> int:
    program.load_a_node()
    from kurumaisu.ros.tools.calibrate_record import record

    return record(options.bag, load_options(options.settings), options.every, options.split)


def _drive(options: argparse.Namespace) -> int:
    return calibrate.drive(
        options.model, options.train, options.test, options.out, keep=options.keep, settings=options.settings
    )


def _laser(options: argparse.Namespace) -> int:
    return calibrate.laser(
        options.model,
        options.recordings,
        options.distances,
        options.out,
        test=options.test,
        settings=options.settings,
    )


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="calibrate", description=__doc__)
    parser.add_argument("--settings", type=Path, help="settings, instead of launch/paper.yaml")
    parts = parser.add_subparsers(required=True, metavar="STEP")
    plan = parts.add_parser("plan", help="print which drive to do")
    plan.set_defaults(command=_plan)
    record = parts.add_parser("record", help="record a drive and print what is still missing; ends when nothing is")
    record.set_defaults(command=_record)
    record.add_argument("bag", type=Path, help="bag to write")
    record.add_argument("--every", type=float, default=5.0, help="seconds between two checks")
    record.add_argument("--split", type=int, default=0, help="seconds after which a new bag begins; 0: one bag")
    drive = parts.add_parser("drive", help="write a model file with the law of the chair, from drives")
    drive.set_defaults(command=_drive)
    drive.add_argument("train", nargs="+", type=Path, help="recordings to fit")
    drive.add_argument("--test", nargs="+", type=Path, required=True, help="recordings to validate with")
    drive.add_argument(
        "--keep", action="append", default=[], metavar="BRANCH", help="take a refused branch from the model"
    )
    laser = parts.add_parser("laser", help="write a model file with equation (4) of the laser, from scans of a wall")
    laser.set_defaults(command=_laser)
    laser.add_argument("recordings", nargs="+", type=Path, help="scans of the wall")
    laser.add_argument("--distances", nargs="+", type=float, required=True, help="of the runs, in their order [m]")
    laser.add_argument(
        "--test",
        nargs="+",
        type=Path,
        default=[],
        help="scans to validate with, at the same distances (default: every other one)",
    )
    for part in (drive, laser):
        part.add_argument("--out", type=Path, required=True, help="folder for the model file, figures and data")
        part.add_argument("--model", type=Path, default=shipped("launch/md100.yaml"), help="model file of the chair")
    return parser

# SPDX-License-Identifier: BSD-3-Clause
"""calibrate: the voltage law of one's own chair and equation (4) of one's own laser, step by step."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.paper import advice, calibrate
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
    from kurumaisu.ros.calibrate_record import record

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
    parser.add_argument("--settings", type=Path, help="in place of launch/paper.yaml")
    parts = parser.add_subparsers(required=True, metavar="STEP")
    plan = parts.add_parser("plan", help="say which drive to do")
    plan.set_defaults(command=_plan)
    record = parts.add_parser(
        "record", help="record a drive, and say meanwhile what it lacks; ends when it lacks nothing"
    )
    record.set_defaults(command=_record)
    record.add_argument("bag", type=Path, help="to write")
    record.add_argument("--every", type=float, default=5.0, help="seconds between two looks")
    record.add_argument("--split", type=int, default=0, help="seconds after which a new bag begins; 0: one bag")
    drive = parts.add_parser("drive", help="from drives to a model file with the law of the chair")
    drive.set_defaults(command=_drive)
    drive.add_argument("train", nargs="+", type=Path, help="recordings to fit")
    drive.add_argument("--test", nargs="+", type=Path, required=True, help="recordings to judge by")
    drive.add_argument(
        "--keep", action="append", default=[], metavar="BRANCH", help="take a refused branch from the model"
    )
    laser = parts.add_parser("laser", help="from scans of a wall to a model file with equation (4) of the laser")
    laser.set_defaults(command=_laser)
    laser.add_argument("recordings", nargs="+", type=Path, help="scans of the wall")
    laser.add_argument("--distances", nargs="+", type=float, required=True, help="[m] of the runs, in the order given")
    laser.add_argument(
        "--test",
        nargs="+",
        type=Path,
        default=[],
        help="scans to judge by, at the same distances; none: every other one",
    )
    for part in (drive, laser):
        part.add_argument("--out", type=Path, required=True, help="folder for the model file, figures and data")
        part.add_argument(
            "--model", type=Path, default=shipped("launch/md100.yaml"), help="what the chair is said to be"
        )
    return parser

# SPDX-License-Identifier: BSD-3-Clause
"""The command line of critic RECORDING."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from kurumaisu import program
from kurumaisu.critic.data import excerpt
from kurumaisu.critic.values.version import version
from kurumaisu.errors import Error
from kurumaisu.params import robot_called, robot_kinds

_Read = TypeVar("_Read")
_DESCRIPTION = """\
Say what a model gets wrong about a measured robot: replay the recording through
the model, name what is missing, or abstain. Writes verdict.json, extended.yaml
(the model with what was found) and report.html."""
_EPILOG = """\
examples:
  critic drive.bag                       one drive: criticism/report.html
  critic drive.bag --robot velocity      of a robot that is no MD-100
  critic drives/ --runs 'monday_*'       some drives of a recording
  critic drives/ --only 'base.lag_*,base.delay'
                                         look for these effects only
  critic drive.bag --from +10 --without-rows pose:+62..+63
                                         without the beginning, and a second
                                         in which the reference was off
  critic drives/ --json --quiet | jq .causes
                                         for programs
  critic day_1/ day_2/ --output out      several: out/day_1/report.html, ...
  critic recordings/ --jobs 8 --table all.csv
                                         a folder of them, eight at a time
  critic recordings/ --dask tcp://head:8786
                                         on a Dask cluster that is there

other commands, each with its own --help: critic look, critic experiment,
critic plan, critic rehearse, critic watch. A recording of such a name is
./watch

exit codes:
  0    none: no effect is both detectable and large enough to matter
  1    error, printed on standard error; also when any of several recordings
       could not be criticised
  2    the command line itself is wrong
  3    named          4  confounded          5  unknown          6  invalid_data
       of several recordings without an error, the largest
  130  interrupted (Ctrl-C): what was done until then is kept, and in the table

More: docs/critic.md"""


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options; end the program for --help, --version, or a wrong command line."""
    return _parser().parse_args(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = program.text_parser("critic", _DESCRIPTION, _EPILOG)
    add = parser.add_argument
    what = "a bag, a folder of runs or CSV tables, a log of MRPT or CARMEN, or a folder of such recordings"
    add("recordings", type=Path, nargs="+", metavar="RECORDING", help=what)
    add("-o", "--output", type=Path, default=Path("criticism"), metavar="FOLDER", help="output folder (criticism)")
    add("--model", type=Path, metavar="FILE", help="model to criticise (the recording's, else md100.yaml)")
    add_robot(parser)
    add("--runs", type=name_list, default=(), metavar="A,B", help="only these runs; patterns like drive_* are allowed")
    add_span(parser)
    parts = "pose, odom, scan, imu, command, voltage"
    rows = f"leave out rows of a part ({parts}), or of all that was measured, between two times"
    add(
        "--without-rows",
        type=_argument(excerpt.gap),
        action="append",
        default=[],
        metavar="[PART:]T..T",
        help=f"{rows}; may be given again",
    )
    add_effects(parser)
    add("--seed", type=int, default=1, help="seed of the particle filter for a missing reference (1)")
    add("--no-slam", action="store_true", help="do not compare SLAM with both models (saves some seconds)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", type=whole_number, default=1, metavar="N", help="recordings at a time on this machine (1)"
    )
    where.add_argument("--dask", metavar="ADDRESS", help="run on the Dask cluster with this scheduler")
    add("--json", action="store_true", help="print the verdict as JSON; of several, one line for each recording")
    add("--table", type=Path, metavar="FILE.csv", help="write the results as a table, one row for each recording")
    add("-q", "--quiet", action="store_true", help="show no progress")
    add("--version", action="version", version=f"critic {version()}")
    return parser


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Add --robot."""
    words = (
        f"which robot it is: {', '.join(robot_kinds())}, or a .yaml file; those on wheels need a file that says "
        "{kind: diff_drive, radius: METRES, track: METRES}; holds in place of `robot` in meta.yaml"
    )
    parser.add_argument("--robot", type=_argument(robot_called), metavar="NAME_OR_FILE", help=words)


def add_span(parser: argparse.ArgumentParser) -> None:
    """Add --from and --to, of drives."""
    since = "12.5 as in tables and messages, or +12.5 since each drive began"
    parser.add_argument(
        "--from",
        dest="start",
        type=_argument(excerpt.moment),
        metavar="T",
        help=f"use drives from this time on [s]: {since}",
    )
    parser.add_argument(
        "--to", dest="stop", type=_argument(excerpt.moment), metavar="T", help="use drives until this time [s]"
    )


def add_effects(parser: argparse.ArgumentParser) -> None:
    """Add --only and --without, for selection.effect_ids."""
    for option, words in (("--only", "look only for"), ("--without", "do not look for")):
        words = f"{words} these effects, by id or pattern like base.lag_*; may be given again"
        parser.add_argument(option, type=name_list, action="extend", default=[], metavar="IDS", help=words)


def name_list(text: str) -> tuple[str, ...]:
    """Return the names in a,b. Raise ArgumentTypeError for an empty one."""
    parts = tuple(part.strip() for part in text.split(","))
    if not all(parts):
        raise argparse.ArgumentTypeError(f"a name is empty: {text!r}")
    return parts


def _argument(read: Callable[[str], _Read]) -> Callable[[str], _Read]:
    """Return a reader of words whose Error is one of the command line."""

    def argument(text: str) -> _Read:
        try:
            return read(text)
        except Error as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return argument


def whole_number(text: str) -> int:
    """Return a whole number from 1. Raise ArgumentTypeError for anything else."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1: {text!r}")
    return int(text)

# SPDX-License-Identifier: BSD-3-Clause
"""The name of a frame, for launch files: read where it is written, so that nobody writes it a second time."""

from __future__ import annotations

import argparse
from pathlib import Path

from kurumaisu import program, settings
from kurumaisu.errors import Error, failed

_HELP = """
Print the name of a frame, for a parameter of a launch file.

KEY is a key of FILE; one within another is written a/b. With --same the name
must be the same in another file, or be missing there.
"""


def frame_named(file: Path, key: str) -> str | None:
    """Return the frame that a settings file names, None where it does not. Raise Error for a name that is none."""
    section = settings.load(file)
    *parents, last = key.split("/")
    for parent in parents:
        if parent not in section:
            return None
        section = section.section(parent)
    if last not in section:
        return None
    name = section.text(last)
    if name.startswith("/") or name.split() != [name]:
        raise section.error(last, f"must be a frame's name, without blanks or a slash at its start: {name!r}")
    return name


def base_frame(given: str) -> str:
    """Return a frame that is given by its name or by base_node's settings, a .yaml."""
    return given if not given.endswith(".yaml") else _required(Path(given), "odometry/child_frame")


def _required(file: Path, key: str) -> str:
    name = frame_named(file, key)
    if name is None:
        raise Error(f"{file}: {key.replace('/', '.')}: is missing")
    return name


def _agreed(options: argparse.Namespace) -> str:
    name = _required(options.file, options.key)
    for file, key in options.same:
        other = frame_named(Path(file), key)
        if other not in (None, name):
            raise Error(
                f"{file}: {key.replace('/', '.')}: is {other}, but {options.key.replace('/', '.')} of {options.file} "
                f"is {name}: must be the same frame"
            )
    return f"{options.prefix}{name}"


def main() -> int:
    """Print a frame; return 1 where there is none, or another file has another name for it."""
    parser = program.node_parser("frame", _HELP)
    parser.add_argument("file", type=Path, metavar="FILE.yaml", help="where the name is written")
    parser.add_argument("key", metavar="KEY", help="odometry/frame of base_node.yaml, laser/frame of a model")
    parser.add_argument("--prefix", default="", help="what is put before the name")
    parser.add_argument("--same", nargs=2, action="append", default=[], metavar=("FILE", "KEY"), help="the same frame")
    options = parser.parse_args(program.words())
    try:
        print(_agreed(options), end="")
    except Error as error:
        return failed("frame", error)
    return 0

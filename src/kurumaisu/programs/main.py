# SPDX-License-Identifier: BSD-3-Clause
"""kurumaisu PROGRAM [ARGUMENT]...: the programs that need no ROS, under one name."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from importlib import import_module

from kurumaisu import program
from kurumaisu.critic.values.version import version

# What each does, and where it is.
_PROGRAMS = {
    "check-world": ("say what a world file holds, and what in it may surprise", "kurumaisu.sim.robots.check_world"),
    "critic": ("say what a model gets wrong about a measured robot", "kurumaisu.programs.critic"),
    "export-world": ("write a world as a map and as a drawing", "kurumaisu.world.cli"),
    "sim": ("drive the simulated chair", "kurumaisu.programs.sim"),
    "view": ("look at a recording in the browser", "kurumaisu.critic.view.command"),
}
_FUNCTIONS = {"check-world": "check_world", "export-world": "export_world"}  # else main
_NOTE = (
    "\n\nkurumaisu PROGRAM --help says what it takes. Nodes, mapping and localisation need ROS and MRPT: they come\n"
)
_NOTE += "with the ROS package. More: docs/without_ros.md"


def main(words: list[str] | None = None) -> int:
    """Run the program that the first word names; return its exit code."""
    words = sys.argv[1:] if words is None else words
    parser = program.Parser(
        prog="kurumaisu",
        usage="kurumaisu PROGRAM [ARGUMENT]...",
        description="A simulator of robots and a wheelchair, and a critic of simulations.",
        epilog="programs:\n" + "\n".join(f"  {name:<13} {what}" for name, (what, _) in _PROGRAMS.items()) + _NOTE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"kurumaisu {version()}")
    parser.add_argument("program", choices=_PROGRAMS, metavar="PROGRAM", help="one of those below")
    name = parser.parse_args(words[:1]).program
    run: Callable[[list[str]], int] = getattr(import_module(_PROGRAMS[name][1]), _FUNCTIONS.get(name, "main"))
    return run(words[1:])

# SPDX-License-Identifier: BSD-3-Clause
"""kurumaisu PROGRAM [ARGUMENT]...: the programs that need no ROS, under one name."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module

from kurumaisu import program
from kurumaisu.critic.values.version import version

# What each does; its module, and the function there.
_PROGRAMS = {
    "check-world": (
        "say what a world file holds, and what in it may surprise",
        ("kurumaisu.sim.robots.check_world", "check_world"),
    ),
    "critic": ("say what a model gets wrong about a measured robot", ("kurumaisu.programs.critic", "main")),
    "export-world": ("write a world as a map and as a drawing", ("kurumaisu.world.cli", "export_world")),
    "sim": ("drive the simulated chair", ("kurumaisu.programs.sim", "main")),
    "view": ("look at a recording in the browser", ("kurumaisu.critic.view.command", "main")),
}
_NOTE = """

kurumaisu PROGRAM --help says what it takes. Nodes, mapping and localisation need ROS and MRPT: they come
with the ROS package. More: docs/without_ros.md"""


def main(words: list[str] | None = None) -> int:
    """Run the program that the first word names; return its exit code."""
    words = sys.argv[1:] if words is None else words
    about = "A simulator of robots and a wheelchair, and a critic of simulations."
    listed = "programs:\n" + "\n".join(f"  {name:<13} {what}" for name, (what, _) in _PROGRAMS.items()) + _NOTE
    parser = program.text_parser("kurumaisu", about, listed, usage="kurumaisu PROGRAM [ARGUMENT]...")
    parser.add_argument("--version", action="version", version=f"kurumaisu {version()}")
    parser.add_argument("program", choices=_PROGRAMS, metavar="PROGRAM", help="one of those below")
    module, function = _PROGRAMS[parser.parse_args(words[:1]).program][1]
    run: Callable[[list[str]], int] = getattr(import_module(module), function)
    return run(words[1:])

# SPDX-License-Identifier: BSD-3-Clause
"""The command critic: which part of it is meant. Only those that need ROS import it, and only when they are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module

from kurumaisu import program
from kurumaisu.errors import Error, failed

# Other commands, by the first word, and where their main is.
_PARTS = {
    "experiment": "kurumaisu.ros.experiment.command",
    "look": "kurumaisu.critic.app.look",
    "plan": "kurumaisu.critic.experiment.plan",
    "rehearse": "kurumaisu.critic.experiment.rehearse",
    "watch": "kurumaisu.ros.tools.critic_watch",
}
_NODES = ("experiment", "watch")


def main(words: Sequence[str] | None = None) -> int:
    """Run a command by its name, or criticise recordings; return the exit code."""
    # The same sums in the same order, however many cores there are and however many recordings run at once.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    words = sys.argv[1:] if words is None else words
    name = words[0] if words else ""
    if name in _NODES:
        program.load_a_node()
    if name in _PARTS:
        return _told(name, words[1:])
    from kurumaisu.critic.app import options

    options.parse(words)  # --help and a wrong option need not wait for what the critic imports
    from kurumaisu.critic.app import cli

    return cli.main(words)


def _told(name: str, arguments: Sequence[str]) -> int:
    """Run a command; say what was wrong with its input, or is not there, on one line."""
    try:
        return _command(name)(arguments)
    except Error as error:
        return failed("critic", error)


def _command(name: str) -> Callable[[Sequence[str]], int]:
    try:
        command: Callable[[Sequence[str]], int] = import_module(_PARTS[name]).main
    except ModuleNotFoundError as error:
        if name in _NODES:
            raise Error(f"{name} needs ROS: install the ROS package (docs/without_ros.md): {error}") from error
        raise
    return command

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


def main() -> int:
    """Run a command by its name, or criticise recordings; return the exit code."""
    # The same sums in the same order, however many cores there are and however many recordings run at once.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    name, arguments = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    if name in _NODES:
        program.die_of_ctrl_c()
    if name in _PARTS:
        command: Callable[[Sequence[str]], int] = import_module(_PARTS[name]).main
        return _told(command, arguments)
    from kurumaisu.critic.app import options

    options.parse(None)  # --help and a wrong option need not wait for what the critic imports
    from kurumaisu.critic.app import cli

    return cli.main()


def _told(command: Callable[[Sequence[str]], int], arguments: Sequence[str]) -> int:
    """Run a command; say what was wrong with its input on one line."""
    try:
        return command(arguments)
    except Error as error:
        return failed("critic", error)

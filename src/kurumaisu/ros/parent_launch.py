# SPDX-License-Identifier: BSD-3-Clause
"""The roslaunch that started this process."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import threading
from pathlib import Path

_PATIENCE = 15.0  # [s] for roslaunch to get to us; it ends its nodes one by one
_GREEN, _PLAIN = "\033[32m", "\033[0m"


def command_line(pid: int) -> str:
    """Return the command line of a process, which goes into a message."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text(errors="replace").replace("\0", " ").strip()
    return "the parent"


def is_launch(pid: int) -> bool:
    """Return whether a process is a roslaunch."""
    return "roslaunch" in command_line(pid)


def add_option(parser: argparse.ArgumentParser) -> None:
    """Add --ends-launch."""
    parser.add_argument("--ends-launch", action="store_true", help="when done, end the roslaunch that started this")


def done(words: str, ends_launch: bool, asked: threading.Event) -> None:
    """Say that all is done, and end roslaunch in order if asked to.

    A required node that ends by itself would do that, too; but roslaunch tells of its death in red, however it ended.
    asked: set when this node is to end.
    """
    print(f"{_GREEN}{words}{_PLAIN}" if sys.stdout.isatty() else words, flush=True)
    launch = os.getppid()
    if ends_launch and is_launch(launch) and not asked.is_set():
        os.kill(launch, signal.SIGINT)
        asked.wait(_PATIENCE)

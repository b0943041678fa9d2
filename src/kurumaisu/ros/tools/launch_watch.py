# SPDX-License-Identifier: BSD-3-Clause
"""launch_watch: ends the roslaunch that started it, with an error, when the ROS master was replaced."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.ros import master
from kurumaisu.ros.parent_launch import command_line, is_launch

_HELP = """
End the roslaunch that started this, with an error, when the ROS master was
restarted: its nodes are unknown to the new one, and their parameters are gone.
robot.launch starts it; systemd then starts robot.launch anew.

More: docs/robot.md
"""
_PERIOD = 1.0  # [s] between looks
_PATIENCE = 14.0  # [s] for the other nodes to end, in which roslaunch does not kill us


def main() -> int:
    """Watch the master until told to end."""
    program.no_arguments("launch_watch", _HELP)
    program.loaded()
    launch, run, ends = os.getppid(), _run(), {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)
    while signal.sigtimedwait(ends, _PERIOD) is None:
        now = _run()
        run = run or now
        if now != run and now is not None:
            break
    now = _run()
    if now is None or now == run:
        return 0  # somebody ended roslaunch, and the master is the same or gone
    words = f"{command_line(launch)} ends, for its nodes are unknown"
    print(f"launch_watch: LAUNCH_MASTER_REPLACED: {words}", file=sys.stderr)
    return _end(launch)


def _run() -> str | None:
    """Return what roslaunch gave the master as its number, '' where there is none; None where no master answers."""
    try:
        return str(master.ask("getParam", "/run_id") or "")
    except Error:
        return None


def _end(launch: int) -> int:
    """End roslaunch in order, its nodes first. It has no exit code for an error: at its end it is killed."""
    if not is_launch(launch):
        return 1
    with contextlib.suppress(ProcessLookupError):
        os.kill(launch, signal.SIGINT)
        deadline = time.monotonic() + _PATIENCE
        while _children(launch) - {os.getpid()} and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(launch, signal.SIGKILL)
    return 1


def _children(pid: int) -> set[int]:
    found: set[int] = set()
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found |= {int(word) for word in task.read_text().split()}
    return found

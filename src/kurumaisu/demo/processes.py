# SPDX-License-Identifier: BSD-3-Clause
"""Start ROS programs beside others that may be running, and end what was started."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from kurumaisu import children
from kurumaisu.errors import Error

_PATIENCE = 20.0  # [s] for one that was interrupted to end
_TAIL = 15  # lines of the log shown after a failure


def free_port() -> int:
    """Return a TCP port of the loopback interface that nobody uses now."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def roslaunch(arguments: Sequence[str], log: Path, deadline: float, words: str) -> None:
    """Run roslaunch with a master of its own until it ends, showing how long it has been running.

    deadline [s] of wall time. Raise Error with the end of the log when it fails or is late.
    """
    port = free_port()
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_LOG_DIR": str(log.parent / "ros_log"),
    }
    with log.open("w", encoding="utf-8") as stream:
        process = children.start(
            ["roslaunch", "-p", str(port), *arguments], stdout=stream, stderr=subprocess.STDOUT, env=environment
        )
        late = _wait(process, deadline, words)
    if late or process.returncode != 0:
        tail = "\n".join(log.read_text(encoding="utf-8", errors="replace").splitlines()[-_TAIL:])
        why = f"was not done after {deadline:.0f} s" if late else f"ended with code {process.returncode}"
        raise Error(f"roslaunch {' '.join(arguments[:2])} {why}; the end of {log}:\n{tail}")


def _wait(process: subprocess.Popen[bytes], deadline: float, words: str) -> bool:
    """Wait for a process, interrupting it at the deadline and when interrupted; return whether it was late."""
    start, shown = time.monotonic(), -1
    try:
        while process.poll() is None:
            elapsed = time.monotonic() - start
            if elapsed > deadline:
                return True
            if int(elapsed) // 5 != shown:
                shown = int(elapsed) // 5
                print(f"  {words} ... {elapsed:.0f} s", flush=True, file=sys.stderr)
            time.sleep(0.1)
        return False
    finally:
        children.interrupt(process, _PATIENCE)

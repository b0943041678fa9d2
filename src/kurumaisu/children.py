# SPDX-License-Identifier: BSD-3-Clause
"""Processes that a program starts, which end when it does, however it ends."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import threading
from collections.abc import Sequence
from queue import SimpleQueue
from typing import Any

# The kernel sends SIGINT when the parent dies; one that died before this was asked for is seen by the number. PWD is
# put back as it was: a shell makes it its own folder.
_TIED = ("setpriv", "--pdeathsig", "INT", "sh", "-c", '[ "$PPID" = "$0" ] && export PWD="$1" && shift && exec "$@"')


def start(command: Sequence[str], **options: Any) -> subprocess.Popen[Any]:
    """Start a process that gets SIGINT when this one ends, be it killed. options: as of Popen."""
    found: SimpleQueue[subprocess.Popen[Any] | OSError] = SimpleQueue()
    threading.Thread(target=_keep, args=(command, options, found), daemon=True).start()
    result = found.get()
    if isinstance(result, OSError):
        raise result
    return result


def _keep(command: Sequence[str], options: dict[str, Any], found: SimpleQueue[subprocess.Popen[Any] | OSError]) -> None:
    """Be the parent as long as the process lives: to the kernel a parent is a thread."""
    try:
        folder = (options.get("env") or os.environ).get("PWD", "")
        process = subprocess.Popen([*_TIED, str(os.getpid()), folder, *command], **options)
        pidfd = os.pidfd_open(process.pid)
    except OSError as error:
        found.put(error)
        return
    found.put(process)
    try:
        select.select([pidfd], [], [])
    finally:
        os.close(pidfd)


def interrupt(process: subprocess.Popen[Any], patience: float) -> None:
    """End a process that may have ended: asked first, killed after so long [s]."""
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()

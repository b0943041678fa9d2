# SPDX-License-Identifier: BSD-3-Clause
"""Processes that a program has started."""

from __future__ import annotations

import signal
import subprocess
from typing import Any


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

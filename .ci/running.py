# SPDX-License-Identifier: BSD-3-Clause
"""Runs a command in a session of its own, and measures what it took."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from resource import struct_rusage
from threading import Event


@dataclass(frozen=True)
class Ended:
    """What went wrong, or nothing; seconds by the clock, and of all cores."""

    problem: str
    wall: float
    cpu: float


def run(command: list[str], log: Path, timeout: float, stop: Event, beside: bool) -> Ended:
    """Run a command, output to the log, until it ends, stop is set or the time [s] is over.

    beside: gets what others leave of the cores.
    """
    start = time.monotonic()
    with log.open("w") as output:
        output.write(f"{' '.join(command)[:400]}\n")
        output.flush()
        process = subprocess.Popen(
            [*(["chrt", "--idle", "0"] if beside else []), *command],
            cwd=log.parents[2],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    if beside:
        _stand_back(process.pid)
    try:
        ended = _wait(process.pid, start + timeout, stop)
    finally:
        _signal(process.pid, signal.SIGTERM)  # a node that outlived its test, too
    if ended is None:
        problem = "interrupted" if stop.is_set() else f"not done after {timeout:.0f} s"
        ended = _wait(process.pid, time.monotonic() + 10.0, Event())
        if ended is None:
            _signal(process.pid, signal.SIGKILL)
            ended = os.wait4(process.pid, 0)[1:]
    else:
        problem = f"exit status {status}" if (status := os.waitstatus_to_exitcode(ended[0])) else ""
    process.returncode = 0  # it is reaped
    return Ended(problem, time.monotonic() - start, ended[1].ru_utime + ended[1].ru_stime)


def _wait(pid: int, deadline: float, stop: Event) -> tuple[int, struct_rusage] | None:
    """Return the status of a process and what it used, children included; None if the time is over."""
    while time.monotonic() < deadline and not stop.wait(0.05):
        ended, status, usage = os.wait4(pid, os.WNOHANG)
        if ended:
            return status, usage
    return None


def _signal(session: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(session, number)


def _stand_back(session: int) -> None:
    """Give way to other sessions: where the kernel shares cores among sessions first, --idle means little to others."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{session}/autogroup").write_text("10")  # a tenth of another's share: 19 would be next to nothing

# SPDX-License-Identifier: BSD-3-Clause
"""Processes of a benchmark: where our programs are, a ROS master, and what a process costs."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from kurumaisu import children
from kurumaisu.errors import Error

PATIENCE = 30.0  # [s] for a process to be ready, or to end


def program(name: str) -> str:
    """Return the path of a program that the build made. Raise Error if it did not."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        for folder in ("lib/kurumaisu", "share/kurumaisu/tests"):
            if (path := Path(prefix) / folder / name).exists():
                return str(path)
    raise Error(f"{name}: is not built (cmake --build .ws/build; what only benchmarks need comes with the tests)")


def cpu(pid: int) -> float:
    """Return the CPU time [s] that a process has used, in and for itself."""
    # the kernel's name of the clock that counts a whole process' time, to the nanosecond: clock_getcpuclockid(3)
    return time.clock_gettime((~pid << 3) | 2)


def cpu_time() -> float:
    """Return the CPU time [s] of this process and of those that it waited for."""
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def memory(pid: int) -> float:
    """Return the resident memory [MB] of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def free_port() -> int:
    """Return a TCP port of this host that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def running(
    command: Sequence[str], log: Path | None = None, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program, its output to a log if one is named; interrupt it at the end if it still runs, wait for it."""
    with (log or Path(os.devnull)).open("wb") as output:
        process = children.start(command, env=environment, stdout=output, stderr=output)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


@contextlib.contextmanager
def master() -> Iterator[dict[str, str]]:
    """Run a master of our own; yield the environment of those who are to find it."""
    port = free_port()
    environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOSTNAME": "localhost"}
    process = children.start(
        ["rosmaster", "--core", "-p", str(port)],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + PATIENCE
        while socket.socket().connect_ex(("localhost", port)):
            if time.monotonic() > deadline:
                raise Error(f"rosmaster: does not answer on port {port}")
            time.sleep(0.05)
        yield environment
    finally:
        process.terminate()
        process.wait(PATIENCE)

# SPDX-License-Identifier: BSD-3-Clause
"""What was heard of a driver whose sensor shows another range in each scan."""

from __future__ import annotations

import subprocess
import threading
import time
from collections import defaultdict
from dataclasses import dataclass

FIRST = 1000  # [mm] that all beams of scan 0 show; each scan shows 1 mm more
LAST = 3999  # [mm] after which FIRST comes again


@dataclass(frozen=True)
class Scan:
    """A scan as tests/scan_line.h prints it."""

    arrival: float  # [s] monotonic
    now: float  # [s] host's time
    stamp: float  # [s] host's time
    range: int  # [mm], the median
    beams: int
    others: int  # measured beams at another range
    codes: int  # ranges that are none: below 20 mm
    nans: int
    infs: int

    @property
    def wrong(self) -> bool:
        """Say whether it shows what no scan of the sensor did."""
        return self.others > 0 or self.codes > 0


@dataclass(frozen=True)
class Status:
    """A driver's last word on /diagnostics."""

    level: int
    message: str
    values: dict[str, str]


def read_scan(line: str) -> tuple[str, Scan]:
    """Read a line `scan TOPIC ...`; return the topic and the scan."""
    _, topic, arrival, now, stamp, *counts = line.split()
    return topic, Scan(float(arrival), float(now), float(stamp), *map(int, counts))


def read_status(line: str) -> tuple[str, Status]:
    """Read a line `status LEVEL NAME...`; return the name, and the rest."""
    head, message, *values = line.rstrip("\n").split("\t")
    _, level, name = head.split(" ", 2)
    pairs = (value.partition("=") for value in values)
    return name, Status(int(level), message, {key: value for key, _, value in pairs})


class Heard:
    """What a process printed so far: scans by topic, the levels and the last status by name."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        """Read a process' output in a thread until it ends."""
        self._process = process
        self._scans: dict[str, list[Scan]] = defaultdict(list)
        self._statuses: dict[str, Status] = {}
        self._levels: dict[str, list[tuple[float, int]]] = defaultdict(list)  # [s] monotonic
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def wait_ready(self, seconds: float) -> bool:
        """Wait until it says that it listens."""
        return self._ready.wait(seconds)

    def scans(self, topic: str = "/scan") -> list[Scan]:
        """Return the scans of a topic so far."""
        return list(self._scans[topic])

    def wait_scan(self, topic: str, seconds: float) -> bool:
        """Wait for a topic's first scan; return whether it came."""
        deadline = time.monotonic() + seconds
        while not self._scans[topic] and time.monotonic() < deadline:
            time.sleep(0.02)
        return bool(self._scans[topic])

    def status(self, node: str, since: float) -> Status | None:
        """Return a node's last values, and its worst level since a time [s, monotonic]."""
        of_node = [status for name, status in list(self._statuses.items()) if name.startswith(node)]
        values = {key: value for status in of_node for key, value in status.values.items()}
        levels = [
            level
            for name, heard in list(self._levels.items())
            if name.startswith(node)
            for when, level in heard
            if when >= since
        ]
        message = "; ".join(status.message for status in of_node if status.level)
        return Status(max(levels, default=0), message, values) if of_node else None

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("scan "):
                topic, scan = read_scan(line)
                self._scans[topic].append(scan)
            elif line.startswith("status "):
                name, status = read_status(line)
                self._statuses[name] = status
                self._levels[name].append((time.monotonic(), status.level))
            elif line.startswith("ready"):
                self._ready.set()

# SPDX-License-Identifier: BSD-3-Clause
"""Virtual sensors that show another range in each scan, and drivers as processes that listen to them."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, cpu, memory, program
from kurumaisu.bench.rigs.heard_scans import FIRST, LAST, Heard, Scan
from kurumaisu.virtual_urg import Pty, Tcp, VirtualUrg, load_sensor

_TICK = 0.001  # [s] between two looks of the sensors at the time: what TM tells is that old at most
_END = 5.0  # [s] after which roslaunch would lose its patience, too, and insist


@dataclass(frozen=True)
class Address:
    """Where a sensor is: a tty, or a port of this host."""

    tty: str = ""
    port: int = 0

    @property
    def words(self) -> list[str]:
        """Return it as tests/stock_urg.cpp takes it."""
        return ["127.0.0.1", str(self.port)] if self.port else [self.tty]

    @property
    def parameters(self) -> list[str]:
        """Return it as urg_node's parameters, which are ours too."""
        if self.port:
            return ["_ip_address:=127.0.0.1", f"_ip_port:={self.port}"]
        return [f"_serial_port:={self.tty}"]


class Sensor:
    """A virtual sensor, and when it measured what."""

    def __init__(self, urg: VirtualUrg, address: Address, phase: float) -> None:
        """Take a sensor that is to be fed; phase: of its turns [s]."""
        self.urg, self.address = urg, address
        kind = urg.sensor
        self._before_first = kind.first * kind.step_time
        self._ready_after = kind.last * kind.step_time + kind.model.output_delay
        self._origin = time.monotonic()  # the sensor's world begins at 0
        self._phase = phase
        self._turns = 0
        self.starts: dict[int, float] = {}  # [s] monotonic, of step 0, by what was shown [mm]
        self.fed: dict[int, float] = {}  # [s] monotonic, just before the scan went out

    def live(self) -> float:
        """Let time pass, and complete the turn that is due; return when the next one is [s, monotonic]."""
        now = time.monotonic()
        if now < self._due():
            self.urg.advance(now - self._origin)
        else:
            self._turn(now)
        return self._due()

    def stamp_error(self, scan: Scan) -> float:
        """Return how much later than its first beam a scan is stamped [s]."""
        return scan.stamp - (self.starts[scan.range] + self._before_first + scan.now - scan.arrival)

    def latency(self, scan: Scan) -> float:
        """Return the time from before the sensor sent a scan until it was heard [s]."""
        return scan.arrival - self.fed[scan.range]

    def _due(self) -> float:
        return self._origin + self._phase + (self._turns + 1) * self.urg.sensor.scan_time

    def _turn(self, now: float) -> None:
        """Complete a turn: all beams show a range that no turn of the last minutes has shown."""
        shown = FIRST + self._turns % (LAST - FIRST + 1)
        start = now - self._ready_after
        ranges = np.full(self.urg.sensor.steps, 1e-3 * shown)
        self.starts[shown], self.fed[shown] = start, time.monotonic()
        self.urg.measure(now - self._origin, start - self._origin, ranges)
        self._turns += 1


@contextlib.contextmanager
def sensor_at(kind: str, faults: Sequence[str], link: Path, *, tcp: bool, phase: float = 0.0) -> Iterator[Sensor]:
    """Plug in a virtual sensor: at a free TCP port, or at a pty to which a link leads."""
    at = Tcp() if tcp else Pty(link)
    with VirtualUrg(load_sensor(kind), at, faults=faults, fed=True, patience=0.0) as urg:
        yield Sensor(urg, Address(port=urg.port) if tcp else Address(tty=str(link)), phase)


@contextlib.contextmanager
def fed(sensors: Sequence[Sensor]) -> Iterator[None]:
    """Let time pass for sensors, in one thread, until the block ends."""
    stopping = threading.Event()

    def feed() -> None:
        while not stopping.is_set():
            soonest = min(sensor.live() for sensor in sensors)
            time.sleep(min(_TICK, max(0.0, soonest - time.monotonic())))

    thread = threading.Thread(target=feed, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()


def ours(address: Address, name: str, **parameters: object) -> list[str]:
    """Return the command line of laser_node."""
    return _node(program("laser_node"), address, name, parameters)


def urg_node(prefix: Path, address: Address, name: str, **parameters: object) -> list[str]:
    """Return the command line of urg_node, installed under a prefix; it is told to ask for what the sensor can see."""
    given = {"angle_min": -2.086, "angle_max": 2.092, "publish_intensity": False, **parameters}
    return _node(str(prefix / "lib/urg_node/urg_node"), address, name, given)


def stock(address: Address) -> list[str]:
    """Return the command line of MRPT's own driver."""
    return [program("stock_urg"), *address.words]


def _node(path: str, address: Address, name: str, parameters: dict[str, object]) -> list[str]:
    given = [f"_{key}:={_yaml(value)}" for key, value in parameters.items()]
    return [path, f"__name:={name}", f"scan:=/{name}/scan", *address.parameters, *given]


def _yaml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


class Driver:
    """A driver's process, and what it costs."""

    def __init__(self, command: Sequence[str], environment: dict[str, str], log: Path, *, heard: bool = False) -> None:
        """Start it; with `heard` its output is what it measured, else it goes to the log like its errors."""
        with log.open("w") as file:
            self.process = children.start(
                command,
                env=environment,
                stdout=subprocess.PIPE if heard else file,
                stderr=file,
                text=True,
            )
        self.heard = Heard(self.process) if heard else None
        self.started = self._last = time.monotonic()
        self._cpu = 0.0

    def mark(self) -> None:
        """Count CPU time from now on."""
        self._last, self._cpu = time.monotonic(), self.cpu()

    def share(self) -> float:
        """Return the share of a core since the last mark."""
        return (self.cpu() - self._cpu) / (time.monotonic() - self._last)

    def cpu(self) -> float:
        """Return the CPU time used [s]; nan once it has died."""
        return cpu(self.process.pid) if self.alive else float("nan")

    def memory(self) -> float:
        """Return its memory [MB]; nan once it has died."""
        return memory(self.process.pid) if self.alive else float("nan")

    @property
    def alive(self) -> bool:
        """Say whether it still runs."""
        return self.process.poll() is None

    def stop(self) -> float:
        """Interrupt it; return how long it took to end [s], inf if it had to be killed, nan if it had died before."""
        if not self.alive:
            return float("nan")
        begin = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(_END)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(PATIENCE)
            return float("inf")
        return time.monotonic() - begin


@contextlib.contextmanager
def listening(topics: Sequence[str], environment: dict[str, str]) -> Iterator[Heard]:
    """Hear scans and diagnostics until the block ends."""
    command = [program("scan_listener"), *topics]
    process = children.start(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        heard = Heard(process)
        heard.wait_ready(PATIENCE)
        yield heard
    finally:
        process.terminate()
        process.wait(PATIENCE)

# SPDX-License-Identifier: BSD-3-Clause
"""What a laser's driver adds: time, CPU and memory, and whether ten at once lose a scan; peers beside it."""

from __future__ import annotations

import argparse
import contextlib
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.processes import PATIENCE, master
from kurumaisu.bench.rigs.heard_scans import Heard, Scan
from kurumaisu.bench.rigs.laser import Address, Driver, Sensor, fed, listening, ours, sensor_at, stock, urg_node
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error

_KIND = "urg_04lx_ug01"  # 682 beams at 10 Hz
_SETTLED = 1.0  # [s] after the first scan, when the measurement begins
_LATENCY, _SHARE = 1e-3, 0.02  # [s] at most in the median, [1] of a core
_COLUMNS = ("median [ms]", "p99 [ms]", "CPU [%]", "memory [MB]", "scans", "lost", "stamp [ms]")

Client = Callable[[Address, str], list[str]]


@dataclass(frozen=True)
class Cost:
    """What a driver made of a sensor without faults."""

    latencies: list[float]  # [s] from before the sensor wrote until the scan was heard
    stamps: list[float]  # [s] later than the first beam
    lost: int
    cpu: float  # share of a core
    memory: float  # [MB]

    def cells(self) -> list[float]:
        """Return the cells of a table's row."""
        middle, late = np.percentile(1e3 * np.array(self.latencies or [math.nan]), [50, 99])
        stamp = 1e3 * float(np.median(self.stamps or [math.nan]))
        return [middle, late, 100 * self.cpu, self.memory, float(len(self.latencies)), float(self.lost), stamp]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if our driver is late, dear or loses a scan."""
    parser = argparse.ArgumentParser(prog="scripts/bench laser", description=__doc__)
    parser.add_argument("--urg-node", type=Path, metavar="PREFIX", help="where urg_node is installed; else without it")
    parser.add_argument("--no-stock", action="store_true", help="without MRPT's own driver")
    parser.add_argument("--seconds", type=float, default=12.0, help="of each driver at each wire")
    parser.add_argument("--sensors", type=int, default=10, help="at once")
    parser.add_argument("--minute", type=float, default=60.0, help="of all sensors at once [s]")
    options = parser.parse_args(arguments)
    table = Table("682 beams at 10 Hz: from the sensor's writing to the subscriber", "driver", *_COLUMNS)
    good = _alone(table, _clients(options), options.seconds)
    good &= _together(table, options.sensors, options.minute)
    table.note(f"Limits of laser_node: median {1e3 * _LATENCY:g} ms, CPU {100 * _SHARE:g} %, nothing lost.")
    return int(not good)


def _clients(options: argparse.Namespace) -> dict[str, Client]:
    clients: dict[str, Client] = {"laser_node": ours}
    if options.urg_node:
        clients["urg_node"] = lambda address, name: urg_node(options.urg_node, address, name)
    if not options.no_stock:
        clients["MRPT's own, no ROS"] = lambda address, _: stock(address)
    return clients


def _alone(table: Table, clients: dict[str, Client], seconds: float) -> bool:
    """Print what each driver costs by itself; return whether ours keeps its limits."""
    good = True
    for tcp in (False, True):
        for name, client in clients.items():
            (cost,) = measure(client, 1, seconds, tcp=tcp, printing=client is not ours and "MRPT" in name)
            table.row(f"{name}, {'TCP' if tcp else 'pty'}", *cost.cells())
            if client is ours:
                good &= float(np.median(cost.latencies)) < _LATENCY and cost.cpu < _SHARE and not cost.lost
    return good


def _together(table: Table, count: int, seconds: float) -> bool:
    """Print what many of our drivers cost side by side; return whether no scan was lost."""
    costs = measure(ours, count, seconds, tcp=False)
    together = Cost(
        [value for cost in costs for value in cost.latencies],
        [value for cost in costs for value in cost.stamps],
        sum(cost.lost for cost in costs),
        sum(cost.cpu for cost in costs),
        sum(cost.memory for cost in costs),
    )
    table.row(f"{count} laser_node, {seconds:g} s", *together.cells())
    table.row("the worst of them", *np.max([cost.cells() for cost in costs], axis=0).tolist())
    return together.lost == 0


def measure(client: Client, count: int, seconds: float, *, tcp: bool, printing: bool = False) -> list[Cost]:
    """Run so many drivers, each at a sensor of its own; printing: they tell their scans themselves, without ROS.

    Raise Error if one of them brings no scan.
    """
    names = [f"laser_{i}" for i in range(count)]
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        environment = stack.enter_context(master())
        phases = [0.1 * i / count for i in range(count)]
        sensors = [
            stack.enter_context(sensor_at(_KIND, (), folder / name, tcp=tcp, phase=phase))
            for name, phase in zip(names, phases, strict=True)
        ]
        stack.enter_context(fed(sensors))
        topics = [f"/{name}/scan" for name in names]
        heard = None if printing else stack.enter_context(listening(topics, environment))
        drivers = [
            stack.enter_context(_running(client(sensor.address, name), environment, folder / f"{name}.log", printing))
            for sensor, name in zip(sensors, names, strict=True)
        ]
        ears = [
            (heard, topic) if heard else (driver.heard, "/scan") for driver, topic in zip(drivers, topics, strict=True)
        ]
        return _watch(sensors, drivers, ears, seconds)


@contextlib.contextmanager
def _running(command: list[str], environment: dict[str, str], log: Path, heard: bool) -> Iterator[Driver]:
    driver = Driver(command, environment, log, heard=heard)
    try:
        yield driver
    finally:
        driver.stop()


def _watch(
    sensors: Sequence[Sensor], drivers: Sequence[Driver], ears: Sequence[tuple[Heard | None, str]], seconds: float
) -> list[Cost]:
    for heard, topic in ears:
        if heard is None or not heard.wait_scan(topic, PATIENCE):
            raise Error(f"{topic}: no scan within {PATIENCE:g} s")
    time.sleep(_SETTLED)
    begin = time.monotonic()
    for driver in drivers:
        driver.mark()
    time.sleep(seconds)
    shares = [(driver.share(), driver.memory()) for driver in drivers]
    end = time.monotonic()
    costs = []
    for sensor, (heard, topic), (share, memory) in zip(sensors, ears, shares, strict=True):
        assert heard is not None
        scans = [scan for scan in heard.scans(topic) if begin <= scan.arrival < end]
        costs.append(_cost(sensor, scans, share, memory))
    return costs


def _cost(sensor: Sensor, scans: Sequence[Scan], share: float, memory: float) -> Cost:
    shown = [scan.range for scan in scans if scan.range in sensor.starts]
    return Cost(
        [sensor.latency(scan) for scan in scans if scan.range in sensor.fed],
        [sensor.stamp_error(scan) for scan in scans if scan.range in sensor.starts],
        max(shown) - min(shown) + 1 - len(set(shown)) if shown else 0,
        share,
        memory,
    )

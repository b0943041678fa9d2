# SPDX-License-Identifier: BSD-3-Clause
"""Drivers at faulty sensors, several side by side, and what became of their scans."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from kurumaisu.bench.faults.laser.cases import Case
from kurumaisu.bench.rigs.heard_scans import Heard, Scan, Status
from kurumaisu.bench.rigs.laser import Address, Driver, Sensor, fed, listening, sensor_at

Client = Callable[[Address, str, Case], list[str]]  # where the sensor is, the node's name -> its command line
_START = 12.0  # [s] for all drivers to begin: the libraries of MRPT take their time
_PERIOD = 1.2  # [s] of the diagnostics, and what a busy machine adds
_LOOK = 0.02  # [s] between two looks whether one has begun
_LIMITS = {"CPU share": 0.05, "time to exit [s]": 2.0, "stamp's error [s]": 0.05, "memory [MB]": 5.0}


@dataclass(frozen=True)
class Result:
    """What a driver made of a fault."""

    scans: int
    lost: int  # turns between the first and the last scan that were not published
    twice: int  # scans published again
    wrong: int  # scans with ranges that the sensor never measured
    blank: str  # what is in scans without a range
    gap: float  # [s] from scan to scan at most; up to the end of the run
    stamp: float  # [s] from the true time of the first beam, at most
    back: int  # stamps before their predecessor's
    cpu: float  # share of a core
    grown: float  # [MB]
    exit: float  # [s] after SIGINT; inf: it had to be killed; nan: it had died
    status: Status | None


def run(
    cases: Sequence[Case], client: Client, seconds: float, environment: dict[str, str], folder: Path
) -> list[Result]:
    """Run a driver at each of the sensors, all at the same time, for so many seconds after they have begun."""
    names = [f"laser_{i}" for i in range(len(cases))]
    with contextlib.ExitStack() as stack:
        heard = stack.enter_context(listening([f"/{name}/scan" for name in names], environment))
        sensors = [
            stack.enter_context(sensor_at(case.sensor, case.faults, folder / name, tcp=case.tcp))
            for case, name in zip(cases, names, strict=True)
        ]
        stack.enter_context(fed(sensors))
        drivers = [
            Driver(client(sensor.address, name, case), environment, folder / f"{name}.log")
            for sensor, case, name in zip(sensors, cases, names, strict=True)
        ]
        before = _begin(cases, drivers, heard, names)
        time.sleep(seconds)
        ends = [(time.monotonic(), driver.share(), driver.memory()) for driver in drivers]
        statuses = [heard.status(name, _since(heard.scans(f"/{name}/scan"))) for name in names]
        return [
            _result(sensor, driver, heard, name, end, grown_from, status)
            for sensor, driver, name, end, grown_from, status in zip(
                sensors, drivers, names, ends, before, statuses, strict=True
            )
        ]


def _begin(cases: Sequence[Case], drivers: Sequence[Driver], heard: Heard, names: Sequence[str]) -> list[float]:
    """Wait for every driver's first scan where one is to come; CPU time counts from then. Return memories [MB]."""
    waiting = set(range(len(cases)))
    expected = {i for i, case in enumerate(cases) if case.lost is not None}
    memories = [math.nan] * len(cases)
    deadline = time.monotonic() + _START
    while waiting:
        late = time.monotonic() > deadline or not waiting & expected
        for i in sorted(waiting):
            if late or heard.scans(f"/{names[i]}/scan"):
                drivers[i].mark()
                memories[i] = drivers[i].memory()
                waiting.remove(i)
        time.sleep(_LOOK)
    return memories


def _since(scans: Sequence[Scan]) -> float:
    """Return when the diagnostics no longer tell of the start [s, monotonic]."""
    return scans[0].arrival + _PERIOD if scans else 0.0


def _result(
    sensor: Sensor,
    driver: Driver,
    heard: Heard,
    name: str,
    end: tuple[float, float, float],
    memory: float,
    status: Status | None,
) -> Result:
    scans = [scan for scan in heard.scans(f"/{name}/scan") if scan.arrival <= end[0]]
    shown = [scan.range for scan in scans if scan.range in sensor.starts]
    blank = [scan for scan in scans if scan.range == 0]
    arrivals = [scan.arrival for scan in scans]
    errors = [abs(sensor.stamp_error(scan)) for scan in scans if scan.range in sensor.starts]
    return Result(
        scans=len(scans),
        lost=max(shown) - min(shown) + 1 - len(set(shown)) - len(blank) if shown else 0,
        twice=len(shown) - len(set(shown)),
        wrong=sum(scan.wrong or (scan.range != 0 and scan.range not in sensor.starts) for scan in scans),
        blank=", ".join(f"{scan.infs} inf {scan.nans} NaN" for scan in blank[:1]),
        gap=max((b - a for a, b in pairwise([*arrivals, end[0]])), default=math.nan),
        stamp=max(errors, default=math.nan),
        back=sum(b.stamp < a.stamp for a, b in pairwise(scans)),
        cpu=end[1],
        grown=end[2] - memory,
        exit=driver.stop(),
        status=status,
    )


def verdict(case: Case, result: Result, *, ours: bool = True) -> list[str]:
    """Return what is worse than the case's bounds, in words; nothing for a good driver. Our diagnostics count, too."""
    found = _of_process(result) + (_of_diagnostics(case, result) if ours else [])
    if case.lost is None:
        return [*found, *([f"{result.scans} scans"] if result.scans else [])]
    if not result.scans:
        return [*found, "no scan"]
    counts = {"wrong": result.wrong, "twice": result.twice, "stamps back": result.back}
    found += [f"{name} {count}" for name, count in counts.items() if count]
    if not case.lost[0] <= result.lost <= case.lost[1]:
        found.append(f"lost {result.lost}, not {case.lost[0]} to {case.lost[1]}")
    if result.gap - case.outage > case.gap:
        found.append(f"gap {result.gap:.2f} s, not {case.outage + case.gap:.2f} s")
    if not result.stamp <= _LIMITS["stamp's error [s]"]:
        found.append(f"stamp off by {1e3 * result.stamp:.0f} ms")
    return found


def _of_process(result: Result) -> list[str]:
    values = {"CPU share": result.cpu, "time to exit [s]": result.exit, "memory [MB]": result.grown}
    if math.isnan(result.cpu) or math.isnan(result.exit):
        return ["died"]
    return [f"{name} {value:.2f}" for name, value in values.items() if value > _LIMITS[name]]


def _of_diagnostics(case: Case, result: Result) -> list[str]:
    status = result.status or Status(0, "", {})
    found = []
    if case.proof and status.values.get(case.proof, "0") in ("", "0"):
        found.append(f"no {case.proof}")
    if status.level < case.level:
        found.append(f"level {status.level}")
    return found


def noted(status: Status | None, keys: Sequence[str]) -> str:
    """Return the counts that are not 0, and the last error's code."""
    values = status.values if status else {}
    counts = [f"{key} {values[key]}" for key in values if key.startswith(tuple(keys)) and values[key] not in ("", "0")]
    code = values.get("Last Error", "").split(":")[0].split(" ")[0]
    return ", ".join([*counts, *([code] if code else [])])

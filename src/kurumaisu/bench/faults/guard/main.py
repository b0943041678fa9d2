# SPDX-License-Identifier: BSD-3-Clause
"""Kills clients, guards and sentinels, really and many times: the time until the D/A converter is neutral."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import random
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.faults.guard.endings import CASES, Case, both, sentinel, unplug
from kurumaisu.bench.guard_client import Client
from kurumaisu.bench.guard_rig import ChipRig, Rig, busy, in_memory
from kurumaisu.bench.processes import PATIENCE
from kurumaisu.bench.table import Table

_PHASE = 0.04  # [s] from armed to the strike, at most: two periods of the client
_FIFO = 1  # the benchmark's own priority while cores are busy: or it would measure when it gets its turn to strike
_DEVICES: dict[str, Callable[[Path], Rig]] = {
    "serial": Rig,
    "burst": lambda folder: Rig(folder, device={"write/frame": "burst"}),
    "iio": ChipRig,
}


Rows = list[tuple[str, str, str, str]]  # name, figures in words, bound, verdict


@dataclass(frozen=True)
class End:
    """Seconds until the device was neutral, and of these, until guard or sentinel noticed; nan: never, not said."""

    neutral: float
    noticed: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables. Return 1 if a bound is broken."""
    parser = argparse.ArgumentParser(prog="scripts/bench guard", description=__doc__)
    parser.add_argument("--times", type=int, default=50, help="repetitions of each")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the cases with that text in their name")
    parser.add_argument(
        "--load", choices=("idle", "busy", "both"), default="both", help="all cores busy, or as they are"
    )
    parser.add_argument("--device", choices=(*_DEVICES, "all"), default="all", help="docs/guard.md")
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which is struck")
    options = parser.parse_args(arguments)
    cores = os.cpu_count() or 1
    print(f"load average before: {os.getloadavg()[0]:.1f} on {cores} cores; arming shortened, to save time")
    devices = tuple(_DEVICES) if options.device == "all" else (options.device,)
    idle: list[Rows] = []
    loaded: list[Rows] = []
    for device in devices:
        if options.load != "busy":
            idle.append(_table(device, options, lambda times: max(times), 0))
        if options.load != "idle":
            loaded.append(_table(device, options, _p99, 2 * cores))
    for rows, loops in ((idle, 0), (loaded, 2 * cores)):
        if rows:
            _summary(devices, rows, f"{_load(loops)}, {options.times} times each")
    return int(any(row[-1] == "BROKEN" for rows in (*idle, *loaded) for row in rows))


def _load(loops: int) -> str:
    return f"{loops} busy loops on {os.cpu_count()} cores" if loops else "as it is"


def _summary(devices: Sequence[str], rows: Sequence[Rows], words: str) -> None:
    """Print the table of all devices: of each end median / p99 / p99 of noticing."""
    title = f"time to neutral at the device [ms], {words}: median / p99 / noticed p99"
    table = Table(title, "end", *(f"{device:<22}" for device in devices), "bound", "verdict")
    for ends in zip(*rows, strict=True):
        bounds = " / ".join(dict.fromkeys(end[2] for end in ends))
        verdict = "BROKEN" if any(end[3] == "BROKEN" for end in ends) else ends[0][3]
        table.row(ends[0][0], *(f"{end[1]:<22}" for end in ends), bounds, verdict)
    table.note("noticed: until guard or sentinel saw it, by its own log; the rest is its writing, and the device's.")


def _table(device: str, options: argparse.Namespace, worst: Callable[[list[float]], float], loops: int) -> Rows:
    """Print a table of one device; return its rows for that of all."""
    table = Table(
        f"time to neutral at the device ({device}) [ms], {_load(loops)}",
        *("end", "times", "min", "median", "p99", "max", "never", "noticed p99", "bound", "verdict"),
        page=False,
    )
    rows: Rows = []
    dice = random.Random(options.seed)
    with tempfile.TemporaryDirectory(dir=in_memory()) as folder, busy(loops), _first(loops > 0):
        rig = _DEVICES[device](Path(folder))
        with rig.board():
            for case in CASES:
                if options.only in case.name:
                    ends = [_once(rig, case, dice) for _ in range(options.times)]
                    rows.append(_row(table, case.name, ends, _bound(rig, case), worst))
    return rows


def _row(
    table: Table, name: str, ends: Sequence[End], bound: float | None, worst: Callable[[list[float]], float]
) -> tuple[str, str, str, str]:
    """Print a case's row; return its name, median / p99 / p99 of noticing [ms], its bound and the verdict."""
    times = [end.neutral for end in ends]
    there = [t for t in times if not math.isnan(t)]
    figures = [1e3 * float(f(there)) if there else math.nan for f in (min, np.median, _p99, max)]
    noticed = [end.noticed for end in ends if not math.isnan(end.noticed)]
    verdict = judge(times, bound, worst)
    seen = 1e3 * _p99(noticed) if noticed else math.nan
    limit = "-" if bound is None else f"{1e3 * bound:.0f}"
    table.row(name, str(len(times)), *figures, str(len(times) - len(there)), seen if noticed else "-", limit, verdict)
    words = " / ".join(f"{value:.3g}" for value in (figures[1], figures[2], seen)).replace("nan", "-")
    return name, words, limit, verdict


def judge(times: list[float], bound: float | None, worst: Callable[[list[float]], float]) -> str:
    """Say whether a bound is kept; a time that is nan is one in which the device never was neutral."""
    if any(math.isnan(t) for t in times):
        return "BROKEN"
    if bound is None:
        return "-"
    return "kept" if worst(times) < bound else "BROKEN"


def _bound(rig: Rig, case: Case) -> float | None:
    return case.bound + (rig.silence if case.waits else 0.0) if case.bound is not None else None


def _p99(times: list[float]) -> float:
    return float(np.quantile(times, 0.99))


def _once(rig: Rig, case: Case, dice: random.Random) -> End:
    """Arm, drive, strike; return the times to neutral."""
    rig.start()
    client = Client(rig.socket, case.mode, case.favour(rig.favour))
    try:
        client.wait_armed()
        time.sleep(dice.uniform(0, _PHASE))
        begin = case.strike(rig, client)
        end = rig.neutral(PATIENCE, begin if case.strike is unplug else math.inf)
        if case.strike in (sentinel, both):
            rig.reap()
        if end is None:
            return End(math.nan, math.nan)
        noticed = None if case.strike in (unplug, both) else rig.reaction(begin)
        return End(end - begin, math.nan if noticed is None else noticed - begin)
    finally:
        client.end()


@contextlib.contextmanager
def _first(wanted: bool) -> Iterator[None]:
    """Come before the busy loops, so that what is measured is the guard; its client does not."""
    if not wanted:
        yield
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(_FIFO))
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)

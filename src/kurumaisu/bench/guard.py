# SPDX-License-Identifier: BSD-3-Clause
"""Kills clients, guards and sentinels, really and many times: the time until the D/A converter is neutral."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.guard_rig import Client, Rig, busy, strike
from kurumaisu.bench.processes import PATIENCE
from kurumaisu.bench.table import Table

_PHASE = 0.04  # [s] from armed to the strike, at most: two periods of the client
_HELD = 0.5  # [s] without neutral, when nobody is left to write it
_AWAY = 0.1  # [s] that the device is unplugged
_FIFO = 1  # the benchmark's own priority while cores are busy: or it would measure when it gets its turn to strike


@dataclass(frozen=True)
class Case:
    """Something that ends badly, and the time [s] in which the device must be neutral; None: nothing is promised."""

    name: str
    mode: str  # of the client
    bound: float | None
    strike: Callable[[Rig, Client], float]
    waits: bool = False  # the bound counts from the guard's timeout
    favoured: bool = True  # the client has base_node's nice value


def _client(number: signal.Signals) -> Callable[[Rig, Client], float]:
    return lambda _rig, client: strike(lambda: [client.process.pid], number)


def _itself(_rig: Rig, client: Client) -> float:
    return client.fail()


def _guard(rig: Rig, _client: Client) -> float:
    return strike(lambda: [rig.guard()], signal.SIGKILL)


def _sentinel(rig: Rig, _client: Client) -> float:
    return strike(lambda: [rig.sentinel()], signal.SIGKILL)


def _both(rig: Rig, _client: Client) -> float:
    """Kill both at once; the sentinel stopped, so that it cannot see the guard die."""
    guard = rig.guard()
    os.kill(rig.sentinel(), signal.SIGSTOP)
    os.kill(guard, signal.SIGSTOP)
    begin = strike(lambda: [rig.sentinel(), guard], signal.SIGKILL)
    if rig.neutral(_HELD) is None:
        begin = time.monotonic()
        rig.force()
    return begin


def _unplug(rig: Rig, _client: Client) -> float:
    before = len(rig.changes())
    rig.inject(f"unplug={_AWAY}")
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        plugged = [change.time for change in rig.changes()[before:] if change.neutral is None]
        if plugged:
            return plugged[0]
        time.sleep(0.001)
    return math.nan


CASES = (
    Case("client exits", "exit", 0.010, _itself),
    Case("client SIGKILL", "wait", 0.010, _client(signal.SIGKILL)),
    Case("... as nice as all others", "wait", None, _client(signal.SIGKILL), favoured=False),
    Case("client SIGSEGV", "crash", 0.010, _itself),
    Case("client talks nonsense", "nonsense", 0.010, _itself),
    Case("client SIGSTOP", "wait", 0.020, _client(signal.SIGSTOP), waits=True),
    Case("client deadlocked", "deadlock", 0.020, _itself, waits=True),
    Case("client in an endless loop", "loop", 0.020, _itself, waits=True),
    Case("guard SIGKILL", "wait", 0.020, _guard),
    Case("sentinel SIGKILL", "wait", 0.020, _sentinel),
    Case("device unplugged and back", "wait", None, _unplug),
    Case("both SIGKILL; guard --neutral", "wait", None, _both),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables. Return 1 if a bound is broken."""
    parser = argparse.ArgumentParser(prog="bench guard", description=__doc__)
    parser.add_argument("--times", type=int, default=50, help="repetitions of each")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the cases with that text in their name")
    parser.add_argument(
        "--load", choices=("idle", "busy", "both"), default="both", help="all cores busy, or as they are"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which is struck")
    options = parser.parse_args(arguments)
    cases = [case for case in CASES if options.only in case.name]
    cores = os.cpu_count() or 1
    broken = 0
    print(f"load average before: {os.getloadavg()[0]:.1f} on {cores} cores; arming shortened, to save time")
    if options.load != "busy":
        broken += _table("as it is", cases, options, lambda times: max(times), 0)
    if options.load != "idle":
        words = f"{2 * cores} busy loops on {cores} cores"
        broken += _table(words, cases, options, lambda times: float(np.quantile(times, 0.99)), 2 * cores)
    print(f"\n{broken} bounds broken")
    return 1 if broken else 0


def _table(
    words: str, cases: Sequence[Case], options: argparse.Namespace, worst: Callable[[list[float]], float], loops: int
) -> int:
    """Print a table; return how many bounds are broken, by the maximum or the quantile that counts."""
    table = Table(
        f"time to neutral at the device [ms], {words}",
        *("end", "times", "min", "median", "p99", "max", "never", "bound", "verdict"),
    )
    broken = 0
    dice = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder, busy(loops), _first(loops > 0):
        rig = Rig(Path(folder))
        with rig.board():
            for case in cases:
                times = [_once(rig, case, dice) for _ in range(options.times)]
                there = [t for t in times if not math.isnan(t)]
                bound = _bound(rig, case)
                verdict = judge(times, bound, worst)
                broken += verdict == "BROKEN"
                figures = [1e3 * float(f(there)) if there else math.nan for f in (min, np.median, _p99, max)]
                shown = "-" if bound is None else f"{1e3 * bound:.0f}"
                table.row(case.name, str(len(times)), *figures, str(len(times) - len(there)), shown, verdict)
    return broken


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


def _once(rig: Rig, case: Case, dice: random.Random) -> float:
    """Arm, drive, strike; return the time to neutral [s], nan if it never came."""
    rig.start()
    client = Client(rig.socket, case.mode, rig.nice if case.favoured else 0)
    try:
        client.wait_armed()
        time.sleep(dice.uniform(0, _PHASE))
        begin = case.strike(rig, client)
        end = rig.neutral(PATIENCE, begin if case.strike is _unplug else math.inf)
        if case.strike in (_sentinel, _both):
            rig.reap()
        return math.nan if end is None else end - begin
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

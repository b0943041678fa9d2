# SPDX-License-Identifier: BSD-3-Clause
"""Every signal, by its number, to each of the processes that hold the board; descriptors, steps, a board that boots."""

from __future__ import annotations

import resource
import signal
import time
from pathlib import Path

from kurumaisu.bench.faults.base.cases import Case, Seen
from kurumaisu.bench.faults.base.chain import Chain, Setup
from kurumaisu.bench.faults.base.ends import CLIENT_BOUND, GUARD_BOUND, watcher_stops
from kurumaisu.bench.faults.base.peers import end, until
from kurumaisu.bench.guard_client import RawClient
from kurumaisu.bench.guard_rig import Rig
from kurumaisu.bench.processes import cpu

_HARMLESS = (signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH, signal.SIGPIPE)
_OWN = (signal.SIGXCPU,)  # base_node's own use: a thread ran for too long at its priority
_LOOK = 3.0  # [s]
_BUSY = 0.3  # of a processor
_STEPS = (0.5, 1.0, 1.5, 2.0, 2.2, 0.0, -0.5, -1.0, -1.5, -1.8)  # [V]
_MOST = 1.05  # [V] away from neutral within the guard's period: two steps, neither clock being the other's
_DEAF = 30  # commands that a board does not hear while it boots


def _numbers(*but: int) -> list[int]:
    """Return the numbers of all signals that end or stop a process; 32 and 33 are the C library's."""
    spared = {signal.SIGSTOP, 32, 33, *_HARMLESS, *but}
    return [number for number in range(1, signal.SIGRTMAX + 1) if number not in spared]


def _base_node(stage: Chain, seen: Seen) -> None:
    for number in _numbers(*_OWN):
        stage.drive()
        assert stage.node
        seen.neutral(stage, stage.strike(number), CLIENT_BOUND)
        until(lambda: stage.node and stage.node.poll() is not None, f"the end of base_node by signal {number}")
    seen.note(f"{len(_numbers(*_OWN))} signals")


def _guard(stage: Chain, seen: Seen) -> None:
    for number in _numbers():
        stage.drive()
        since = seen.neutral(stage, stage.strike(number, stage.rig.guard()), GUARD_BOUND)
        seen.check(not stage.moved(since + GUARD_BOUND, 0.05), f"moved after signal {number}")
    seen.note(f"{len(_numbers())} signals")


def _sentinel(stage: Chain, seen: Seen) -> None:
    for number in _numbers():
        stage.drive()
        seen.neutral(stage, stage.strike(number, stage.rig.sentinel()), GUARD_BOUND)
        stage.rig.reap()
        stage.rig.start()
    seen.note(f"{len(_numbers())} signals")


def _no_descriptors(stage: Chain, seen: Seen) -> None:
    stage.drive()
    guard = stage.rig.guard()
    limits = resource.prlimit(guard, resource.RLIMIT_NOFILE)
    count = sum(1 for _ in Path(f"/proc/{guard}/fd").iterdir())
    resource.prlimit(guard, resource.RLIMIT_NOFILE, (count, limits[1]))
    stage.mark()
    others = [RawClient(stage.rig.socket) for _ in range(5)]
    used, begin = cpu(guard), time.monotonic()
    time.sleep(_LOOK)
    share = (cpu(guard) - used) / (time.monotonic() - begin)
    seen.check(share < _BUSY, f"{share:.2f} of a processor")
    seen.undisturbed(stage)
    seen.note(f"drives on, {share:.2f} of a processor")
    for other in others:
        other.close()
    resource.prlimit(guard, resource.RLIMIT_NOFILE, limits)


def _steps(stage: Chain, seen: Seen) -> None:
    stage.drive()
    assert stage.node
    end(stage.node)
    stage.neutral()
    client = RawClient(stage.rig.socket)
    client.arm(2 * stage.guard_values["limits"]["arming"])
    stage.mark()
    for volts in _STEPS:
        client.put(volts)
    time.sleep(0.1)
    client.close()
    period = stage.guard_values["period"]
    put = [(c.time, c.volts[0]) for c in stage.changes() if c.volts]
    neutral = (stage.begun, 0.0)
    worst = max((_away(a, b) for t, a in [neutral, *put] for u, b in put if 0 <= u - t <= period), default=0.0)
    seen.check(worst <= _MOST, f"{worst:.2f} V")
    seen.said(stage, "GUARD_TRIPPED")
    seen.note(f"{worst:.2f} V within a period")


def _away(a: float, b: float) -> float:
    """Return by how much b [V] is farther from neutral than a, on its side."""
    return abs(b) - (abs(a) if a * b > 0 else 0.0)


def _boots(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.rig.end()
    stage.inject(f"deafx{_DEAF}")
    stage.mark()
    begin = time.monotonic()
    stage.rig.start()
    stage.wait_said("GUARD_DEVICE: ")
    seen.within("neutral", time.monotonic() - begin, float(stage.device_values["boot"]))
    seen.check("GUARD_DEVICE_LOST" not in stage.said(), "opened again")
    seen.note("one opening")
    seen.again(stage)


_BY_NUMBER = "every signal that ends or stops, by number, but SIGSTOP"
CASES = (
    Case("E", "base_node is signalled", f"{_BY_NUMBER} and SIGXCPU", "neutral within 10 ms", _base_node),
    Case("E", "guard is signalled", _BY_NUMBER, "neutral within 20 ms; then another guard", _guard),
    Case("E", "sentinel is signalled", _BY_NUMBER, "neutral within 20 ms", _sentinel),
    Case(
        "E",
        "sentinel hangs",
        "SIGSTOP",
        "neutral within its silence + 20 ms, by the guard",
        watcher_stops(Rig.sentinel, "GUARD_TRIPPED: the sentinel is silent"),
    ),
    Case(
        "F",
        "guard at its limit of descriptors",
        "5 more connect",
        "drives on; hardly any processor time",
        _no_descriptors,
    ),
    Case(
        "G",
        "a client in a hurry",
        f"{len(_STEPS)} steps of 0.5 V as fast as they are taken",
        f"trips; within a period at most {_MOST:g} V",
        _steps,
    ),
    Case(
        "H",
        "board: boots when its port is opened",
        f"deaf to {_DEAF} commands",
        "opened once; neutral when it hears",
        _boots,
        Setup(device={"boot": 10.0}),
    ),
)

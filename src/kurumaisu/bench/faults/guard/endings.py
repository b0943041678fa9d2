# SPDX-License-Identifier: BSD-3-Clause
"""What may end badly in front of the D/A converter, and how it is made to."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from kurumaisu.bench.guard_client import Client, Favour
from kurumaisu.bench.guard_rig import Rig, strike
from kurumaisu.bench.processes import PATIENCE

_HELD = 0.5  # [s] without neutral, when nobody is left to write it
_AWAY = 0.1  # [s] that the device is unplugged


@dataclass(frozen=True)
class Case:
    """Something that ends badly, and the time [s] in which the device must be neutral; None: nothing is promised."""

    name: str
    mode: str  # of the client
    bound: float | None
    strike: Callable[[Rig, Client], float]
    waits: bool = False  # the bound counts from the guard's timeout
    favour: Callable[[Favour], Favour] = lambda favour: favour  # the client's, from base_node's


def _client(number: signal.Signals) -> Callable[[Rig, Client], float]:
    return lambda _rig, client: strike(lambda: [client.process.pid], number)


def _itself(_rig: Rig, client: Client) -> float:
    return client.fail()


def _guard(rig: Rig, _client: Client) -> float:
    return strike(lambda: [rig.guard()], signal.SIGKILL)


def sentinel(rig: Rig, _client: Client) -> float:
    """Kill the sentinel."""
    return strike(lambda: [rig.sentinel()], signal.SIGKILL)


def both(rig: Rig, _client: Client) -> float:
    """Kill both at once; the sentinel stopped, so that it cannot see the guard die."""
    guard = rig.guard()
    os.kill(rig.sentinel(), signal.SIGSTOP)
    os.kill(guard, signal.SIGSTOP)
    begin = strike(lambda: [rig.sentinel(), guard], signal.SIGKILL)
    if rig.neutral(_HELD) is None:
        begin = time.monotonic()
        rig.force()
    return begin


def unplug(rig: Rig, _client: Client) -> float:
    """Unplug the device; return when it was back."""
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
    Case(
        "... with the nice value only", "wait", None, _client(signal.SIGKILL), favour=lambda f: replace(f, priority=0)
    ),
    Case("... with neither", "wait", None, _client(signal.SIGKILL), favour=lambda f: replace(f, priority=0, nice=0)),
    Case("client SIGSEGV", "crash", 0.010, _itself),
    Case("... with a core file", "dump", 0.010, _itself),
    Case("client talks nonsense", "nonsense", 0.010, _itself),
    Case("client SIGSTOP", "wait", 0.020, _client(signal.SIGSTOP), waits=True),
    Case("client deadlocked", "deadlock", 0.020, _itself, waits=True),
    Case("client in an endless loop", "loop", 0.020, _itself, waits=True),
    Case("guard SIGKILL", "wait", 0.020, _guard),
    Case("sentinel SIGKILL", "wait", 0.020, sentinel),
    Case("device unplugged and back", "wait", None, unplug),
    Case("both SIGKILL; guard --neutral", "wait", None, both),
)

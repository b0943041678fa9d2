# SPDX-License-Identifier: BSD-3-Clause
"""Faults 3, 4 and 15: base_node, guard or sentinel dies or hangs, also on busy cores."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path

from kurumaisu.bench.faults.base.cases import Case, Seen, trips
from kurumaisu.bench.faults.base.chain import Chain, V, W
from kurumaisu.bench.faults.base.peers import until
from kurumaisu.bench.guard_rig import Rig, busy

CLIENT_BOUND, _HANG, GUARD_BOUND = 0.010, 0.020, 0.020  # [s] until neutral; a hang counts from the guard's silence
_STOPPED = 0.5  # [s]
_LOADED = 3.0  # [s] of driving on busy cores


def dies(number: signal.Signals, bound: float = CLIENT_BOUND) -> Callable[[Chain, Seen], None]:
    """Return how base_node dies of a signal; neutral within the bound [s]."""

    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        since = seen.neutral(stage, stage.strike(number), bound)
        seen.said(stage, "GUARD_TRIPPED: the client is gone")
        _node_again(stage, seen, since)

    return play


def _node_again(stage: Chain, seen: Seen, since: float) -> None:
    """Start base_node anew, with the stick held throughout."""
    begin = time.monotonic()
    stage.start_node()
    stage.peer.wait("voltages", since=begin)
    seen.latched(stage, since)


def stops(stage: Chain, seen: Seen) -> None:
    """Stop base_node for a while."""
    stage.drive()
    begin = stage.strike(signal.SIGSTOP)
    since = seen.neutral(stage, begin, stage.guard_values["limits"]["silence"] + _HANG)
    time.sleep(max(0.0, begin + _STOPPED - time.monotonic()))
    stage.strike(signal.SIGCONT)
    seen.said(stage, "GUARD_TRIPPED: the client is silent")
    seen.latched(stage, since)


def _ends(number: signal.Signals) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        assert stage.node
        since = seen.neutral(stage, stage.strike(number), stage.period + CLIENT_BOUND)
        until(lambda: stage.node and stage.node.poll() is not None, "the end of base_node")
        code = stage.node.poll()
        seen.check(code == 0, f"exit status {code}")
        seen.held(stage, since)
        seen.note("exit status 0")

    return play


def guard_dies(stage: Chain, seen: Seen) -> None:
    """Kill the guard."""
    stage.drive()
    since = seen.neutral(stage, stage.strike(signal.SIGKILL, stage.rig.guard()), GUARD_BOUND)
    seen.said(stage, "GUARD_DEAD: killed: Killed")
    seen.latched(stage, since)


def watcher_stops(process: Callable[[Rig], int], words: str) -> Callable[[Chain, Seen], None]:
    """Return how guard or sentinel is stopped; the other one sees to neutral, and says some words."""

    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        bound = stage.guard_values["sentinel_silence"] + GUARD_BOUND
        pid = process(stage.rig)
        since = seen.neutral(stage, stage.strike(signal.SIGSTOP, pid), bound)
        seen.said(stage, words)
        seen.held(stage, since)
        with suppress(ProcessLookupError):  # a guard was killed
            stage.strike(signal.SIGCONT, pid)
        seen.again(stage)

    return play


def _sentinel_dies(stage: Chain, seen: Seen) -> None:
    stage.drive()
    guard = stage.rig.guard()
    since = seen.neutral(stage, stage.strike(signal.SIGKILL, stage.rig.sentinel()), GUARD_BOUND)
    stage.rig.reap()
    until(lambda: not Path(f"/proc/{guard}").exists(), "the guard's end")
    stage.status("guard", "no guard")
    seen.note("diagnostics: no guard")
    seen.held(stage, since)
    stage.rig.start()  # as systemd does
    seen.latched(stage, since)


def _both_die(stage: Chain, seen: Seen) -> None:
    stage.drive()
    guard, sentinel = stage.rig.guard(), stage.rig.sentinel()
    for pid in (sentinel, guard):  # so that neither sees the other die
        os.kill(pid, signal.SIGSTOP)
    for pid in (sentinel, guard):
        os.kill(pid, signal.SIGKILL)
    stage.rig.reap()
    time.sleep(_STOPPED)
    seen.check(not stage.changes(time.monotonic() - _STOPPED), "neutral, though nobody is left")
    seen.note("held")
    begin = time.monotonic()
    stage.rig.force()
    since = stage.neutral()
    seen.within("`guard --neutral`: neutral", since - begin, 1.0)
    stage.rig.start()
    seen.latched(stage, since)


def _loaded(stage: Chain, seen: Seen) -> None:
    with _all_busy():
        stage.drive()
        before, begin = trips(stage), time.monotonic()
        time.sleep(_LOADED)
        lost = trips(stage) - before
        alive = stage.has(V, W) if not lost else True
        seen.check(alive, "does not drive")
        seen.note(f"{len(stage.changes(begin))} changes of voltage and {lost} trips in {_LOADED:g} s")


def _loaded_with(play: Callable[[Chain, Seen], None]) -> Callable[[Chain, Seen], None]:
    def played(stage: Chain, seen: Seen) -> None:
        with _all_busy():
            play(stage, seen)

    return played


def _all_busy() -> AbstractContextManager[None]:
    return busy(2 * (os.cpu_count() or 1))


_SOON = "neutral within 10 ms; started anew with the stick held: neutral until it is let go"
_LOOPS = "2 busy loops for each core"

CASES = (
    Case("3", "base_node dies", "SIGKILL", _SOON, dies(signal.SIGKILL), repeated=True),
    Case("3", "base_node dies", "SIGSEGV", _SOON, dies(signal.SIGSEGV), repeated=True),
    Case("3", "base_node dies", "SIGABRT", _SOON, dies(signal.SIGABRT), repeated=True),
    Case(
        "3",
        "base_node hangs",
        f"SIGSTOP, SIGCONT after {_STOPPED:g} s",
        "neutral within the guard's silence + 20 ms; then neutral until the stick is let go",
        stops,
        repeated=True,
    ),
    Case("3", "base_node is ended", "SIGTERM", "neutral within a tick + 10 ms", _ends(signal.SIGTERM), repeated=True),
    Case(
        "4",
        "guard dies",
        "SIGKILL",
        "neutral within 20 ms, by the sentinel; then neutral until the stick is let go",
        guard_dies,
        repeated=True,
    ),
    Case(
        "4",
        "guard hangs",
        "SIGSTOP",
        "neutral within the sentinel's silence + 20 ms; then as above",
        watcher_stops(Rig.guard, "GUARD_DEAD: killed: Killed"),
    ),
    Case(
        "4",
        "sentinel dies",
        "SIGKILL",
        "neutral within 20 ms, by the guard, which ends; started anew: as above",
        _sentinel_dies,
        repeated=True,
    ),
    Case(
        "4",
        "both die at once",
        "SIGKILL of both while stopped",
        "held; neutral by `guard --neutral`, which systemd starts; then as above",
        _both_die,
    ),
    Case("15", "busy cores", _LOOPS, "drives on within its limits, or is neutral", _loaded),
    Case("15", "busy cores", f"{_LOOPS}, SIGSTOP of base_node", "as without load", _loaded_with(stops), repeated=True),
    Case(
        "15",
        "busy cores",
        f"{_LOOPS}, SIGKILL of base_node",
        "as without load",
        _loaded_with(dies(signal.SIGKILL)),
        repeated=True,
    ),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Faults 9 and 11: emergency stop and dead-man, and a stick that is held from the start."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable

from kurumaisu.bench.faults.base.braking import SLACK, brakes
from kurumaisu.bench.faults.base.cases import Case, Seen, service
from kurumaisu.bench.faults.base.chain import Chain, Setup, V, W
from kurumaisu.bench.faults.base.peers import until

ONCE = 0.06  # [s] until what acts at once has: a tick of the commander, and the way
_WATCHED = 0.3  # [s] timeout of a watched button


def _at_once(stage: Chain, seen: Seen, begin: float, bound: float) -> float:
    """See neutral come without a ramp."""
    since = seen.neutral(stage, begin, bound)
    moving = [change for change in stage.changes(begin) if change.neutral is False]
    seen.check(len(moving) < 2, f"{len(moving)} voltages in between")  # V_f is written before V_s
    return since


def _released(stage: Chain, seen: Seen) -> None:
    """See that an emergency stop can be reset only once the stick is let go."""
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while somebody commands motion")
    seen.note(f"~reset refused: {answer['message']}")
    stage.peer.say(0.0, 0.0)
    until(lambda: stage.peer.call(service("reset"))["success"], "a reset")
    seen.again(stage)


def _button_silent(stage: Chain, seen: Seen) -> None:
    stage.peer.repeat("e_stop", False)
    stage.drive()
    begin = time.monotonic()
    stage.peer.repeat("e_stop", None)
    since = _at_once(stage, seen, begin, _WATCHED + SLACK)
    seen.said(stage, "BASE_EMERGENCY_STOP")
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while nobody watches")
    stage.peer.repeat("e_stop", False)  # it speaks again
    seen.held(stage, since)
    _released(stage, seen)


def _button_pressed(stage: Chain, seen: Seen) -> None:
    stage.peer.repeat("e_stop", False)
    stage.drive()
    begin = time.monotonic()
    stage.peer.repeat("e_stop", True)
    since = _at_once(stage, seen, begin, ONCE)
    seen.held(stage, since)
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while it is pressed")
    stage.peer.repeat("e_stop", False)
    seen.held(stage, since)
    _released(stage, seen)


def _never_watched(stage: Chain, seen: Seen) -> None:
    for word in (False, None):
        stage.peer.repeat("e_stop", word)
    stage.peer.say(V, W)
    begin = time.monotonic()
    stage.start_node()
    seen.said(stage, "BASE_EMERGENCY_STOP")
    stage.status("commands", "emergency stop")
    seen.held(stage, begin)
    seen.note("neutral, latched")
    stage.peer.repeat("e_stop", False)
    stage.status("commands", "emergency stop")
    _released(stage, seen)


def let_go(name: str, *words: bool | None) -> Callable[[Chain, Seen], None]:
    """Return how the dead-man of a lock is let go by each of some words (None: silence), and held again."""

    def play(stage: Chain, seen: Seen) -> None:
        lock = stage.values["locks"][name]
        for word in words:
            stage.peer.repeat(lock["topic"], True)
            stage.drive()
            stage.peer.wait_joined(lock["topic"])
            begin = time.monotonic()
            stage.peer.repeat(lock["topic"], word)
            since = brakes(stage, seen, begin, float(lock["timeout"]) if word is None else 0.0)
            seen.held(stage, since)
        seen.said(stage, f"BASE_LOCKED: {name}")
        stage.peer.repeat(lock["topic"], True)
        until(lambda: stage.has(V, W), "it goes on")
        seen.note("held again: goes on")

    return play


def _held_from_the_start(stage: Chain, seen: Seen) -> None:
    stage.peer.say(V, W)
    begin = time.monotonic()
    stage.start_node()
    stage.peer.wait("voltages", since=begin)
    seen.said(stage, "BASE_NOT_RELEASED: navigation")
    seen.held(stage, begin)
    seen.held(stage, begin)
    seen.note("neutral")
    seen.again(stage)


def _heard_late(stage: Chain, seen: Seen) -> None:
    """Its stick is held all along, but the first word of it comes when base_node has heard nothing for long."""
    stage.peer.say(V, W)
    begin = time.monotonic()
    stage.peer.signal(signal.SIGSTOP)
    stage.start_node()
    until(stage.is_armed, "the guard is armed")
    stage.peer.signal(signal.SIGCONT)
    seen.said(stage, "BASE_NOT_RELEASED: navigation")
    seen.held(stage, begin)
    seen.note("neutral")
    seen.again(stage)


_RESET = "~reset refused until it is released and the stick let go"
_STOP = Setup(node={"estop/timeout": _WATCHED})

CASES = (
    Case(
        "9",
        "emergency stop",
        "its topic falls silent",
        f"neutral at once after its timeout; {_RESET}",
        _button_silent,
        _STOP,
    ),
    Case("9", "emergency stop", "pressed", f"neutral at once; {_RESET}", _button_pressed, _STOP),
    Case(
        "9", "emergency stop", "its topic silent from the start", f"neutral, latched; {_RESET}", _never_watched, _STOP
    ),
    Case(
        "9",
        "dead-man",
        "its topic falls silent",
        "brakes after its timeout; held again: goes on",
        let_go("passenger", None),
        Setup(node={"locks/passenger/timeout": _WATCHED}),
    ),
    Case("11", "commanded from the start", "the stick is held", "neutral until it is let go", _held_from_the_start),
    Case(
        "11",
        "commanded from the start",
        "the stick is held, the commander hangs until the guard is armed",
        "neutral until it is let go",
        _heard_late,
    ),
)

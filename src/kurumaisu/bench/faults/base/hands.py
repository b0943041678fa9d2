# SPDX-License-Identifier: BSD-3-Clause
"""What people hold and press: a hand-held dead-man, two buttons, a watcher that talks nonsense; and tiny commands."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from kurumaisu.bench.faults.base.braking import SLACK, brakes, braking, limits_of
from kurumaisu.bench.faults.base.cases import Case, Seen, service
from kurumaisu.bench.faults.base.chain import Chain, V, W
from kurumaisu.bench.faults.base.peers import until
from kurumaisu.bench.faults.base.stops import ONCE, let_go

_RELEASES = 60  # that follow a press at once
_NO_CAP = 1.5  # [m/s]
_TINY = 1e-300  # [m/s, rad/s]


def _let_go(stage: Chain, seen: Seen) -> None:
    let_go("dead_man", False, None)(stage, seen)
    stage.peer.repeat("dead_man", None)
    stage.start_node()  # one that never heard it


def _never_there(stage: Chain, seen: Seen) -> None:
    stage.start_node()
    seen.said(stage, "BASE_NO_DEAD_MAN")
    seen.check("dead_man" in stage.status("commands").values["values"]["dead-men never heard"], "diagnostics do not")
    stage.drive()
    seen.note("drives; diagnostics say so")


def _two(topic: str, reason: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        other = stage.another_peer()
        other.repeat(topic, False)
        stage.peer.repeat(topic, False)
        stage.drive()
        stage.peer.wait_joined(topic)
        begin = time.monotonic()
        stage.peer.repeat(topic, True)
        since = seen.neutral(stage, begin, SLACK + braking(stage))
        seen.said(stage, reason)
        seen.held(stage, since)
        if topic == "e_stop":
            answer = stage.peer.call(service("reset"))
            seen.check(not answer["success"] and "/peer" in answer["message"], f"reset: {answer['message']}")
            seen.note("~reset refused, naming who presses")
        stage.peer.repeat(topic, False)
        stage.peer.say(0.0, 0.0)
        until(lambda: stage.peer.call(service("reset"))["success"], "a reset")
        seen.again(stage)
        other.repeat(topic, None)

    return play


def _burst(stage: Chain, seen: Seen) -> None:
    stage.peer.repeat("e_stop", False)
    stage.drive()
    stage.peer.wait_joined("e_stop")
    begin = time.monotonic()
    stage.peer.order(do="burst", topic="e_stop", values=[True, *[False] * _RELEASES])
    since = seen.neutral(stage, begin, ONCE)
    seen.held(stage, since)
    stage.peer.say(0.0, 0.0)
    until(lambda: stage.peer.call(service("reset"))["success"], "a reset")
    seen.again(stage)


def _cap(value: float) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.peer.repeat("speed_cap", _NO_CAP)
        stage.drive()
        stage.peer.wait_joined("speed_cap")
        limits = limits_of(stage)
        begin = time.monotonic()
        stage.peer.repeat("speed_cap", value)
        seen.said(stage, "BASE_BAD_CAP")
        since = brakes(stage, seen, begin, limits["v_deceleration"] / limits["v_jerk"])
        seen.held(stage, since)
        stage.peer.repeat("speed_cap", None)
        until(lambda: stage.has(V, W), "it goes on", 3.0)
        seen.note("silent: goes on after the cap's timeout")

    return play


def _tiny(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.rest()
    stage.peer.say(_TINY, -_TINY)
    time.sleep(0.3)
    seen.undisturbed(stage)
    seen.note("neutral")


CASES = (
    Case(
        "A",
        "hand-held dead-man",
        "let go; then silent",
        "brakes, at once and after its timeout; held: goes on",
        _let_go,
    ),
    Case("A", "hand-held dead-man", "never there", "drives without, and says so", _never_there),
    Case(
        "B",
        "two buttons",
        "one presses, the other says that it does not",
        "neutral; latched",
        _two("e_stop", "BASE_EMERGENCY_STOP"),
    ),
    Case(
        "B",
        "two publishers of a lock",
        "one engages, the other does not",
        "brakes; blocked",
        _two("hold", "BASE_LOCKED: hold"),
    ),
    Case("B", "emergency stop", f"pressed, then {_RELEASES} releases at once", "neutral at once; latched", _burst),
    *(
        Case(
            "C",
            "speed cap",
            f"{value:g} m/s",
            "not understood: brakes, by the ramp with its jerk, as for 0 m/s",
            _cap(value),
        )
        for value in (-1.0, math.nan)
    ),
    Case("D", "a command too small to obey", f"{_TINY:g} m/s", "rest: neutral", _tiny),
)

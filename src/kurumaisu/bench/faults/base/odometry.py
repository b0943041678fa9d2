# SPDX-License-Identifier: BSD-3-Clause
"""Fault 13: odometry beside what the board really put out."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable

from kurumaisu.bench.faults.base.cases import Case, Seen, service
from kurumaisu.bench.faults.base.chain import Chain, Setup, V
from kurumaisu.bench.faults.base.path import distance
from kurumaisu.bench.faults.base.peers import until

_CUT = 0.8  # [V] where the band of V_f ends
_DRIVEN = 1.0  # [s]


def _compare(stage: Chain, seen: Seen) -> None:
    """Compare odometry with the board, from the rest at the mark to one that is brought about now."""
    stage.peer.say(0.0, 0.0)
    stage.neutral()
    last = stage.peer.wait("odom", lambda event: event["v"] == 0.0, time.monotonic())
    first = next(event for event in stage.peer.heard("odom", stage.begun) if event["v"] != 0.0)
    measured = distance(stage.law.translation, stage.changes(), time.monotonic())
    told = math.hypot(last["x"] - first["x"], last["y"] - first["y"])
    seen.check(abs(told - measured) < 0.01 + 0.01 * measured, f"odometry {told:.3f} m, the board {measured:.3f} m")
    seen.note(f"odometry {told:.3f} m, by the board's volts {measured:.3f} m")


def _clamp_active(stage: Chain, seen: Seen) -> None:
    stage.rest()
    stage.drive(0.3, 0.0)
    stage.peer.say(1.0, 0.0)
    until(lambda: (stage.changes()[-1].volts or (0.0,))[0] > _CUT - 0.002, f"{_CUT} V")
    time.sleep(_DRIVEN)
    _compare(stage, seen)
    volts = max(change.volts[0] for change in stage.changes() if change.volts)
    seen.check(volts < _CUT + 0.001, f"{volts:.3f} V")
    seen.check(stage.count("samples cut by the band", "voltage law") > 0, "not counted")
    seen.note(f"V_f at most {volts:.3f} V, counted")


def _hang(seconds: float) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.rest()
        stage.drive(V, 0.0)
        late = stage.count("late ticks")
        stage.strike(signal.SIGSTOP)
        time.sleep(seconds)
        stage.strike(signal.SIGCONT)
        stage.peer.wait("voltages", since=time.monotonic() + stage.period)
        seen.check(stage.count("late ticks") > late, "the late tick is not counted")
        _compare(stage, seen)

    return play


def _reset_while_moving(stage: Chain, seen: Seen) -> None:
    stage.drive(V, 0.0)
    stage.mark()
    before = stage.peer.heard("odom")[-1]["x"]
    stage.peer.call(service("reset_odometry"))
    after = stage.peer.wait("odom", lambda event: event["x"] < before, stage.begun)
    seen.check(abs(after["v"] - V) < 0.002, f"odometry tells {after['v']:.3f} m/s")
    seen.check(0 <= after["x"] < 0.05, f"x is {after['x']:.3f} m")
    seen.undisturbed(stage)
    seen.note(f"x from {before:.2f} m to {after['x']:.2f} m, speed and voltages as before")


_OPEN_LOOP = "odometry within 1 % of what the board's volts stand for"

CASES = (
    Case(
        "13",
        "odometry: clamp",
        f"1 m/s asked for, V_f's band ends at {_CUT} V",
        _OPEN_LOOP,
        _clamp_active,
        Setup(node={"model/voltages/translation/max": _CUT}),
    ),
    Case("13", "odometry: late tick", "SIGSTOP of base_node for 0.1 s", _OPEN_LOOP, _hang(0.1)),
    Case("13", "odometry: guard trips", "SIGSTOP of base_node for 0.5 s", _OPEN_LOOP, _hang(0.5)),
    Case(
        "13",
        "odometry: reset",
        "~reset_odometry while moving",
        "from 0; speed and voltages as before",
        _reset_while_moving,
    ),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Faults 8 and 14: clocks that jump or stand still, and a ROS master that dies, hangs or is another one."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable

from kurumaisu.bench.faults.base.braking import SLACK, braking, timeout
from kurumaisu.bench.faults.base.cases import Case, Seen
from kurumaisu.bench.faults.base.chain import Chain, Setup, V, W
from kurumaisu.bench.faults.base.peers import until
from kurumaisu.bench.processes import PATIENCE

_AHEAD, _BACK = 3600.0, -7200.0  # [s] by which the wall clock is set
_LEAP = 1000.0  # [s] of simulated time
_WATCH = 1.0  # [s]
_QUESTION = 1.2  # of master_timeout: it is asked five times in that time


def _wall_clock(step: float) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        assert stage.calls
        stage.drive()
        stage.mark()
        before = stage.peer.heard("voltages")[-1]["stamp"]
        stage.calls.step_clock(step)
        try:
            time.sleep(_WATCH)
            seen.undisturbed(stage)
            seen.check(stage.count("time resets") == 0, "time ran backwards for it")
            moved = stage.peer.heard("voltages")[-1]["stamp"] - before
            seen.check(abs(moved - step) < 2 * _WATCH + SLACK, f"its stamps moved by {moved:.0f} s")
            seen.note(f"stamps moved by {moved:.0f} s, voltages as before")
            begin = time.monotonic()
            stage.peer.repeat("cmd_vel", None)
            seen.neutral(stage, begin, timeout(stage) + braking(stage) + SLACK)
        finally:
            stage.calls.step_clock(0.0)

    return play


def _reset(stage: Chain, seen: Seen) -> None:
    stage.drive()
    begin = time.monotonic()
    stage.tick(1.0)
    since = seen.neutral(stage, begin, SLACK)
    seen.said(stage, "BASE_TIME_RESET")
    seen.check(stage.count("time resets") > 0, "not counted")
    seen.check(stage.peer.heard("odom")[-1]["x"] == 0.0, "odometry goes on")
    seen.latched(stage, since)


def _leap(stage: Chain, seen: Seen) -> None:
    stage.drive(V, 0.0)
    stage.mark()
    before = stage.peer.heard("odom")[-1]["x"]
    stage.tick(stage.clock + _LEAP)
    until(lambda: stage.has(V, 0.0) and stage.peer.heard("odom")[-1]["stamp"] > _LEAP, "it drives on")
    time.sleep(_WATCH)
    top = max([change.volts[0] for change in stage.changes() if change.volts], default=0.0)
    seen.check(top < float(stage.law.translation.volts(V)) + 0.002, f"{top:.3f} V, a burst")
    driven = stage.peer.heard("odom")[-1]["x"] - before
    seen.check(driven < 2 * V * (_WATCH + 0.5), f"odometry leapt by {driven:.1f} m")
    seen.note(f"{len(stage.changes())} changes of voltage, none beyond what was asked; odometry +{driven:.2f} m")


def _stands_still(stage: Chain, seen: Seen) -> None:
    stage.drive()
    begin = time.monotonic()
    stage.tick(None)
    since = seen.neutral(stage, begin, stage.guard_values["limits"]["silence"] + SLACK)
    seen.said(stage, "GUARD_TRIPPED: the client is silent")
    stage.tick(stage.clock)
    seen.latched(stage, since)


def _lost(stage: Chain) -> float:
    """Return after how long the chair rests once nobody answers for the master [s]."""
    return _QUESTION * float(stage.values["master_timeout"]) + braking(stage) + SLACK


def _master_dies(stage: Chain, seen: Seen) -> None:
    stage.drive()
    begin = stage.graph.kill_master()
    since = seen.neutral(stage, begin, _lost(stage))
    seen.said(stage, "BASE_MASTER_LOST")
    seen.held(stage, since)
    stage.graph.start_master()
    _ends(stage, seen)
    seen.held(stage, since)
    _supervised(stage, seen)


def _ends(stage: Chain, seen: Seen) -> None:
    """See base_node end, which another master does not know."""
    assert stage.node
    try:
        code = stage.node.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        code = 0
    seen.check(code == 1, "goes on, though nobody finds it")
    seen.said(stage, "BASE_MASTER_FORGOT")


def _supervised(stage: Chain, seen: Seen) -> None:
    """Start everybody that the new master does not know, with the stick held."""
    stage.replace_peer()
    stage.peer.say(V, W)
    begin = time.monotonic()
    stage.start_node()
    stage.peer.wait("voltages", since=begin)
    seen.latched(stage, begin)


def _master_and_commander_die(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.graph.kill_master()
    begin = stage.peer.signal(signal.SIGKILL)
    seen.neutral(stage, begin, timeout(stage) + braking(stage) + SLACK)


def _master_hangs(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.mark()
    stage.graph.master.send_signal(signal.SIGSTOP)
    time.sleep(0.5 * stage.values["master_timeout"])
    stage.graph.master.send_signal(signal.SIGCONT)
    time.sleep(_WATCH)
    seen.undisturbed(stage)
    seen.note("voltages as before")


def _master_hangs_long(stage: Chain, seen: Seen) -> None:
    stage.drive()
    begin = stage.strike(signal.SIGSTOP, stage.graph.master.pid)
    since = seen.neutral(stage, begin, _lost(stage))
    seen.said(stage, "BASE_MASTER_LOST")
    stage.strike(signal.SIGCONT, stage.graph.master.pid)
    stage.status("commands", "not released: navigation")
    seen.latched(stage, since)


def _master_restarts(stage: Chain, seen: Seen) -> None:
    stage.drive()
    begin = stage.graph.kill_master()
    stage.graph.start_master()
    period = stage.values["master_timeout"] * (_QUESTION - 1)
    since = seen.neutral(stage, begin, period + 1.0 + braking(stage) + SLACK)  # 1 s: until a master answers
    _ends(stage, seen)
    seen.held(stage, since)
    _supervised(stage, seen)


_NOTHING = "nothing: the loop runs on a clock that nobody can set; commands run out as before"
_STEPPED = "of base_node and guard, by a preloaded library"
_SIMULATED = Setup(simulated=True)
_BROKEN = Setup(broken=True)
_ANEW = "at rest base_node ends, exit status 1; started anew: neutral until the stick is let go"

CASES = (
    Case("8", "wall clock set", f"{_AHEAD:+.0f} s {_STEPPED}", _NOTHING, _wall_clock(_AHEAD), _BROKEN),
    Case("8", "wall clock set", f"{_BACK:+.0f} s {_STEPPED}", _NOTHING, _wall_clock(_BACK), _BROKEN),
    Case(
        "8",
        "simulated time",
        "reset to 1 s",
        "neutral at once, odometry afresh; neutral until the stick is let go",
        _reset,
        _SIMULATED,
    ),
    Case(
        "8",
        "simulated time",
        f"leaps by {_LEAP:.0f} s",
        "no voltage beyond what is asked; odometry does not leap",
        _leap,
        _SIMULATED,
    ),
    Case(
        "8",
        "simulated time",
        "stands still",
        "neutral after the guard's silence; neutral until the stick is let go",
        _stands_still,
        _SIMULATED,
    ),
    Case(
        "14",
        "roscore dies",
        "SIGKILL; the commander goes on",
        f"brakes after master_timeout; another roscore: {_ANEW}",
        _master_dies,
        last=True,
    ),
    Case(
        "14",
        "roscore and commander die",
        "SIGKILL of both",
        "neutral within the command's timeout + v / deceleration",
        _master_and_commander_die,
        last=True,
    ),
    Case("14", "roscore hangs", "SIGSTOP for half of master_timeout", "nothing", _master_hangs),
    Case(
        "14",
        "roscore hangs",
        "SIGSTOP; SIGCONT when the chair rests",
        "brakes after master_timeout; then neutral until the stick is let go",
        _master_hangs_long,
    ),
    Case(
        "14",
        "roscore is restarted",
        "SIGKILL, and another one at once",
        f"brakes; {_ANEW}",
        _master_restarts,
        last=True,
    ),
)

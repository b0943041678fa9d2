# SPDX-License-Identifier: BSD-3-Clause
"""Faults 1, 2, 7, 9, 11, 12 and 13: what is commanded, by whom, and what odometry makes of it."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable

import numpy as np

from kurumaisu.bench.base_faults_path import distance, rates, samples, sharpest, steepest
from kurumaisu.bench.base_faults_peer import end, until
from kurumaisu.bench.base_faults_seen import Case, Seen, service
from kurumaisu.bench.base_faults_stage import Setup, Stage, V, W
from kurumaisu.types import FloatArray

_SLACK = 0.06  # [s] a tick each of commander and base_node, and the way
_ONCE = 0.06  # [s] likewise, of what acts at once
_WATCHED = 0.3  # [s] timeout of a watched button
_STEPS = ((1.2, 1.9), (-0.5, 2.6), (1.2, 2.6), (0.0, 1.6))  # [m/s], and for how long [s]
_SPAN = 0.1  # [s] over which slopes are taken: the board's codes blur shorter ones
_BLUR = 1.2  # by which they blur those
_CUT = 0.8  # [V] the band of V_f for fault 13
_DRIVEN = 1.0  # [s]


def _timeout(stage: Stage) -> float:
    return float(stage.values["inputs"]["navigation"]["timeout"])


def _limits(stage: Stage) -> dict[str, float]:
    limits: dict[str, float] = stage.values["limits"][stage.values["inputs"]["navigation"]["limits"]]
    return limits


def _braking(stage: Stage) -> float:
    """Return how long the chair brakes from V and W [s]."""
    limits = _limits(stage)
    return max(V / limits["v_deceleration"], W / limits["w_deceleration"])


def _brakes(stage: Stage, seen: Seen, begin: float, after: float) -> float:
    """See the chair brake, on the ramp, once so long [s] has passed since `begin`."""
    since = seen.neutral(stage, begin, after + _braking(stage) + _SLACK)
    slope = steepest(*_ramp(stage, begin), _SPAN)
    seen.check(slope < _BLUR * _limits(stage)["v_deceleration"], f"brakes with {slope:.1f} m/s^2")
    return since


def _ramp(stage: Stage, begin: float) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and speeds [m/s] that the board held, by the time stamps of base_node's ticks."""
    events = stage.peer.heard("voltages", begin)
    return rates(stage.law.translation, [(event["stamp"], event["volts"][0]) for event in events])


def _silent(stage: Stage, seen: Seen) -> None:
    stage.drive()
    before = stage.count("timeouts")
    begin = time.monotonic()
    stage.peer.repeat("cmd_vel", None)
    since = _brakes(stage, seen, begin, _timeout(stage))
    seen.check(since - begin > _timeout(stage) - _SLACK, "stops before the timeout")
    seen.said(stage, "BASE_COMMAND_TIMEOUT")
    seen.check(stage.count("timeouts") == before + 1, "the timeout is not counted")


def _commander_dies(stage: Stage, seen: Seen) -> None:
    stage.drive()
    begin = stage.peer.signal(signal.SIGKILL)
    _brakes(stage, seen, begin, _timeout(stage))
    seen.said(stage, "BASE_COMMAND_TIMEOUT")


def _only_bad(v: float, w: float) -> Callable[[Stage, Seen], None]:
    def play(stage: Stage, seen: Seen) -> None:
        stage.drive()
        before = stage.count("refused commands")
        begin = time.monotonic()
        stage.peer.say(v, w)
        since = _brakes(stage, seen, begin, _timeout(stage))
        seen.said(stage, "BASE_BAD_COMMAND")
        seen.held(stage, since)
        seen.check(stage.count("refused commands") > before, "not counted")

    return play


def _bad_among_good(stage: Stage, seen: Seen) -> None:
    stage.drive()
    before = stage.count("refused commands")
    stage.mark()
    bad = [(math.nan, W), (V, math.inf), (-math.inf, W), (1e308, W), (V, -1e308), (10.1, 0.0)]
    for v, w in bad:
        stage.peer.order(do="once", topic="cmd_vel", value=[v, w])
    counted = lambda: stage.count("refused commands") - before  # noqa: E731
    until(lambda: counted() >= len(bad), "refused commands on diagnostics", 5.0)
    seen.check(counted() == len(bad), f"{counted()} refused, not {len(bad)}")
    seen.undisturbed(stage)
    seen.note(f"{len(bad)} refused and counted, voltages as before")


def _too_fast(stage: Stage, seen: Seen) -> None:
    stage.drive(V, 0.0)
    before = stage.count("clamped commands")
    stage.peer.say(5.0, 0.0)
    top = _limits(stage)["v_forward"]
    until(lambda: stage.has(top, 0.0), f"{top} m/s")
    _, speeds = rates(stage.law.translation, samples(stage.changes()))
    seen.check(float(np.max(speeds)) < top + 0.002, f"{np.max(speeds):.3f} m/s")
    seen.check(stage.count("clamped commands") > before, "not counted")
    seen.note(f"{top} m/s, counted")


def _two_publishers(stage: Stage, seen: Seen) -> None:
    stage.drive()
    before = stage.count("conflicts")
    other = stage.another_peer()
    stage.mark()
    other.say(V, W)
    seen.said(stage, "BASE_SEVERAL_PUBLISHERS")
    since = _brakes(stage, seen, stage.changes()[0].time, 0.0)
    seen.check(not stage.moved(since), "moves while both command")
    seen.check(stage.count("conflicts") == before + 1, "not counted")
    end(other.process)
    until(lambda: stage.has(V, W), "the first one is obeyed again")
    seen.note("counted; one gone: the other is obeyed")


def _at_once(stage: Stage, seen: Seen, begin: float, bound: float) -> float:
    """See neutral come without a ramp."""
    since = seen.neutral(stage, begin, bound)
    moving = [change for change in stage.changes(begin) if change.neutral is False]
    seen.check(len(moving) < 2, f"{len(moving)} voltages in between")  # V_f is written before V_s
    return since


def _released(stage: Stage, seen: Seen) -> None:
    """See that an emergency stop can be reset only once the stick is let go."""
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while somebody commands motion")
    seen.note(f"~reset refused: {answer['message']}")
    stage.peer.say(0.0, 0.0)
    until(lambda: stage.peer.call(service("reset"))["success"], "a reset")
    seen.again(stage)


def _button_silent(stage: Stage, seen: Seen) -> None:
    stage.peer.repeat("e_stop", False)
    stage.drive()
    begin = time.monotonic()
    stage.peer.repeat("e_stop", None)
    since = _at_once(stage, seen, begin, _WATCHED + _SLACK)
    seen.said(stage, "BASE_EMERGENCY_STOP")
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while nobody watches")
    stage.peer.repeat("e_stop", False)  # it speaks again
    seen.held(stage, since)
    _released(stage, seen)


def _button_pressed(stage: Stage, seen: Seen) -> None:
    stage.peer.repeat("e_stop", False)
    stage.drive()
    begin = time.monotonic()
    stage.peer.repeat("e_stop", True)
    since = _at_once(stage, seen, begin, _ONCE)
    seen.held(stage, since)
    answer = stage.peer.call(service("reset"))
    seen.check(not answer["success"], "reset while it is pressed")
    stage.peer.repeat("e_stop", False)
    seen.held(stage, since)
    _released(stage, seen)


def _never_watched(stage: Stage, seen: Seen) -> None:
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


def _dead_man(stage: Stage, seen: Seen) -> None:
    stage.peer.repeat("passenger_holds", True)
    stage.drive()
    begin = time.monotonic()
    stage.peer.repeat("passenger_holds", None)
    _brakes(stage, seen, begin, _WATCHED)
    seen.said(stage, "BASE_LOCKED: passenger")
    stage.peer.repeat("passenger_holds", True)
    until(lambda: stage.has(V, W), "it goes on")
    seen.note("held again: goes on")


def _held_from_the_start(stage: Stage, seen: Seen) -> None:
    stage.peer.say(V, W)
    begin = time.monotonic()
    stage.start_node()
    stage.peer.wait("voltages", since=begin)
    seen.said(stage, "BASE_NOT_RELEASED: navigation")
    seen.held(stage, begin)
    seen.held(stage, begin)
    seen.note("neutral")
    seen.again(stage)


def _heard_late(stage: Stage, seen: Seen) -> None:
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


def _bounds(stage: Stage, seen: Seen) -> None:
    stage.drive(V, 0.0)
    for v, seconds in _STEPS:
        stage.peer.say(v, 0.0)
        time.sleep(seconds)
    times, speeds = _ramp(stage, stage.begun)
    slope, jerk = steepest(times, speeds, _SPAN), sharpest(times, speeds, _SPAN)
    limits = _limits(stage)
    seen.check(slope < _BLUR * limits["v_deceleration"], f"{slope:.2f} m/s^2")
    seen.check(jerk < _BLUR * limits["v_jerk"], f"{jerk:.1f} m/s^3")
    top = _STEPS[0][0]
    seen.check(float(np.max(np.abs(speeds))) < top + 0.002, f"{np.max(np.abs(speeds)):.3f} m/s, beyond what was asked")
    seen.note(f"{len(times)} samples, at most {slope:.2f} m/s^2, {jerk:.1f} m/s^3 over {1e3 * _SPAN:.0f} ms, no overshoot")


def _clamp_active(stage: Stage, seen: Seen) -> None:
    stage.drive(0.3, 0.0)
    begin = time.monotonic()
    stage.peer.say(1.0, 0.0)
    until(lambda: (stage.changes()[-1].volts or (0.0,))[0] > _CUT - 0.002, f"{_CUT} V")
    time.sleep(_DRIVEN)
    _compare(stage, seen, begin)
    volts = max(change.volts[0] for change in stage.changes() if change.volts)
    seen.check(volts < _CUT + 0.001, f"{volts:.3f} V")
    seen.check(stage.count("samples cut by the band", "voltage law") > 0, "not counted")
    seen.note(f"V_f at most {volts:.3f} V, counted")


def _compare(stage: Stage, seen: Seen, begin: float) -> None:
    """Compare odometry with the board, from the last rest before `begin` to a rest that is brought about now."""
    stage.peer.say(0.0, 0.0)
    stage.neutral()
    last = stage.peer.wait("odom", lambda event: event["v"] == 0.0, time.monotonic())
    first = next(event for event in stage.peer.heard("odom", stage.begun) if event["v"] != 0.0)
    measured = distance(stage.law.translation, stage.changes(), time.monotonic())
    told = math.hypot(last["x"] - first["x"], last["y"] - first["y"])
    seen.check(abs(told - measured) < 0.01 + 0.01 * measured, f"odometry {told:.3f} m, the board {measured:.3f} m")
    seen.note(f"odometry {told:.3f} m, by the board's volts {measured:.3f} m")


def _hang(seconds: float) -> Callable[[Stage, Seen], None]:
    def play(stage: Stage, seen: Seen) -> None:
        stage.drive(V, 0.0)
        late, begin = stage.count("late ticks"), stage.strike(signal.SIGSTOP)
        time.sleep(seconds)
        stage.strike(signal.SIGCONT)
        stage.peer.wait("voltages", since=time.monotonic() + stage.period)
        seen.check(stage.count("late ticks") > late, "the late tick is not counted")
        _compare(stage, seen, begin)

    return play


def _reset_while_moving(stage: Stage, seen: Seen) -> None:
    stage.drive(V, 0.0)
    stage.mark()
    before = stage.peer.heard("odom")[-1]["x"]
    stage.peer.call(service("reset_odometry"))
    after = stage.peer.wait("odom", lambda event: event["x"] < before, stage.begun)
    seen.check(abs(after["v"] - V) < 0.002, f"odometry tells {after['v']:.3f} m/s")
    seen.check(0 <= after["x"] < 0.05, f"x is {after['x']:.3f} m")
    seen.undisturbed(stage)
    seen.note(f"x from {before:.2f} m to {after['x']:.2f} m, speed and voltages as before")


_COUNTED = "refused, counted; as if nothing was said: brakes"
_OPEN_LOOP = "odometry within 1 % of what the board's volts stand for"
_RESET = "~reset refused until it is released and the stick let go"
_STOP = Setup(node={"estop/timeout": _WATCHED})

CASES = (
    Case("1", "no commands", "the commander falls silent", "neutral, by the ramp, within timeout + v / deceleration", _silent),
    Case("1", "no commands", "SIGKILL of the commander", "the same", _commander_dies, last=True),
    Case("2", "bad commands", "NaN only", _COUNTED, _only_bad(math.nan, 0.0)),
    Case("2", "bad commands", "inf only", _COUNTED, _only_bad(V, math.inf)),
    Case("2", "bad commands", "1e308 only", _COUNTED, _only_bad(1e308, 0.0)),
    Case("2", "bad commands", "NaN, inf, 1e308, absurd ones among good ones", "refused, counted; drives on", _bad_among_good),
    Case("2", "bad commands", "5 m/s", "clamped to the limit, counted", _too_fast),
    Case("7", "two publishers on an input", "a second commander", "brakes, by the ramp, until one is left", _two_publishers),
    Case("9", "emergency stop", "its topic falls silent", f"neutral at once after its timeout; {_RESET}", _button_silent, _STOP),
    Case("9", "emergency stop", "pressed", f"neutral at once; {_RESET}", _button_pressed, _STOP),
    Case("9", "emergency stop", "its topic silent from the start", f"neutral, latched; {_RESET}", _never_watched, _STOP),
    Case(
        "9",
        "dead-man",
        "its topic falls silent",
        "brakes after its timeout; held again: goes on",
        _dead_man,
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
    Case("12", "steps and reversals", "of 1.7 m/s", "slopes and jerks within the limits", _bounds),
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
    Case("13", "odometry: reset", "~reset_odometry while moving", "from 0; speed and voltages as before", _reset_while_moving),
)

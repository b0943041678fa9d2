# SPDX-License-Identifier: BSD-3-Clause
"""Faults 5 and 17: the D/A board, its wire, and its reference."""

from __future__ import annotations

import time
from collections.abc import Callable

from kurumaisu.bench.faults.base.cases import Case, Seen, trips
from kurumaisu.bench.faults.base.chain import BrokenCalls, Chain, Setup, V, W
from kurumaisu.bench.faults.base.peers import until

_SLACK = 0.03  # [s] of two writes and the scheduler, beyond what the board's and the guard's settings allow
AWAY = 0.4  # [s] that something is unplugged, or stuck
_BACK = 0.2  # [s] to open a board again, and to write neutral
_MANY = 16  # commands that meet a fault: it lasts for some attempts to recover


def _noticed(stage: Chain) -> float:
    """Return how long the guard takes at most to find out that replies fail [s]."""
    device = stage.device_values
    asking = (1 + int(device["retries"])) * float(device["reply_timeout"])
    return float(stage.guard_values["period"]) + asking + _SLACK


def _reopened(stage: Chain) -> float:
    return float(stage.guard_values["reopening"]["longest"]) + _BACK


def _answers_badly(fault: str, code: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        since = seen.neutral(stage, stage.inject(fault), _noticed(stage))
        seen.said(stage, "GUARD_TRIPPED: the D/A converter failed", code)
        seen.latched(stage, since)

    return play


def _hears_nothing(fault: str, code: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        begin = stage.inject(fault)
        stage.wait_said(code)
        since = stage.neutral()
        seen.within("neutral", since - begin, 2.0)
        seen.no_burst(stage, begin)
        seen.said(stage, "GUARD_TRIPPED: the D/A converter failed", code)
        seen.latched(stage, since)

    return play


def _once(fault: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        before = trips(stage)
        stage.mark()
        stage.inject(fault)
        time.sleep(AWAY)
        seen.undisturbed(stage)
        seen.check(trips(stage) == before, "the guard tripped")
        seen.note("voltages as before, no trip")

    return play


def unplugged(stage: Chain, seen: Seen) -> None:
    """Take the device away for a while."""
    stage.drive()
    begin = stage.inject(f"unplug={AWAY}")
    stage.status("guard", "the D/A converter is lost")
    plugged = until(lambda: [c.time for c in stage.changes(begin) if c.volts is None], "the board is back")[0]
    since = stage.neutral()
    seen.within("it is back, neutral", since - plugged, _reopened(stage))
    seen.check(not [c for c in stage.changes(plugged) if c.neutral is False][1:], "moved on its return")
    seen.said(stage, "GUARD_DEVICE_FAULT: DAC_CLOSED", "GUARD_TRIPPED: the D/A converter failed")
    seen.latched(stage, since)


def _writes_half(stage: Chain, seen: Seen) -> None:
    assert stage.calls
    stage.calls.break_writes(BrokenCalls.HALF)
    stage.drive()
    before, broken = trips(stage), stage.calls.broken()
    stage.mark()
    stage.drive(0.3, -0.2)
    stage.calls.break_writes(BrokenCalls.WHOLE)
    seen.check(trips(stage) == before, "the guard tripped")
    seen.check(stage.calls.broken() - broken > 100, f"only {stage.calls.broken() - broken} were broken")
    seen.note(f"{stage.calls.broken() - broken} short ones, no trip, the voltages arrive")


def _write_fails(how: int, code: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        assert stage.calls
        stage.drive()
        stage.calls.break_writes(how)
        stage.wait_said("GUARD_TRIPPED")
        time.sleep(AWAY)
        begin = time.monotonic()
        stage.calls.break_writes(BrokenCalls.WHOLE)
        since = stage.neutral()
        seen.within("writes work again, neutral", max(0.0, since - begin), _reopened(stage))
        seen.said(stage, f"GUARD_DEVICE_FAULT: {code}", "GUARD_TRIPPED: the D/A converter failed")
        seen.latched(stage, since)

    return play


def _reference_lost(stage: Chain, seen: Seen) -> None:
    """Whatever is left of the joystick's plug: V_f and V_s go to where the reference was."""
    stage.drive()
    begin = stage.inject(f"lost/referencex{_MANY}")
    code = 1.5 * stage.rig.step

    def stopped() -> list[float]:
        found = [c for c in stage.changes(begin) if c.volts]
        return [
            c.time
            for c in found
            if c.volts and max(abs(c.volts[i] + c.volts[2] - stage.law.reference_voltage) for i in (0, 1)) < code
        ]

    seen.within(
        "V_f and V_s at the neutral pin voltage", until(stopped, "the pins at neutral")[0] - begin, _noticed(stage)
    )
    seen.said(stage, "GUARD_TRIPPED: the D/A converter failed", "DAC_WRONG_REPLY")
    since = stage.neutral()
    seen.latched(stage, since)


def _other_reference(stage: Chain, seen: Seen) -> None:
    said = stage.rig.messages.read_text()
    seen.check("the reference is held at" in said, said)
    stage.peer.say(0.0, 0.0)
    stage.start_node()
    stage.status("guard", "the D/A converter is lost")
    time.sleep(1.0)
    stage.peer.say(V, W)
    seen.held(stage, stage.begun)
    seen.check(not stage.is_armed(), "armed")
    seen.note("never armed; diagnostics: the D/A converter is lost")


LATCHED = "the guard trips and stays neutral until the stick is let go"
_OBEYS = f"neutral within a period and all retries + 30 ms; {LATCHED}"
RETURN = f"neutral is the first thing that it gets; {LATCHED}"
_BROKEN = Setup(broken=True)

CASES = (
    Case("5", "board: no reply", "once", "made good by the retry: drives on", _once("silent")),
    Case(
        "5",
        "board: no reply",
        f"to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"silentx{_MANY}", "DAC_NO_REPLY"),
        repeated=True,
    ),
    Case(
        "5",
        "board: wrong reply",
        f"to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"wrongx{_MANY}", "DAC_WRONG_REPLY"),
        repeated=True,
    ),
    Case(
        "5",
        "board: half a reply",
        f"to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"cutx{_MANY}", "DAC_NO_REPLY"),
        repeated=True,
    ),
    Case("5", "board: late reply", "by 0.03 s, once", "waited for: drives on", _once("late=0.03")),
    Case(
        "5",
        "board: late reply",
        f"by 0.12 s, to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"latex{_MANY}=0.12", "DAC_NO_REPLY"),
        repeated=True,
    ),
    Case(
        "5",
        "board: deaf",
        f"to {_MANY} commands",
        f"held; when it hears again, {RETURN}",
        _hears_nothing(f"deafx{_MANY}", "DAC_NO_REPLY"),
    ),
    Case(
        "5",
        "board: stalled",
        f"reads nothing for {AWAY:g} s",
        f"held; when it reads again, {RETURN}",
        _hears_nothing(f"stall={AWAY}", "DAC_NO_REPLY"),
    ),
    Case("5", "board: unplugged", f"for {AWAY:g} s", f"held; back, {RETURN}", unplugged, repeated=True),
    Case("5", "wire: short writes", "half of every write()", "the rest is sent, too: drives on", _writes_half, _BROKEN),
    Case(
        "5",
        "wire: blocked",
        "write() takes half, then EAGAIN",
        f"held; back, {RETURN}",
        _write_fails(BrokenCalls.STUCK, "DAC_BLOCKED"),
        _BROKEN,
    ),
    Case(
        "5",
        "wire: EIO",
        "of every write()",
        f"held; back, {RETURN}",
        _write_fails(BrokenCalls.ERROR, "DAC_CLOSED"),
        _BROKEN,
    ),
    Case(
        "17",
        "reference: lost",
        f"its output at 0 V for {_MANY} commands, the reply says so",
        f"V_f and V_s neutral at the pin; {LATCHED}",
        _reference_lost,
        clamped=False,
    ),
    Case(
        "17",
        "reference: wrong reply",
        f"to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"wrong/referencex{_MANY}", "DAC_WRONG_REPLY"),
    ),
    Case(
        "17",
        "reference: no reply",
        f"to {_MANY} commands",
        _OBEYS,
        _answers_badly(f"silent/referencex{_MANY}", "DAC_NO_REPLY"),
    ),
    Case(
        "17",
        "reference: held elsewhere",
        "its clamp is 2.55 to 2.6 V",
        "neutral, never armed",
        _other_reference,
        Setup(device={"channels/reference/volt/min": 2.55}),
    ),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Faults 1, 2, 7 and 12: what is commanded, and by whom."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable

import numpy as np

from kurumaisu.bench.faults.base.braking import BLUR, SLACK, SPAN, brakes, limits_of, ramp, timeout
from kurumaisu.bench.faults.base.cases import Case, Seen
from kurumaisu.bench.faults.base.chain import Chain, V, W
from kurumaisu.bench.faults.base.path import rates, samples, sharpest, steepest
from kurumaisu.bench.faults.base.peers import end, until

_STEPS = ((1.2, 1.9), (-0.5, 2.6), (1.2, 2.6), (0.0, 1.6))  # [m/s], and for how long [s]


def _silent(stage: Chain, seen: Seen) -> None:
    stage.drive()
    before = stage.count("timeouts")
    begin = time.monotonic()
    stage.peer.repeat("cmd_vel", None)
    since = brakes(stage, seen, begin, timeout(stage))
    seen.check(since - begin > timeout(stage) - SLACK, "stops before the timeout")
    seen.said(stage, "BASE_COMMAND_TIMEOUT")
    seen.check(stage.count("timeouts") == before + 1, "the timeout is not counted")


def _commander_dies(stage: Chain, seen: Seen) -> None:
    stage.drive()
    commander, stage.peer = stage.peer, stage.another_peer()
    begin = commander.signal(signal.SIGKILL)
    brakes(stage, seen, begin, timeout(stage))
    seen.said(stage, "BASE_COMMAND_TIMEOUT")


def _only_bad(v: float, w: float) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.drive()
        before = stage.count("refused commands")
        begin = time.monotonic()
        stage.peer.say(v, w)
        since = brakes(stage, seen, begin, timeout(stage))
        seen.said(stage, "BASE_BAD_COMMAND")
        seen.held(stage, since)
        seen.check(stage.count("refused commands") > before, "not counted")

    return play


def _bad_among_good(stage: Chain, seen: Seen) -> None:
    stage.drive()
    before = stage.count("refused commands")
    stage.mark()
    bad = [(math.nan, W), (V, math.inf), (-math.inf, W), (1e308, W), (V, -1e308), (10.1, 0.0)]
    for v, w in bad:
        stage.peer.order(do="burst", topic="cmd_vel", values=[[v, w]])

    def counted() -> int:
        return stage.count("refused commands") - before

    until(lambda: counted() >= len(bad), "refused commands on diagnostics", 5.0)
    seen.check(counted() == len(bad), f"{counted()} refused, not {len(bad)}")
    seen.undisturbed(stage)
    seen.note(f"{len(bad)} refused and counted, voltages as before")


def _too_fast(stage: Chain, seen: Seen) -> None:
    stage.drive(V, 0.0)
    before = stage.count("clamped commands")
    stage.peer.say(5.0, 0.0)
    top = limits_of(stage)["v_forward"]
    until(lambda: stage.has(top, 0.0), f"{top} m/s")
    _, speeds = rates(stage.law.translation, samples(stage.changes()))
    seen.check(float(np.max(speeds)) < top + 0.002, f"{np.max(speeds):.3f} m/s")
    seen.check(stage.count("clamped commands") > before, "not counted")
    seen.note(f"{top} m/s, counted")


def _two_publishers(stage: Chain, seen: Seen) -> None:
    stage.drive()
    before = stage.count("conflicts")
    other = stage.another_peer()
    stage.mark()
    other.say(V, W)
    seen.said(stage, "BASE_SEVERAL_PUBLISHERS")
    since = brakes(stage, seen, stage.changes()[0].time, 0.0)
    seen.check(not stage.moved(since), "moves while both command")
    seen.check(stage.count("conflicts") == before + 1, "not counted")
    end(other.process)
    until(lambda: stage.has(V, W), "the first one is obeyed again")
    seen.note("counted; one gone: the other is obeyed")


def _bounds(stage: Chain, seen: Seen) -> None:
    stage.drive(V, 0.0)
    for v, seconds in _STEPS:
        stage.peer.say(v, 0.0)
        time.sleep(seconds)
    times, speeds = ramp(stage, stage.begun)
    slope, jerk = steepest(times, speeds, SPAN), sharpest(times, speeds, SPAN)
    limits = limits_of(stage)
    seen.check(slope < BLUR * limits["v_deceleration"], f"{slope:.2f} m/s^2")
    seen.check(jerk < BLUR * limits["v_jerk"], f"{jerk:.1f} m/s^3")
    top = _STEPS[0][0]
    seen.check(float(np.max(np.abs(speeds))) < top + 0.002, f"{np.max(np.abs(speeds)):.3f} m/s, beyond what was asked")
    seen.note(
        f"{len(times)} samples, at most {slope:.2f} m/s^2, {jerk:.1f} m/s^3 over {1e3 * SPAN:.0f} ms, no overshoot"
    )


_COUNTED = "refused, counted; as if nothing was said: brakes"

CASES = (
    Case(
        "1",
        "no commands",
        "the commander falls silent",
        "neutral, by the ramp, within timeout + v / deceleration",
        _silent,
    ),
    Case("1", "no commands", "SIGKILL of the commander", "the same", _commander_dies),
    Case("2", "bad commands", "NaN only", _COUNTED, _only_bad(math.nan, 0.0)),
    Case("2", "bad commands", "inf only", _COUNTED, _only_bad(V, math.inf)),
    Case("2", "bad commands", "1e308 only", _COUNTED, _only_bad(1e308, 0.0)),
    Case(
        "2",
        "bad commands",
        "NaN, inf, 1e308, absurd ones among good ones",
        "refused, counted; drives on",
        _bad_among_good,
    ),
    Case("2", "bad commands", "5 m/s", "clamped to the limit, counted", _too_fast),
    Case(
        "7",
        "two publishers on an input",
        "a second commander",
        "brakes, by the ramp, until one is left",
        _two_publishers,
    ),
    Case("12", "steps and reversals", "of 1.7 m/s", "slopes and jerks within the limits", _bounds),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Fault 10, and garbage on the parameter server: a calibration that cannot be right, settings that make no sense."""

from __future__ import annotations

import math
import random
import subprocess
import time
import xmlrpc.client
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from kurumaisu.bench.faults.base.cases import Case, Seen, service
from kurumaisu.bench.faults.base.chain import NODE, Chain, V, W
from kurumaisu.bench.faults.base.peers import end
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.errors import Error

_ALIVE = 1.0  # [s] after which a base_node has started
_TRIALS = 12  # of garbage at the start
_SEED = 1
_WATCH = 0.6  # [s]
_RESET = "\x1b[0m"  # the log's colours
_STEERING = "model/voltage_laws/corrected/steering"
_GARBAGE: tuple[Any, ...] = (
    "",
    "nan",
    "1e999",
    "\N{SNOWMAN}",
    -1,
    0,
    2**31 - 1,
    1e308,
    -1e308,
    math.nan,
    math.inf,
    True,
    [],
    [1, "a"],
    {},
    {"a": 1},
)


def _start(stage: Chain, changes: Mapping[str, Any]) -> tuple[int | None, str]:
    """Start base_node with the stick held; return its exit status, None if it went on, and what it said."""
    stage.peer.say(V, W)
    stage.mark()
    process = stage.start_node(changes)
    try:
        code: int | None = process.wait(_ALIVE)
    except subprocess.TimeoutExpired:
        code = None
        end(process)
    return code, stage.said()


def _refused(changes: Mapping[str, Any], key: str) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        code, said = _start(stage, changes)
        seen.check(code == 1, f"exit status {code}")
        line = next((line for line in said.splitlines() if f"{NODE}/{key}" in line), "")
        seen.check(bool(line), f"does not name {key}: {said}")
        seen.check(not stage.moved(0.0, 0.0), "moved")
        seen.note(f"exit status {code}: {line[line.find(NODE) + len(NODE) + 1 :].removesuffix(_RESET)}")

    return play


def _paths(tree: Mapping[str, Any], above: str = "") -> Iterator[str]:
    for key, value in tree.items():
        yield f"{above}{key}"
        if isinstance(value, dict):
            yield from _paths(value, f"{above}{key}/")


def _garbage(stage: Chain, seen: Seen) -> None:
    dice = random.Random(_SEED)
    paths = sorted(path for path in _paths(stage.values) if path != "effects")
    begun = 0
    for trial in range(_TRIALS):
        path, value = dice.choice(paths), dice.choice(_GARBAGE)
        if trial == 0:
            path, value = "unheard_of", 1
        code, said = _start(stage, {path: value})
        seen.check(code in (1, None), f"{path}: {value!r}: exit status {code}")
        seen.check(code is None or "FATAL" in said, f"{path}: {value!r}: says nothing")
        seen.check(not stage.moved(0.0, 0.0), f"{path}: {value!r}: moved")
        begun += code is None
    seen.note(f"{_TRIALS - begun} refused, {begun} harmless, with the stick held: neutral")


def _no_tree(value: Any) -> Callable[[Chain, Seen], None]:
    def play(stage: Chain, seen: Seen) -> None:
        stage.graph.set_parameter(NODE, value)
        process = stage.graph.run([program("base_node")], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
        _, said = process.communicate(timeout=PATIENCE)
        seen.check(process.returncode == 1, f"exit status {process.returncode}")
        seen.check(NODE in said, said)
        seen.note(f"exit status 1: {said[said.find(NODE) :].splitlines()[0].removesuffix(_RESET)}")

    return play


def _while_driving(stage: Chain, seen: Seen) -> None:
    stage.drive()
    stage.mark()
    for path, value in (("limits/ride/v_forward", "fast"), ("rate", -1.0), ("guard/socket", 7), ("inputs", "none")):
        stage.graph.set_parameter(f"{NODE}/{path}", value)
    stage.graph.delete_parameter(NODE)
    stage.graph.set_parameter(NODE, "gone")
    stage.graph.set_parameter("/use_sim_time", "perhaps")
    try:
        time.sleep(_WATCH)
        seen.undisturbed(stage)
        seen.note("voltages as before")
    finally:
        stage.graph.set_parameter("/use_sim_time", False)


def _reconfigured(stage: Chain, seen: Seen) -> None:
    stage.drive()
    limits = stage.values["limits"]["ride"]
    stage.mark()
    for value in (math.nan, math.inf, -math.inf):
        begin = time.monotonic()
        stage.peer.order(do="limits", name=service("limits/ride"), values={"v_forward": value})
        answer = stage.peer.wait("limits", since=begin)["values"]["v_forward"]
        lowest_or_same = value < 0 or answer == limits["v_forward"]
        seen.check(math.isfinite(answer) and lowest_or_same, f"{value} became {answer}")
        stage.peer.order(do="limits", name=service("limits/ride"), values={"v_forward": limits["v_forward"]})
    time.sleep(_WATCH)
    volts = [abs(change.volts[0]) for change in stage.changes() if change.volts]
    seen.check(max(volts, default=0.0) <= float(stage.law.translation.volts(V)) + 0.002, "a burst")
    seen.note("none of them holds")


def _master_nonsense(stage: Chain, seen: Seen) -> None:
    """A parameter that XML-RPC can carry, and roscpp cannot read as a number."""
    try:
        code, said = _start(stage, {"rate": xmlrpc.client.Binary(b"\xff\x00")})
    except xmlrpc.client.Fault as fault:
        raise Error(str(fault)) from fault
    seen.check(code == 1, f"exit status {code}")
    seen.check(f"{NODE}/rate" in said, said)
    seen.note("refused, names the key")


_START = "refused at the start, names the key; neutral"
_OVERLAP = {f"{_STEERING}/positive/intercept": 0.104181, f"{_STEERING}/negative/intercept": -0.169476}

CASES = (
    Case("10", "calibration: not monotonic", "branches that overlap", _START, _refused(_OVERLAP, _STEERING)),
    Case(
        "10",
        "calibration: not monotonic",
        "branches of opposite slopes",
        _START,
        _refused({f"{_STEERING}/positive/slope": 0.5}, _STEERING),
    ),
    Case(
        "10",
        "calibration: gap",
        "the band ends before the law begins",
        _START,
        _refused({"model/voltages/translation/max": 0.1}, "model/voltages/translation"),
    ),
    Case(
        "10",
        "calibration: neutral outside its band",
        "V_s from 0.1 V",
        _START,
        _refused({"model/voltages/steering/min": 0.1}, "model/voltages/steering"),
    ),
    Case(
        "10",
        "calibration: reference outside its band",
        "7 V",
        _START,
        _refused({"model/reference_voltage": 7.0}, "model/voltages/reference"),
    ),
    Case(
        "10",
        "calibration: not a number",
        "slope NaN",
        _START,
        _refused({f"{_STEERING}/positive/slope": math.nan}, f"{_STEERING}/positive/slope"),
    ),
    Case(
        "-",
        "parameter server: garbage",
        f"{_TRIALS} keys at random (seed {_SEED})",
        "refused with a message, or harmless; neutral",
        _garbage,
    ),
    Case("-", "parameter server: garbage", "bytes in place of a number", _START, _master_nonsense),
    Case("-", "parameter server: garbage", "a text in place of all", _START, _no_tree("garbage")),
    Case(
        "-",
        "parameter server: garbage",
        "overwritten, then deleted while driving",
        "nothing: parameters are read at the start",
        _while_driving,
    ),
    Case(
        "-",
        "dynamic_reconfigure: garbage",
        "limits of NaN, inf, -inf",
        "set back, or to the lowest that is allowed; no burst",
        _reconfigured,
    ),
)

# SPDX-License-Identifier: BSD-3-Clause
"""What base_node's limits promise, and whether the chair kept to them."""

from __future__ import annotations

from kurumaisu.bench.faults.base.cases import Seen
from kurumaisu.bench.faults.base.chain import Chain, V, W
from kurumaisu.bench.faults.base.path import rates, steepest
from kurumaisu.types import FloatArray

SLACK = 0.06  # [s] a tick each of commander and base_node, and the way
SPAN = 0.1  # [s] over which slopes are taken: the board's codes blur shorter ones
BLUR = 1.5  # by which codes, and answers of the guard that come late on a busy machine, blur those


def timeout(stage: Chain) -> float:
    """Return after how long a silent commander is none [s]."""
    return float(stage.values["inputs"]["navigation"]["timeout"])


def limits_of(stage: Chain) -> dict[str, float]:
    """Return the set of limits in force."""
    limits: dict[str, float] = stage.values["limits"][stage.values["inputs"]["navigation"]["limits"]]
    return limits


def braking(stage: Chain) -> float:
    """Return how long the chair brakes from V and W [s]."""
    limits = limits_of(stage)
    return max(V / limits["v_deceleration"], W / limits["w_deceleration"])


def ramp(stage: Chain, begin: float) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and speeds [m/s] that the board held, by the time stamps of base_node's ticks."""
    events = stage.peer.heard("voltages", begin)
    return rates(stage.law.translation, [(event["stamp"], event["volts"][0]) for event in events])


def brakes(stage: Chain, seen: Seen, begin: float, after: float) -> float:
    """See the chair brake, on the ramp, once so long [s] has passed since `begin`."""
    since = seen.neutral(stage, begin, after + braking(stage) + SLACK)
    slope = steepest(*ramp(stage, begin), SPAN)
    seen.check(slope < BLUR * limits_of(stage)["v_deceleration"], f"brakes with {slope:.1f} m/s^2")
    return since

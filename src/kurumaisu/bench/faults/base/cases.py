# SPDX-License-Identifier: BSD-3-Clause
"""A fault of the base, what is expected of the chain, and what was seen of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from kurumaisu.bench.faults.base.chain import NODE, Chain, Setup
from kurumaisu.bench.guard_rig import Change
from kurumaisu.errors import Error

_SETTLED = 0.05  # [s] after the first neutral; a burst of commands on the wire may end in between
_CODE = 0.002  # [V] more than a code of the board
_LATE = "LATE"
OK = "ok"


class Seen:
    """What a case saw. Repetitions add to it."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.wrong: list[str] = []
        self.late: list[str] = []
        self._notes: list[str] = []
        self._times: dict[str, list[float]] = {}

    def within(self, what: str, seconds: float, bound: float) -> None:
        """Note a time [s], that must not be above a bound; nan: it never came."""
        self._times.setdefault(what, []).append(seconds)
        if math.isnan(seconds):
            self.check(False, f"never {what}")
        elif seconds > bound:
            self._add(self.late, f"{what} after {1e3 * seconds:.0f} ms, bound {1e3 * bound:.0f}")

    def check(self, so: bool, otherwise: str) -> None:
        """Note what is wrong unless it is so."""
        if not so:
            self._add(self.wrong, otherwise)

    def note(self, words: str) -> None:
        """Note something for the reader."""
        self._add(self._notes, words)

    @staticmethod
    def _add(to: list[str], words: str) -> None:
        if words not in to:
            to.append(words)

    def neutral(self, stage: Chain, begin: float, bound: float) -> float:
        """Wait for neutral, which must come so soon [s] after `begin`; return when it came [s, monotonic]."""
        since = stage.neutral()
        self.within("neutral", since - begin, bound)
        return since

    def held(self, stage: Chain, since: float) -> None:
        """See that a stick that is still held moves nothing."""
        self.check(not stage.moved(since + _SETTLED), "moved while the stick was held")

    def latched(self, stage: Chain, since: float) -> None:
        """See that a stick that is still held moves nothing, and one that is let go and moved again does."""
        self.held(stage, since)
        self.again(stage)

    def again(self, stage: Chain) -> None:
        """See that the chair drives once the stick was let go."""
        trips = stage.drive()
        self.note("let go: drives again" + (f", tripped {trips} times more" if trips else ""))

    def said(self, stage: Chain, *words: str) -> None:
        """See that base_node or guard says so, soon."""
        for each in words:
            try:
                stage.wait_said(each, 3.0)
            except Error:
                self.check(False, f"did not say {each!r}")
        self.note("; ".join(words))

    def undisturbed(self, stage: Chain) -> None:
        """See that the board's voltages did not change since the mark."""
        self.check(not stage.changes(), f"{len(stage.changes())} changes of voltage")

    def no_burst(self, stage: Chain, since: float) -> None:
        """See that V_f and V_s went nowhere but towards neutral since then [s, monotonic]."""
        before = next(c.volts for c in reversed(stage.rig.changes()) if c.volts and c.time < since)
        for change in stage.changes(since):
            for was, now in zip(before[:2], change.volts or (0.0, 0.0), strict=False):
                less = abs(now) <= abs(was) + _CODE and was * now >= 0
                self.check(less, f"{now:.3f} V after {was:.3f} V")

    def clamped(self, stage: Chain) -> None:
        """See that no voltage since the mark left the device's clamp, or the model's band."""
        for change in stage.changes():
            for name, low, high in bands(stage):
                self.check(_within(change, name, low, high), f"{name} outside its clamp: {change.volts}")

    def cell(self) -> str:
        """Return all of it in words."""
        times = [f"{what} after {_span(values)} ms" for what, values in self._times.items()]
        return "; ".join([*times, *self._notes])

    def verdict(self) -> str:
        """Return `ok`, or what is late, or wrong."""
        words = [f"WRONG: {'; '.join(self.wrong)}"] if self.wrong else []
        words += [f"{_LATE}: {'; '.join(self.late)}"] if self.late else []
        return "; ".join(words) or OK


def _span(values: Sequence[float]) -> str:
    low, high = 1e3 * min(values), 1e3 * max(values)
    digits = 1 if high < 20 else 0
    return f"{low:.{digits}f}" if len(values) == 1 else f"{low:.{digits}f} to {high:.{digits}f}"


def bands(stage: Chain) -> list[tuple[str, float, float]]:
    """Return the names and limits [V] of what the board may put out, a code's rounding included."""
    model, device = stage.law.voltages, stage.device_values["channels"]
    code = stage.rig.step
    found = []
    for name, band in (("translation", model.translation), ("steering", model.steering)):
        volt = device[name]["volt"]
        found.append((name, max(band.min, volt["min"]) - code, min(band.max, volt["max"]) + code))
    volt = device["reference"]["volt"]
    return [*found, ("reference", volt["min"] - code, volt["max"] + code)]


def _within(change: Change, name: str, low: float, high: float) -> bool:
    if change.volts is None:
        return True
    return low <= change.volts[("translation", "steering", "reference").index(name)] <= high


@dataclass(frozen=True)
class Case:
    """A fault. `play` injects it and judges what follows."""

    number: str  # of hardware's list; a letter where that has none
    fault: str
    how: str  # it is injected
    expected: str
    play: Callable[[Chain, Seen], None]
    setup: Setup = field(default_factory=Setup)
    repeated: bool = False  # by --times: its times scatter
    last: bool = False  # nothing is left to go on with
    clamped: bool = True  # the fault itself does not reach for the voltages

    @property
    def name(self) -> str:
        """Return what --only looks at."""
        return f"{self.number} {self.fault}, {self.how}"


def trips(stage: Chain) -> int:
    """Return how often the guard has tripped."""
    return stage.count("trips since the guard's start", "guard")


def service(name: str) -> str:
    """Return the full name of one of base_node's services."""
    return f"{NODE}/{name}"

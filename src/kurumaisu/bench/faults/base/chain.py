# SPDX-License-Identifier: BSD-3-Clause
"""Board, guard, base_node, master and commander, to be broken one by one."""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import struct
import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from kurumaisu.bench.faults.base.peers import Commander, Event, Graph, end, until
from kurumaisu.bench.guard_rig import Change, ChipRig, Rig, changed
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.whole_files import write_whole

V, W = 0.5, 0.3  # [m/s, rad/s] at which the chair drives when something breaks
NODE = "/base_node"
_HELD = 0.4  # [s] for which a stick that is still held must move nothing
_TRIPS = 2  # of the guard on the way to a speed, until it is an error
_HALF = 0.0007  # [V] more than half a code of the board
_DIAGNOSTICS = 0.2  # [s] their period here, in place of what ships, to save time
_BEGIN = 100.0  # [s] of simulated time
_CONTROL = "qii"  # struct Control of tests/broken_calls.cpp


@dataclass(frozen=True)
class Setup:
    """What differs from what ships, by the paths of guard_rig.changed(); and whose system calls may be broken."""

    node: Mapping[str, Any] = field(default_factory=dict)  # parameters of base_node; model/... and guard/... too
    device: Mapping[str, Any] = field(default_factory=dict)
    guard: Mapping[str, Any] = field(default_factory=dict)
    chip: bool = False  # a chip in a tree of files in place of the board
    broken: bool = False
    simulated: bool = False  # time


class BrokenCalls:
    """The switches of tests/broken_calls.cpp, and what a program's environment must have to obey them."""

    WHOLE, HALF, STUCK, ERROR = range(4)

    def __init__(self, file: Path) -> None:
        """Make the file of the switches, all off."""
        write_whole({file: bytes(struct.calcsize(_CONTROL))})
        with file.open("r+b") as opened:
            self._memory = mmap.mmap(opened.fileno(), 0)
        self.environment = {"LD_PRELOAD": program("broken_calls.so"), "BROKEN_CALLS": str(file)}

    def step_clock(self, seconds: float) -> None:
        """Set the wall clock by so much from what it really is."""
        struct.pack_into("q", self._memory, 0, round(1e9 * seconds))

    def break_writes(self, how: int) -> None:
        """Break writes to ttys from now on, or no longer."""
        struct.pack_into("i", self._memory, 8, how)

    def broken(self) -> int:
        """Return how many writes were broken so far."""
        count: int = struct.unpack_from("i", self._memory, 12)[0]
        return count


class Chain:
    """The whole chain. What is done with it begins with drive()."""

    def __init__(self, folder: Path, setup: Setup, stack: contextlib.ExitStack) -> None:
        """Start master, commander, board and guard. The stack ends them."""
        self._stack, self._folder = stack, folder
        self.graph = Graph(stack)
        self.peer = Commander(self.graph, folder / "peer.log")
        self.calls = BrokenCalls(folder / "calls") if setup.broken else None
        self.environment = self.calls.environment if self.calls else {}
        rig = ChipRig if setup.chip else Rig
        self.rig = rig(folder, arming=None, device=setup.device, guard=setup.guard, environment=self.environment)
        self.guard_values = yaml.safe_load(self.rig.settings.read_text())
        self.device_values = yaml.safe_load(self.rig.device.read_text())
        model = shipped("launch/md100.yaml")
        values = yaml.safe_load(shipped("launch/base_node.yaml").read_text())
        values |= {"diagnostic_period": _DIAGNOSTICS, "model": yaml.safe_load(model.read_text())}
        values["guard"] = yaml.safe_load(shipped("launch/guard.yaml").read_text())
        values = changed(values, {"dac/kind": "guard", "guard/socket": str(self.rig.socket)})
        self.values = changed(values, setup.node)
        self.law = load_model(model)
        self.simulated = setup.simulated
        self.graph.set_parameter("/use_sim_time", setup.simulated)
        stack.enter_context(self.rig.board())
        self.rig.start()
        until(lambda: any(change.neutral for change in self.rig.changes()), "neutral at the start")
        self.node: subprocess.Popen[str] | None = None
        self._ticks = (_BEGIN, math.inf)  # simulated time [s], and when it was that [s, monotonic]; inf: it stands
        self._marks = (0, 0)
        self.mark()

    @property
    def period(self) -> float:
        """Return the time between two ticks of base_node [s]."""
        return 1.0 / float(self.values["rate"])

    def tick(self, now: float | None) -> None:
        """Let simulated time pass from `now` [s] on; None: let it stand still."""
        if now is None:
            self._ticks = (self.clock, math.inf)
        else:
            self._ticks = (now, time.monotonic())
        self.peer.order(do="clock", now=now)

    @property
    def clock(self) -> float:
        """Return about what time it is, of simulated time [s]."""
        begin, since = self._ticks
        return begin + max(0.0, time.monotonic() - since)

    def replace_peer(self) -> None:
        """Have another commander in place of one that a new master does not know."""
        end(self.peer.process)
        self.peer = self.another_peer()

    def another_peer(self) -> Commander:
        """Return one more commander."""
        return Commander(self.graph, self._folder / "peer.log")

    def start_node(self, changes: Mapping[str, Any] | None = None) -> subprocess.Popen[str]:
        """Start base_node afresh, with some parameters changed; its output goes to a log."""
        if self.node:
            end(self.node)
        self.graph.delete_parameter(NODE)
        self.graph.set_parameter(NODE, changed(self.values, changes or {}))
        self.node = self.graph.run(
            [program("base_node")],
            stdout=self._log.open("a"),
            stderr=subprocess.STDOUT,
            environment=self.environment,
        )
        return self.node

    @property
    def _log(self) -> Path:
        return self._folder / "node.log"

    def mark(self) -> None:
        """Let everything said, and every change, count from now on."""
        lengths = [len(path.read_text()) if path.exists() else 0 for path in (self._log, self.rig.messages)]
        self._marks = (lengths[0], lengths[1])
        self.begun = time.monotonic()
        self._first = len(self.rig.changes())

    def said(self) -> str:
        """Return what base_node and guard have said since the mark."""
        texts = [path.read_text() if path.exists() else "" for path in (self._log, self.rig.messages)]
        return "\n".join(text[mark:] for text, mark in zip(texts, self._marks, strict=True))

    def wait_said(self, words: str, patience: float = PATIENCE) -> None:
        """Wait until one of them has said it since the mark."""
        until(lambda: words in self.said(), words, patience)

    def changes(self, since: float = 0.0) -> list[Change]:
        """Return the board's changes since the mark, and since then [s, monotonic]."""
        return [change for change in self.rig.changes()[self._first :] if change.time >= since]

    def drive(self, v: float = V, w: float = W) -> int:
        """Start what does not run, let go, and drive until the board has the voltages. Raise Error if it never has.

        Return how often the guard tripped before: a kernel that is late with the terminal's bytes is a lost reply.
        """
        self.rig.start()
        runs = self.node and self.node.poll() is None
        if runs and self.peer.said.get("cmd_vel") == [v, w] and self.is_armed() and self.has(v, w):
            return 0
        if not runs:
            self.start_node()
        if self.simulated and math.isinf(self._ticks[1]):
            self.tick(_BEGIN)
        for trips in range(_TRIPS + 1):
            self.peer.say(0.0, 0.0)
            until(lambda: self.is_armed() and self._obeys(), "the guard is armed, and base_node obeys")
            self.peer.say(v, w)
            until(lambda: self.has(v, w) or not self.is_armed(), f"the board has the voltages of {v} m/s, {w} rad/s")
            if self.is_armed():
                return trips
        raise Error(f"the guard tripped {_TRIPS + 1} times on the way to {v} m/s, {w} rad/s")

    def rest(self) -> None:
        """Let go, and wait for neutral; what comes counts from now on."""
        self.peer.say(0.0, 0.0)
        self.neutral()
        self.mark()

    def _obeys(self) -> bool:
        active = self.peer.heard("active")
        return bool(active) and active[-1]["name"] != ""

    def is_armed(self) -> bool:
        """Say whether the guard lets anything through."""
        codes = [line.split(":")[0] for line in self.rig.messages.read_text().splitlines()]
        last = [code for code in codes if code in ("GUARD_ARMED", "GUARD_TRIPPED", "GUARD_DEAD", "GUARD_END")]
        return last[-1:] == ["GUARD_ARMED"]

    def has(self, v: float, w: float) -> bool:
        """Say whether the board's voltages are those of rates [m/s, rad/s]."""
        volts = self.rig.changes()[-1].volts
        wanted = self.law.translation.volts(v), self.law.steering.volts(w)
        return volts is not None and all(abs(a - float(b)) < _HALF for a, b in zip(volts, wanted, strict=False))

    def neutral(self, patience: float = PATIENCE) -> float:
        """Return since when the board is neutral [s, monotonic]; nan if it is not within so long [s]."""
        since = self.rig.neutral(patience)
        return math.nan if since is None else since

    def moved(self, since: float, seconds: float = _HELD) -> bool:
        """Say whether the board is anything but neutral from then on [s, monotonic] and for so long from now [s]."""
        time.sleep(seconds)
        return any(change.neutral is False for change in self.changes(since))

    def strike(self, number: int, pid: int | None = None) -> float:
        """Send base_node, or another process, a signal; return when [s, monotonic]."""
        assert self.node
        begin = time.monotonic()
        os.kill(self.node.pid if pid is None else pid, number)
        return begin

    def inject(self, fault: str) -> float:
        """Give the board a fault; return when [s, monotonic]."""
        begin = time.monotonic()
        self.rig.inject(fault)
        return begin

    def status(self, name: str, words: str = "", since: float | None = None) -> Event:
        """Return the first diagnostics of a part since then (None: from now on) whose message has these words."""
        begin = time.monotonic() if since is None else since
        return self.peer.wait("diagnostics", lambda e: e["name"].endswith(name) and words in e["message"], begin)

    def count(self, key: str, name: str = "commands") -> int:
        """Return one of the counts on diagnostics."""
        return int(self.status(name).values["values"][key])


@contextlib.contextmanager
def running_chain(folder: Path, setup: Setup) -> Iterator[Chain]:
    """Build a stage; nothing of it is left in the end."""
    folder.mkdir(parents=True)
    with contextlib.ExitStack() as stack:
        yield Chain(folder, setup, stack)

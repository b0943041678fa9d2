# SPDX-License-Identifier: BSD-3-Clause
"""A guard in front of a virtual board, a client that drives, and when the board was neutral."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from kurumaisu import children
from kurumaisu.bench.guard_client import Favour
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.whole_files import write_whole

NS = 1e-9  # [s]
_ARMING = 0.2  # [s] in place of what ships, to save time; nothing else differs
_LOOK = 0.005  # [s] between two looks at logs: what counts is when a line says that it happened
_TAIL = 4096  # [bytes] at a log's end
_SAYING = 0.02  # [s] in which they say what they have done
_SHARED_MEMORY = Path("/dev/shm")  # tmpfs on every Linux
_SUPPLY = 5.0  # [V] of the virtual chip
_ENDING = 5.0  # [s]
_BUSY = "import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n    sum(range(10000))"


@dataclass(frozen=True)
class Change:
    """A line of the board's log: what its outputs became, or None when it was plugged in again."""

    time: float  # [s, monotonic]
    neutral: bool | None
    volts: tuple[float, float, float] | None = None  # V_f, V_s, reference


def changed(tree: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a tree with the values at some paths, "a/b/c", replaced; None removes a key."""
    result = dict(tree)
    for path, value in changes.items():
        key, _, rest = path.partition("/")
        if rest:
            result[key] = changed(result[key], {rest: value})
        elif value is None:
            del result[key]
        else:
            result[key] = value
    return result


class Rig:
    """Board, sentinel and guard, in a folder of their own."""

    _DEVICE, _PLACE = "serial_ascii", "port"  # file of launch/dac, and its key that says where the device is

    def __init__(
        self,
        folder: Path,
        *,
        arming: float | None = _ARMING,
        device: Mapping[str, Any] | None = None,
        guard: Mapping[str, Any] | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Write the files that they read. Start with board().

        arming: of the guard [s], None as it ships; device, guard: changes to the shipped files, see changed();
        environment: of the guard, added to this process'.
        """
        self.folder = folder
        self._environment = {**os.environ, **(environment or {})}
        self.socket = folder / "guard.sock"
        self._log = folder / "board.log"
        self.messages = folder / "guard.log"
        self._changes: list[Change] = []
        self._read = 0  # [bytes] of the log
        tree = yaml.safe_load(shipped(f"launch/dac/{self._DEVICE}.yaml").read_text()) | {
            self._PLACE: str(folder / "dac")
        }
        tree = changed(tree, device or {})
        self.step = self._step(tree)
        self.device = self._write("device.yaml", tree)
        settings = yaml.safe_load(shipped("launch/guard.yaml").read_text())
        if arming is not None:
            settings["limits"]["arming"] = arming
        settings = changed(settings, guard or {})
        self.silence = float(settings["limits"]["silence"])
        dac = yaml.safe_load(shipped("launch/base_node.yaml").read_text())["dac"]
        self.favour = Favour(dac["priority"], dac["longest_run"], dac["nice"])
        model = str(shipped(f"launch/{settings['model']}").resolve())
        self.settings = self._write("guard.yaml", settings | {"model": model, "socket": str(self.socket)})
        self._sentinel: subprocess.Popen[bytes] | None = None
        self._board: subprocess.Popen[str] | None = None

    def _step(self, device: Mapping[str, Any]) -> float:
        """Return the device's step [V]."""
        return 1 / min(float(device["channels"][name]["code"]["per_volt"]) for name in ("translation", "steering"))

    def _write(self, name: str, tree: dict[str, object]) -> Path:
        path = self.folder / name
        write_whole({path: yaml.safe_dump(tree)})
        return path

    @contextlib.contextmanager
    def board(self) -> Iterator[None]:
        """Run the board, before all others: hardware waits for no scheduler. At the end nothing is left."""
        command = [program("virtual_dac"), str(self.device), str(self.folder / "dac"), "--log", str(self._log)]
        self._board = children.start([*command, "--realtime"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        try:
            assert self._board.stdout
            if "virtual board" not in self._board.stdout.readline():
                raise Error("virtual_dac: does not start")
            yield
        finally:
            self.end()
            self._board.communicate(timeout=PATIENCE)

    def start(self) -> None:
        """Start sentinel and guard, unless they run."""
        if self._sentinel and self._sentinel.poll() is None:
            return
        self._sentinel = children.start(
            [program("guard"), str(self.device), str(self.settings)],
            stderr=self.messages.open("ab"),
            env=self._environment,
        )

    def end(self) -> None:
        """End sentinel and guard as systemd does."""
        if self._sentinel:
            self._sentinel.terminate()
            self._sentinel.wait(_ENDING)

    def sentinel(self) -> int:
        """Return the sentinel's process id."""
        assert self._sentinel
        return self._sentinel.pid

    def guard(self) -> int:
        """Return the guard's process id."""
        pid = self.sentinel()
        return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])

    def reap(self) -> None:
        """Wait for the end of a sentinel that was killed."""
        assert self._sentinel
        self._sentinel.wait(_ENDING)

    def force(self) -> None:
        """Write neutral as ExecStopPost does."""
        subprocess.run(
            [program("guard"), "--neutral", str(self.device), str(self.settings)],
            check=True,
            stderr=self.messages.open("ab"),
        )

    def inject(self, fault: str) -> None:
        """Give the board a fault."""
        assert self._board
        assert self._board.stdin
        self._board.stdin.write(fault + "\n")
        self._board.stdin.flush()

    def changes(self) -> list[Change]:
        """Return what the board's outputs became so far."""
        with self._log.open() as log:
            log.seek(self._read)
            text = log.read()
        lines = text[: text.rfind("\n") + 1]  # the last may be half a line
        self._read += len(lines)
        for line in lines.splitlines():
            match = re.fullmatch(r"(\d+) (?:volts (\S+) (\S+) (\S+)|plugged)", line)
            if match:
                self._changes.append(self._change(NS * int(match[1]), match.groups()[1:]))
        return self._changes

    def _change(self, time_s: float, words: tuple[str | None, ...]) -> Change:
        if words[0] is None:
            return Change(time_s, None)
        f, s, reference = (float(word) for word in words if word)
        return Change(time_s, max(abs(f), abs(s)) < self.step / 2, (f, s, reference))

    def reaction(self, since: float) -> float | None:
        """Return when [s, monotonic] guard or sentinel noticed what happened, by their log; None if none says so."""
        time.sleep(_SAYING)
        with self.messages.open("rb") as log:
            log.seek(max(0, self.messages.stat().st_size - _TAIL))
            for found in re.finditer(rb"noticed at (\S+) s, neutral", log.read()):
                if float(found[1]) >= since:
                    return float(found[1])
        return None

    def neutral(self, patience: float, after: float = math.inf) -> float | None:
        """Wait until the board is neutral; return since when [s, monotonic], or None if it is not in so long [s].

        after: neutral from then on [s] counts even if motion followed, of a client that armed anew meanwhile.
        """
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            tail = list(itertools.takewhile(lambda change: change.neutral is not False, reversed(self.changes())))
            since = [change.time for change in tail if change.neutral][-1:]
            since += [change.time for change in self.changes() if change.neutral and change.time >= after][:1]
            if since:
                return since[-1]
            time.sleep(_LOOK)
        return None


class ChipRig(Rig):
    """The same with a virtual chip, in a tree of files like those of Linux's IIO."""

    _DEVICE, _PLACE = "mcp4728", "root"

    def _step(self, device: Mapping[str, Any]) -> float:
        return float(_SUPPLY / 2 ** device["bits"])


def in_memory() -> Path | None:
    """Return a folder whose files are on no disk, None if there is none: a disk keeps waiting who writes to it."""
    return _SHARED_MEMORY if os.access(_SHARED_MEMORY, os.W_OK) else None


def strike(pids: Callable[[], list[int]], number: signal.Signals) -> float:
    """Send a signal to processes; return the time just before [s, monotonic]."""
    chosen = pids()
    begin = time.monotonic()
    for pid in chosen:
        os.kill(pid, number)
    return begin


@contextlib.contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep so many processes busy; they end with this one, too."""
    loops = [children.start([sys.executable, "-c", _BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait(_ENDING)

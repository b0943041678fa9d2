# SPDX-License-Identifier: BSD-3-Clause
"""A process that drives through the guard, until it ends badly."""

from __future__ import annotations

import contextlib
import itertools
import select
import socket
import struct
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.errors import Error

_NS = 1e-9  # [s]
_ENDING = 5.0  # [s]
_REPLY_MOST = 100  # [bytes]
_BREAKING = 0.05  # [s] that a client gets to break


@dataclass(frozen=True)
class Favour:
    """How a client comes before others: as in launch/base_node.yaml."""

    priority: int
    longest_run: float  # [s]
    nice: int


class RawClient:
    """A connection to a guard, for messages of any kind."""

    _REQUEST, _MAGIC, _VERSION, _PUT = "<IHHQq3d", 0x4B475244, 1, 1  # of src/guard/protocol.h, little-endian
    _PERIOD = 0.02  # [s]

    def __init__(self, path: Path, reference: float = 2.5) -> None:
        """Connect. path: the guard's socket; reference [V]: of the model."""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.connect(str(path))
        self._sequence = itertools.count(1)
        self._reference = reference

    def put(self, translation: float, steering: float = 0.0) -> None:
        """Ask for voltages [V]; wait for no answer."""
        head = (self._MAGIC, self._VERSION, self._PUT, next(self._sequence), time.monotonic_ns())
        self._socket.send(struct.pack(self._REQUEST, *head, translation, steering, self._reference))

    def answers(self) -> int:
        """Return how many answers have come since the last call."""
        count = 0
        with contextlib.suppress(BlockingIOError):
            while self._socket.recv(_REPLY_MOST, socket.MSG_DONTWAIT):
                count += 1
        return count

    def arm(self, seconds: float) -> None:
        """Hold neutral for so long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.put(0.0)
            time.sleep(self._PERIOD)

    def close(self) -> None:
        """Leave."""
        self._socket.close()


class Client:
    """A process that drives through the guard; see tests/guard_client.cpp."""

    def __init__(self, socket: Path, mode: str, favour: Favour) -> None:
        """Start it. socket: the guard's; it may leave a core file beside it."""
        command = [program("guard_client"), str(socket), mode]
        command += [str(favour.priority), str(favour.longest_run), str(favour.nice)]
        self.process = children.start(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1, cwd=socket.parent
        )

    def line(self) -> str:
        """Return its next line. Raise Error if none comes."""
        assert self.process.stdout
        if not select.select([self.process.stdout], [], [], PATIENCE)[0]:
            raise Error("guard_client: says nothing; is the guard armed?")
        return str(self.process.stdout.readline()).strip()

    def wait_armed(self) -> None:
        """Wait until its voltage is put out."""
        while self.line() != "armed":
            pass

    def fail(self) -> float:
        """Let it break as its mode says; return when it did [s, monotonic]."""
        assert self.process.stdin
        self.process.stdin.write("now\n")
        time.sleep(_BREAKING)  # who waits for its word might come before it, and keep it from breaking
        line = self.line()
        while not line.isdigit():
            line = self.line()
        return _NS * int(line)

    def end(self) -> None:
        """Kill it, whatever state it is in."""
        self.process.kill()
        self.process.wait(_ENDING)
        for stream in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(BrokenPipeError):
                stream.close()  # type: ignore[union-attr]

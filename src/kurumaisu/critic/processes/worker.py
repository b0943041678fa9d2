# SPDX-License-Identifier: BSD-3-Clause
"""A process that runs what it is sent, one thing at a time: what goes wrong in it, even a crash, stays in it."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from queue import SimpleQueue
from typing import Any

_MAIN = "import sys; from kurumaisu.critic.processes.worker import main; main(int(sys.argv[1]))"

_PATIENCE = 5.0  # [s] for a process to end that has closed its connection

Task = Callable[..., Any]  # of a module, with the arguments to send and last a function that tells progress


@dataclass(frozen=True)
class ProgressMessage:
    """A worker's word on how far it is."""

    message: str


class Worker:
    """The other end: send a task and its arguments, receive Progress and at last the result, or each of an iterator's.

    A new interpreter rather than a fork, for the parent may have threads, and need not guard its main module.
    """

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        command = [sys.executable, "-P", "-c", _MAIN, str(theirs.fileno())]
        # Inherited: Ctrl-C reaches all processes of a terminal, but it is the parent that ends its workers.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                command,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # our own carries verdicts
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            theirs.close()

    def send(self, task: Task, *arguments: Any) -> None:
        """Have it run task(*arguments, progress). That it has died is heard by receive."""
        with suppress(OSError):
            self.connection.send((task, arguments))

    def receive(self) -> Any:
        """Return Progress or the result. Raise EOFError when the process has ended instead."""
        try:
            return self.connection.recv()
        except OSError as error:
            raise EOFError from error

    def died_of(self) -> str:
        """Return, where receive heard that it ended, what ended it."""
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return "its process no longer answers"
        if code >= 0:
            return f"its process ended with the code {code}"
        name = signal.Signals(-code).name
        return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")

    def close(self) -> None:
        """End it, whatever it is doing."""
        self.connection.close()
        self._process.kill()
        self._process.wait()


def main(descriptor: int) -> None:
    """Run tasks from a connection until the other end is closed, be it in the middle of one."""
    connection = Connection(descriptor)
    received: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(connection, received), daemon=True).start()
    while True:
        task, arguments = pickle.loads(received.get())  # from our own parent
        result = task(*arguments, lambda message: connection.send(ProgressMessage(message)))
        for part in result if isinstance(result, Iterator) else (result,):
            connection.send(part)


def _listen(connection: Connection, received: SimpleQueue[bytes]) -> None:
    while True:
        try:
            received.put(connection.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)  # nobody is left to hear the result

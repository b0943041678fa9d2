# SPDX-License-Identifier: BSD-3-Clause
"""A ROS master that may die, and a commander of base_node that runs beside it: kurumaisu/ros/testing/base_peer.py."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, free_port
from kurumaisu.errors import Error

_LOOK = 0.002  # [s] between two looks at a condition
_NICE = -10  # of a commander, if it may: it is not what is tested


def until(condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
    """Return the condition's value once it is true. Raise Error if it is not within so long [s]."""
    deadline = time.monotonic() + patience
    while not (found := condition()):
        if time.monotonic() > deadline:
            raise Error(f"not within {patience:g} s: {what}")
        time.sleep(_LOOK)
    return found


class Graph:
    """A master of our own at a port of its own, and those who find it; all end with it."""

    def __init__(self, stack: contextlib.ExitStack) -> None:
        """Start the master; the stack ends it and all others."""
        self._stack = stack
        self._port = free_port()
        self.uri = f"http://localhost:{self._port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost"}
        self.start_master()

    def run(self, command: list[str], **options: Any) -> subprocess.Popen[str]:
        """Start a process; it is killed at the end, if it still runs."""
        environment = self.environment | options.pop("environment", {})
        process = children.start(command, env=environment, text=True, **options)
        self._stack.callback(end, process)
        return process

    def start_master(self) -> None:
        """Start a master that knows nobody."""
        command = ["rosmaster", "--core", "-p", str(self._port)]
        self.master = self.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until(self._answers, "a master")

    def _answers(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("localhost", self._port)) == 0

    def kill_master(self) -> float:
        """Kill it; return when [s, monotonic]."""
        begin = time.monotonic()
        self.master.kill()
        self.master.wait()
        return begin

    def set_parameter(self, name: str, value: Any) -> None:
        """Put a value on the parameter server."""
        self._master("setParam", name, value)

    def delete_parameter(self, name: str) -> None:
        """Take it off the parameter server again, if it is there."""
        if self._master("hasParam", name):
            self._master("deleteParam", name)

    def _master(self, method: str, *arguments: Any) -> Any:
        with xmlrpc.client.ServerProxy(self.uri) as proxy:
            code, message, value = getattr(proxy, method)("/bench", *arguments)
        if code != 1:
            raise Error(f"the parameter server: {method} {arguments[0]}: {message}")
        return value


def end(process: subprocess.Popen[str]) -> None:
    """Kill a process, stopped or not, and wait for it."""
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        with contextlib.suppress(BrokenPipeError):
            if stream:
                stream.close()


@dataclass(frozen=True)
class Event:
    """What a peer heard: when [s, monotonic], what kind of thing, and its values."""

    t: float
    what: str
    values: Mapping[str, Any] = field(repr=False)

    def __getitem__(self, key: str) -> Any:
        """Return a value."""
        return self.values[key]


class Commander:
    """A commander that also listens."""

    def __init__(self, graph: Graph, log: Path) -> None:
        """Start it, and wait until it listens; its complaints go to the log."""
        self.events: list[Event] = []
        self.said: dict[str, Any] = {}  # what is repeated, by topic
        self.process = graph.run(
            [sys.executable, "-m", "kurumaisu.ros.testing.base_peer"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log.open("a"),
        )
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, self.process.pid, _NICE)
        threading.Thread(target=self._listen, daemon=True).start()
        self.wait("ready")

    def _listen(self) -> None:
        assert self.process.stdout
        with contextlib.suppress(ValueError):  # of a stream that was closed
            for line in self.process.stdout:
                values = json.loads(line)
                self.events.append(Event(values.pop("t"), values.pop("what"), values))

    def heard(self, what: str, since: float = 0.0) -> list[Event]:
        """Return the events of a kind since then [s, monotonic]."""
        found = []
        for event in reversed(self.events):
            if event.t < since:
                break
            if event.what == what:
                found.append(event)
        return found[::-1]

    def wait(
        self, what: str, so: Callable[[Event], bool] = lambda _: True, since: float = 0.0, patience: float = PATIENCE
    ) -> Event:
        """Return the first event of a kind since then that is so. Raise Error if none comes."""
        found: Event = until(lambda: next(filter(so, self.heard(what, since)), None), f"{what} that is so", patience)
        return found

    def say(self, v: float, w: float, topic: str = "cmd_vel") -> None:
        """Command from now on [m/s, rad/s]."""
        self.repeat(topic, [v, w])

    def repeat(self, topic: str, value: Any) -> None:
        """Repeat a value from now on; None: be silent."""
        self.said[topic] = value
        self.order(do="repeat", topic=topic, value=value)

    def wait_joined(self, topic: str) -> None:
        """Wait until somebody hears what is repeated on a topic: a new one takes a moment to be found."""
        self.wait("joined", lambda event: event["topic"] == topic)

    def call(self, name: str) -> Event:
        """Call a service without arguments; return its answer."""
        begin = time.monotonic()
        self.order(do="call", name=name)
        return self.wait("answer", lambda event: event["name"] == name, begin)

    def order(self, **order: Any) -> None:
        """Give an order."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()

    def signal(self, number: signal.Signals) -> float:
        """Send it a signal; return when [s, monotonic]."""
        begin = time.monotonic()
        self.process.send_signal(number)
        return begin

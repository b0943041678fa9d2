# SPDX-License-Identifier: BSD-3-Clause
"""A viewer's page without a browser: keeps the newest of each message, and counts them."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import aiohttp

_PATIENCE = 20.0  # [s]
_ESTABLISHED = 1  # as the kernel counts a connection's states


class Page:
    """One connection, whose loop runs in a thread of its own."""

    def __init__(self, address: str, origin: str | None = None) -> None:
        """Connect to http://HOST:PORT/. Raise what aiohttp raises where that fails."""
        self._base = address.split("#")[0].rstrip("/")
        self._origin = self._base if origin is None else origin
        self.newest: dict[str, Any] = {}
        self.scans: dict[int, bytes] = {}
        self.replies: dict[int, dict[str, Any]] = {}
        self.counts: Counter[str] = Counter()
        self.bytes = 0
        self.problem: BaseException | None = None
        self._asked = 1000  # apart from what a test numbers itself
        self._reads = True
        self._opened = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._opened.wait(_PATIENCE)
        if self.problem is not None:
            raise self.problem

    def let_in(self, address: str) -> None:
        """Show the token of an address; return when it is accepted."""
        self.say(type="token", token=address.split("#token=")[1])
        self.wait(lambda: self.newest.get("hello", {}).get("control"), "control")

    def say(self, **content: Any) -> None:
        """Send an object."""
        self.send(json.dumps(content))

    def send(self, text: str) -> None:
        """Send text, whatever it is."""
        asyncio.run_coroutine_threadsafe(self._socket.send_str(text), self._loop).result(_PATIENCE)

    def ask(self, name: str, **arguments: Any) -> dict[str, Any]:
        """Return the reply to a command."""
        self._asked += 1
        number = self._asked
        self.say(type="command", id=number, name=name, **arguments)
        self.wait(lambda: number in self.replies, f"a reply to {name}")
        return self.replies[number]

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        """Return the condition's value as soon as it is true. Raise AssertionError after a while."""
        deadline = time.monotonic() + _PATIENCE
        while time.monotonic() < deadline:
            if result := condition():
                return result
            time.sleep(0.005)
        raise AssertionError(f"not within {_PATIENCE:g} s: {what}")

    def state(self, condition: Callable[[dict[str, Any]], Any], what: str) -> dict[str, Any]:
        """Return the first state from now on that meets a condition."""
        seen = self.counts["state"]
        self.wait(lambda: self.counts["state"] > seen and condition(self.newest["state"]), what)
        found: dict[str, Any] = self.newest["state"]
        return found

    def stall(self) -> None:
        """Take nothing any more, as a page that hangs."""
        self._reads = False

    @property
    def cut_off(self) -> bool:
        """Whether the other end has ended the connection of a page that hangs: the kernel knows."""
        link = self._socket.get_extra_info("socket")
        return link is None or link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != _ESTABLISHED

    @property
    def closed(self) -> bool:
        """Whether the connection has ended."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """End it."""
        self._reads = True  # one that hangs would not hear that the other end agrees
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._socket.close(), self._loop)
            self._thread.join(_PATIENCE)

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._talk())
        except (aiohttp.ClientError, OSError) as problem:
            self.problem = problem
        finally:
            self._opened.set()

    async def _talk(self) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{self._base}/ws", headers={"Origin": self._origin}, max_msg_size=0) as self._socket,
        ):
            self._opened.set()
            async for message in self._socket:
                self._take(message)
                while not self._reads:
                    await asyncio.sleep(0.1)

    def _take(self, message: Any) -> None:
        self.bytes += len(message.data)
        if message.type == aiohttp.WSMsgType.BINARY:
            kind = {1: "scan", 2: "particles"}[message.data[0]]
            if kind == "scan":
                self.scans[int.from_bytes(message.data[4:8], "little")] = message.data
            self.newest[kind] = message.data
        else:
            content = json.loads(message.data)
            kind = content["type"]
            self.newest[kind] = content
            if kind == "reply":
                self.replies[content["id"]] = content
        self.counts[kind] += 1

# SPDX-License-Identifier: BSD-3-Clause
"""Connections that ask for nothing, or never end what they ask, are ended: each holds a descriptor."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Container

from aiohttp import web

_LONGEST = 60.0  # [s] of a request with its answer, over a slow line too
_LOOK = 0.5  # [s] between looks at the connections


class Patience:
    """Looks at a server's connections now and then. begun: to be told of every request."""

    def __init__(self, server: web.Server, sockets: Callable[[], Container[object]], first: float) -> None:
        """sockets: transports that last as long as they like; first [s]: for a whole first request to come."""
        self._server = server
        self._sockets = sockets
        self._first = first
        self._deadlines: dict[object, float] = {}  # [s] of the loop, by transport

    def begun(self, request: web.Request) -> None:
        """Note a request whose head has come."""
        if request.transport is not None:
            self._deadlines[request.transport] = asyncio.get_running_loop().time() + _LONGEST

    async def run(self) -> None:
        """Look until cancelled."""
        while True:
            await asyncio.sleep(_LOOK)
            self._look(asyncio.get_running_loop().time())

    def _look(self, now: float) -> None:
        there = [connection.transport for connection in self._server.connections]
        lasting = self._sockets()
        known, self._deadlines = self._deadlines, {}
        for transport in there:
            if transport is None or transport in lasting:
                continue
            self._deadlines[transport] = known.get(transport, now + self._first)
            if now > self._deadlines[transport]:
                transport.abort()

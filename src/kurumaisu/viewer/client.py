# SPDX-License-Identifier: BSD-3-Clause
"""One connected page: what it is sent, and what it asks for."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from kurumaisu.errors import Error
from kurumaisu.viewer import commands, protocol
from kurumaisu.viewer.access import AccessTokens
from kurumaisu.viewer.commands import OPEN, Credential, Request
from kurumaisu.viewer.hub import Hub, Mailbox, Payload
from kurumaisu.viewer.seats import Seats
from kurumaisu.viewer.settings import ViewerSettings
from kurumaisu.viewer.source import Source

URGENT = ("drive", "estop")  # they do not wait for what was asked before
_MOST_WAITING = 32  # commands of one client
_MOST_REPLIES = 256  # that one client has not taken
_MOST_WRONG = 5  # credentials
_SEND_BUFFER = 1 << 18  # [bytes] in the kernel, which would keep megabytes of old frames for a slow client


@dataclass(frozen=True)
class Account:
    """What a client has had: address, seconds since it came, frames that it took, and frames that it missed."""

    address: str
    seconds: float
    shown: int
    missed: int


class Client:
    """Lives as long as its connection."""

    def __init__(
        self,
        settings: ViewerSettings,
        hub: Hub,
        source: Source,
        keys: AccessTokens | None,
        workers: Mapping[str, Executor],
        seats: Seats,
    ) -> None:
        """keys: None where nobody may command; workers: for each urgent or open command, and "" for all others."""
        self._settings = settings
        self._hub = hub
        self._source = source
        self._keys = keys
        self._workers = workers
        self._seats = seats
        self._control = False
        self._wrong = 0
        self._socket = web.WebSocketResponse(
            max_msg_size=settings.longest_message, compress=False, timeout=1.0, heartbeat=settings.patience
        )
        self.transport: asyncio.Transport | None = None
        self._news = asyncio.Event()
        self._asked = asyncio.Event()
        self._waiting: deque[Request] = deque()
        self._replies: deque[str] = deque()
        self._mailbox: Mailbox | None = None
        self._address, self._came = "", 0.0  # [s] of the loop
        self.stalled = False  # and was cut off

    async def serve(self, request: web.Request) -> web.WebSocketResponse:
        """Send and hear until the connection ends."""
        await self._socket.prepare(request)
        self.transport = request.transport
        if self.transport is not None:
            link = self.transport.get_extra_info("socket")
            link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        loop = asyncio.get_running_loop()
        if self._seats.look(self):
            self._say(self._hello(None))
        elif not await self._shows_that_it_may_command():
            full = f"{self._settings.most_clients} pages look already"
            await self._socket.close(code=WSCloseCode.TRY_AGAIN_LATER, message=full.encode())
            return self._socket

        def notify() -> None:
            loop.call_soon_threadsafe(self._news.set)

        host, port = (request.transport.get_extra_info("peername") if request.transport else None) or ("", 0)
        self._address, self._came = f"{host}:{port}", loop.time()
        self._mailbox = mailbox = self._hub.join(notify)
        self._news.set()
        tasks = [asyncio.create_task(self._send(mailbox)), asyncio.create_task(self._obey())]
        try:
            await self._hear()
        finally:
            self._hub.leave(mailbox)
            for task in tasks:
                task.cancel()
            self.abort()
        return self._socket

    async def _shows_that_it_may_command(self) -> bool:
        """Return whether, all seats being taken, it shows at once what it may command by."""
        self._seats.wait(self, self.abort)
        try:
            async with asyncio.timeout(self._settings.patience):
                while not self._control:
                    message = await self._socket.receive()
                    if message.type != WSMsgType.TEXT or not self._heard(message.data):
                        return False
                    while self._replies and not self._control:
                        await self._socket.send_str(self._replies.popleft())
        except (TimeoutError, ConnectionError):
            return False
        return True

    def abort(self) -> None:
        """End the connection at once, whatever is still to be sent."""
        if self.transport is not None:
            self.transport.abort()

    def account(self) -> Account | None:
        """Return what it has had; None before its handshake is over."""
        box = self._mailbox
        if box is None:
            return None
        return Account(self._address, asyncio.get_running_loop().time() - self._came, box.shown, box.missed)

    def _cut_off(self) -> None:
        """End the connection, and have the kernel throw away what was to be sent: it would keep it for minutes."""
        self.stalled = True
        if self.transport is not None and not self.transport.is_closing():
            link = self.transport.get_extra_info("socket")
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.abort()

    async def _send(self, mailbox: Mailbox) -> None:
        """Send what is newest, as fast as the client takes it but not faster than the rate; end it if it stalls."""
        period, clock = 1 / self._settings.rate, asyncio.get_running_loop().time
        due = clock()
        while True:
            await self._news.wait()
            self._news.clear()
            replies, self._replies = self._replies, deque()
            try:
                async with asyncio.timeout(self._settings.patience):
                    for payload in (*replies, *mailbox.take()):
                        await self._give(payload)
            except (TimeoutError, ConnectionError, RuntimeError):
                self._cut_off()
                return
            due = max(due + period, clock())  # what is late is left out, not made up for
            await asyncio.sleep(due - clock())

    async def _give(self, payload: Payload) -> None:
        if isinstance(payload, str):
            await self._socket.send_str(payload)
        else:
            await self._socket.send_bytes(payload)

    async def _hear(self) -> None:
        async for message in self._socket:
            if message.type != WSMsgType.TEXT:
                await self._socket.close(code=WSCloseCode.UNSUPPORTED_DATA)
                return
            if not self._heard(message.data):
                await self._socket.close(code=WSCloseCode.POLICY_VIOLATION)
                return

    def _heard(self, text: str) -> bool:
        """Take a message; return whether more of them are welcome."""
        try:
            self._take(commands.read(text))
        except Error as error:
            self._answer(commands.number_of(text), False, str(error))
        return self._wrong < _MOST_WRONG and len(self._replies) <= _MOST_REPLIES

    def _take(self, said: Request | Credential) -> None:
        if isinstance(said, Credential):
            self._let_in(said)
            return
        if not self._control and said.name not in OPEN:
            raise Error(f"{said.name}: {_why_not(self._keys)}")
        if said.name not in self._source.abilities:
            raise Error(f"{said.name}: is not possible in the mode {self._source.mode}")
        if said.name in URGENT:
            self._run(said)
            return
        self._overtake(said)
        if len(self._waiting) >= _MOST_WAITING:
            raise Error(f"{said.name}: {_MOST_WAITING} commands are waiting already")
        self._waiting.append(said)
        self._asked.set()

    def _overtake(self, newer: Request) -> None:
        """Drop a pose that waits for its turn when a newer one of the same body comes, as while it is dragged."""
        if newer.name != "set_pose":
            return
        for older in [one for one in self._waiting if one.name == newer.name]:
            if older.arguments["body"] == newer.arguments["body"]:
                self._waiting.remove(older)
                self._answer(older.id, False, "set_pose: replaced by a newer one")

    def _let_in(self, said: Credential) -> None:
        session = None
        try:
            if self._keys is None:
                raise Error(_why_not(None))
            if said.kind == "token":
                session = self._keys.redeem(said.secret)
            else:
                self._keys.check(said.secret)
        except Error:
            self._wrong += 1
            raise
        self._seats.command(self)
        self._control = True
        self._say(self._hello(session))

    async def _obey(self) -> None:
        """Have commands done one after another."""
        while True:
            await self._asked.wait()
            self._asked.clear()
            while self._waiting:
                await self._run(self._waiting.popleft())

    def _run(self, command: Request) -> asyncio.Future[None]:
        done = asyncio.get_running_loop().run_in_executor(
            self._workers.get(command.name, self._workers[""]), self._do, command
        )

        async def answer() -> None:
            self._say(await done)

        return asyncio.ensure_future(answer())

    def _do(self, command: Request) -> protocol.Reply:
        try:
            outcome = self._source.command(command.name, command.arguments)
        except Error as error:
            return protocol.Reply(command.id, False, str(error))
        except Exception as error:  # a fault of ours must not leave the page waiting
            return protocol.Reply(command.id, False, f"{command.name}: failed: {error!r}")
        return protocol.Reply(command.id, True, outcome.message, outcome.result)

    def _answer(self, number: int | str | None, ok: bool, message: str) -> None:
        self._say(protocol.Reply(number, ok, message))

    def _say(self, message: Any) -> None:
        self._replies.append(protocol.text(message))
        self._news.set()

    def _hello(self, session: str | None) -> protocol.Hello:
        source = self._source
        abilities = tuple(sorted(source.abilities)) if self._keys is not None else ()
        return protocol.Hello(
            source.title,
            source.mode,
            self._control,
            abilities,
            source.limits,
            session,
            self._hub.report,
            self._hub.new_token,
            tuple(sorted(OPEN & source.abilities)),
        )


def _why_not(keys: AccessTokens | None) -> str:
    if keys is None:
        return "this viewer is read-only: it was started without control"
    return "needs a token: open the address that the viewer printed, or ask it for a new one"

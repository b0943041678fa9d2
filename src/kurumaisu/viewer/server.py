# SPDX-License-Identifier: BSD-3-Clause
"""The web server: pages, pictures of maps, and a WebSocket for each client; its loop runs in a thread of its own."""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Awaitable, Callable, Container, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from aiohttp import web

from kurumaisu.bounded_files import MOST_PAGE, read_bytes
from kurumaisu.errors import Error
from kurumaisu.viewer import access, files, report
from kurumaisu.viewer.access import AccessTokens
from kurumaisu.viewer.client import URGENT, Account, Client
from kurumaisu.viewer.commands import OPEN
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.patience import Patience
from kurumaisu.viewer.seats import Seats
from kurumaisu.viewer.settings import ViewerSettings
from kurumaisu.viewer.source import Source

PAGE = Path(__file__).with_name("page")
_NAME = re.compile(r"([\w-]+/)?[\w-]+(\.[\w-]+)*")  # a file, or one in a folder
_WORKERS = 8  # commands that are under way at a time, of all clients, beside the urgent ones
_PATIENCE = 5.0  # [s] for the loop to begin, and to end

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves one source."""

    def __init__(self, settings: ViewerSettings, hub: Hub, source: Source, control: bool) -> None:
        """control: whether anybody may command, given a token. Nothing happens before start."""
        self._settings = settings
        self._hub = hub
        self._source = source
        self._control = control
        self._keys = AccessTokens()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="viewer", daemon=True)
        # An urgent command waits for none that hangs; and one thread for it keeps the order in which they were said.
        self._workers = {name: ThreadPoolExecutor(1, f"viewer_{name}") for name in (*URGENT, *OPEN)}
        self._workers[""] = ThreadPoolExecutor(_WORKERS, "viewer_command")
        self._open: set[Client] = set()
        self._seats = Seats(settings.most_clients)
        self._patience: Patience | None = None
        self._looking: asyncio.Task[None] | None = None
        self._stalled = 0
        self._runner: web.AppRunner | None = None
        self._port = 0
        self.reports: Mapping[str, Path] = {}  # files below /report/, by name

    def start(self) -> None:
        """Begin to listen. Raise Error for an address that cannot be had."""
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._begin(), self._loop).result(_PATIENCE)

    def close(self) -> None:
        """End all connections; the last one who looked is gone."""
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(_PATIENCE)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_PATIENCE)
        for workers in self._workers.values():
            workers.shutdown(wait=False, cancel_futures=True)

    @property
    def address(self) -> str:
        """Where the page is."""
        host = self._settings.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self._port}/"

    def new_address(self) -> str:
        """Return where the page is, with a token to command, which is good once. Raise Error if nobody may."""
        if not self._control:
            raise Error("this viewer is read-only: it was started without control")
        return f"{self.address}#token={self._keys.new_token()}"

    def accounts(self) -> tuple[list[Account], int]:
        """Return what each client has had, and how many others were cut off as they took nothing."""
        return asyncio.run_coroutine_threadsafe(self._account(), self._loop).result(_PATIENCE)

    async def _account(self) -> tuple[list[Account], int]:
        known = [account for client in self._open if (account := client.account()) is not None]
        return sorted(known, key=lambda account: -account.seconds), self._stalled

    async def _begin(self) -> None:
        app = web.Application(middlewares=[self._guard])
        app.add_routes(
            [
                web.get("/", self._index),
                web.get("/page/{name:.+}", self._file),
                web.get(r"/map/{number:\d{1,9}}.png", self._map),
                web.get("/report/{name}", self._report),
                web.get("/ws", self._socket),
            ]
        )
        # access_log: a line for each request would fill the log
        self._runner = web.AppRunner(app, access_log=None, handle_signals=False)
        await self._runner.setup()
        assert self._runner.server is not None
        self._patience = Patience(self._runner.server, self._sockets, self._settings.patience)
        self._looking = asyncio.create_task(self._patience.run())
        site = web.TCPSite(self._runner, self._settings.host, self._settings.port)
        try:
            await site.start()
        except OSError as error:
            await self._runner.cleanup()
            raise Error(
                f"viewer: {self._settings.host}:{self._settings.port} cannot be used: {error.strerror}; "
                "choose another port; port 0 takes any free one"
            ) from error
        self._port = self._runner.addresses[0][1]

    def _sockets(self) -> Container[object]:
        return {client.transport for client in self._open}

    async def _end(self) -> None:
        if self._looking is not None:
            self._looking.cancel()
        for client in list(self._open):
            client.abort()
        if self._runner is not None:
            await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        assert self._patience is not None
        self._patience.begun(request)
        try:
            access.check_host(request.headers.get("Host"), self._settings.names)
            response = await handler(request)
        except Error as error:
            response = web.Response(status=403, text=str(error))
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=error.reason)
        if not response.prepared:
            for name, value in access.HEADERS.items():
                response.headers.setdefault(name, value)
        return response

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return files.served(request, PAGE / "index.html")

    async def _file(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info["name"]
        if not _NAME.fullmatch(name):  # it may lead out of the page
            raise web.HTTPNotFound
        return files.served(request, PAGE / name)

    async def _map(self, request: web.Request) -> web.StreamResponse:
        png = self._hub.maps.get(int(request.match_info["number"]))
        if png is None:
            raise web.HTTPNotFound
        return web.Response(body=png, content_type="image/png")

    async def _report(self, request: web.Request) -> web.StreamResponse:
        path = self.reports.get(request.match_info["name"])
        if path is None:
            raise web.HTTPNotFound
        body, headers = report.page(read_bytes(path, MOST_PAGE))
        return web.Response(body=body, headers=headers, content_type="text/html", charset="utf-8")

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        access.check_origin(request.headers.get("Origin"), request.headers.get("Host"))
        keys = self._keys if self._control else None
        client = Client(self._settings, self._hub, self._source, keys, self._workers, self._seats)
        self._open.add(client)
        try:
            if len(self._open) == 1:
                self._source.watch(True)
            return await client.serve(request)
        finally:
            self._open.discard(client)
            self._seats.leave(client)
            self._stalled += client.stalled
            if not self._open:
                self._source.watch(False)

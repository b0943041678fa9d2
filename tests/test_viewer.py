# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's server, from outside: by HTTP and WebSocket."""

import asyncio
import json
import struct
import time

import aiohttp
import numpy as np
import pytest
from viewer_rig import BEAMS, CHAIR


def wait_for(condition, what):
    deadline = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)


def talk(running, conversation, **options):
    """Run a conversation (coroutine of a Talk) with a server."""

    async def go():
        async with aiohttp.ClientSession() as session:
            async with asyncio.timeout(20.0):
                async with Talk(session, running.server, **options) as one:
                    return await conversation(one)

    return asyncio.run(go())


class Talk:
    """A connection, as a page has it."""

    def __init__(self, session, server, origin=None):
        base = server.address.rstrip("/")
        headers = {"Origin": base if origin is None else origin}
        self._context = session.ws_connect(f"{base}/ws", headers=headers, max_msg_size=0)
        self.server = server

    async def __aenter__(self):
        self.socket = await self._context
        return self

    async def __aexit__(self, *_):
        await self.socket.close()

    async def next(self, kind, condition=lambda _: True):
        """Return the next message of a type; of binary ones the bytes."""
        while True:
            message = await self.socket.receive()
            assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
            if message.type == aiohttp.WSMsgType.BINARY:
                found = {1: "scan", 2: "particles"}[message.data[0]], message.data
            else:
                found = json.loads(message.data)["type"], json.loads(message.data)
            if found[0] == kind and condition(found[1]):
                return found[1]

    async def say(self, **content):
        await self.socket.send_str(json.dumps(content))

    async def let_in(self):
        """Show a new token; return the hello that answers it."""
        await self.say(type="token", token=self.server.new_address().split("#token=")[1])
        return await self.next("hello", lambda hello: hello["control"])

    async def ask(self, name, number=1, **arguments):
        """Return the reply to a command."""
        await self.say(type="command", id=number, name=name, **arguments)
        return await self.next("reply", lambda reply: reply["id"] == number)


def test_a_page_is_told_all_that_there_is_to_see(running):
    async def look(page):
        hello = await page.next("hello")
        assert hello["version"] == 1
        assert (hello["mode"], hello["control"], hello["limits"]) == ("sim", False, {"v": 0.5, "w": 0.8})
        world = await page.next("world")
        assert [body["name"] for body in world["bodies"]] == ["room", "chair", "<b>box</b>"]
        first, second = [await page.next("state") for _ in range(2)]
        assert second["t"] > first["t"]
        assert np.hypot(*second["poses"]["1"][:2]) == pytest.approx(2.0)
        scan = await page.next("scan")
        kind, flags, count, body = struct.unpack_from("<BBHI", scan)
        assert (kind, flags, count, body) == (1, 3, BEAMS, CHAIR)
        values = np.frombuffer(scan, "<f4", offset=8)
        assert len(values) == 7 + 3 * BEAMS
        ranges, error = values[7 : 7 + BEAMS], values[7 + BEAMS : 7 + 2 * BEAMS]
        assert np.isinf(ranges[1])
        assert np.isnan(ranges[2])
        assert np.nanmax(np.abs(error[3:])) < 0.1
        particles = await page.next("particles")
        assert len(particles) == 8 + 4 * 3 * 200

    talk(running, look)
    wait_for(lambda: running.rig.watched == [True, False], "the source to know that nobody looks any more")


def test_a_token_is_good_once_and_lets_command(running):
    async def command(page):
        assert not (await page.ask("pause", on=True))["ok"]
        hello = await page.let_in()
        assert (await page.ask("pause", on=True))["message"] == "paused"
        assert (await page.ask("save_model"))["result"].startswith("name:")
        return hello["session"]

    async def come_back(page):
        await page.say(type="session", session=session)
        assert (await page.next("hello", lambda hello: hello["control"]))["session"] is None
        assert (await page.ask("pause", on=False))["ok"]

    session = talk(running, command)
    assert running.rig.paused
    talk(running, come_back)
    assert not running.rig.paused

# SPDX-License-Identifier: BSD-3-Clause
"""What clients, and networks, do wrong to the viewer's server."""

import asyncio
import contextlib
import json
import socket
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from viewer_rig import Running, viewer_settings

from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.errors import Error
from kurumaisu.settings import Section
from kurumaisu.viewer import commands, protocol, read_settings
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.server import Server


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not JSON"),
        ("", "not JSON"),
        ("[" * 50000, "not JSON"),
        ("[]", "must be an object"),
        ('{"type": "moon"}', "token, session or command: 'moon'"),
        ('{"type": "token"}', "must be a text"),
        ('{"type": "token", "token": {"a": 1}}', "must be a text"),
        ('{"type": "command", "name": "pause", "on": true}', "id: must be"),
        ('{"type": "command", "id": 1, "name": "__init__"}', "no command '__init__'"),
        ('{"type": "command", "id": 1, "name": ["pause"]}', "no command"),
        ('{"type": "command", "id": 1, "name": "pause"}', "on is missing"),
        ('{"type": "command", "id": 1, "name": "pause", "on": 1}', "on must be true or false"),
        ('{"type": "command", "id": 1, "name": "pause", "on": true, "off": 1}', "has no 'off'"),
        ('{"type": "command", "id": 1, "name": "speed", "value": NaN}', "not JSON"),
        ('{"type": "command", "id": 1, "name": "speed", "value": 1e999}', "finite number"),
        ('{"type": "command", "id": 1, "name": "speed", "value": "1"}', "finite number"),
        (f'{{"type": "command", "id": 1, "name": "speed", "value": {"9" * 400}}}', "finite number"),
        (f'{{"type": "command", "id": 1, "name": "speed", "value": {"9" * 5000}}}', "not JSON"),
        (f'{{"type": "command", "id": {"9" * 400}, "name": "step"}}', "id: must be"),
        ('{"type": "command", "id": 1, "name": "seed", "value": 1.5}', "integer"),
        (
            '{"type": "command", "id": 1, "name": "effect", "effect": "a", "enabled": true, "values": [1]}',
            "by their names",
        ),
        (
            '{"type": "command", "id": 1, "name": "effect", "effect": "a", "enabled": true, "values": {"b": null}}',
            "finite",
        ),
        ('{"type": "command", "id": 1, "name": "set_pose", "body": "", "x": 0, "y": 0, "yaw": 0}', "1 to 200"),
        ('{"type": "command", "id": 1, "name": "drive", "v": 0, "w": 0, "body": 3}', "body must be a text"),
        ('{"type": "command", "id": 1, "name": "drive", "v": 0, "body": "1"}', "w is missing"),
        ('{"type": "command", "id": 1, "name": "pause", "on": true, "body": "1"}', "has no 'body'"),
    ],
)
def test_nonsense_is_answered_and_nothing_is_done(driver, running, text, words):
    before = driver.counts["reply"]
    driver.send(text)
    driver.wait(lambda: driver.counts["reply"] > before, "an answer")
    reply = driver.newest["reply"]
    assert not reply["ok"]
    assert words in reply["message"]
    assert running.rig.commands == []
    assert driver.ask("pause", on=True)["ok"]  # goes on


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_no_json_at_all_surprises_the_reader(content):
    for message in (json.dumps(content), json.dumps({"type": "command", "id": 1, "name": "set_pose", "x": content})):
        with pytest.raises(Error):
            commands.read(message)
        commands.number_of(message)


def test_a_refusal_of_the_source_reaches_the_page(driver):
    reply = driver.ask("set_pose", body="moon", x=0.0, y=0.0, yaw=0.0)
    assert not reply["ok"]
    assert "no body 'moon'" in reply["message"]


def test_a_fault_of_the_source_reaches_the_page(driver, running):
    def broken(**_):
        raise ZeroDivisionError("ours")

    running.rig.do_reset = broken
    assert "ZeroDivisionError" in driver.ask("reset")["message"]
    assert driver.ask("pause", on=True)["ok"]


def test_what_the_source_cannot_do_is_refused(driver):
    assert "is not possible in the mode sim" in driver.ask("seek", t=1.0)["message"]


def test_a_message_of_ten_megabytes_ends_the_connection_and_nobody_elses(driver, running):
    other = Page(running.server.address)
    long = driver._socket.send_str("x" * 10_000_000)
    asyncio.run_coroutine_threadsafe(long, driver._loop)  # it will be cut off before it has said all
    driver.wait(lambda: driver.closed, "the end of the connection")
    other.state(lambda _: True, "the others go on")
    other.close()


def test_binary_messages_end_the_connection(page):
    asyncio.run_coroutine_threadsafe(page._socket.send_bytes(b"\0" * 10), page._loop).result(10)
    page.wait(lambda: page.closed, "the end of the connection")


def test_more_pages_than_there_are_seats_are_told(running):
    with Running(most_clients=3, patience=1.0) as few:
        pages = [Page(few.server.address) for _ in range(3)]
        for page in pages:
            page.wait(lambda page=page: "hello" in page.newest, "a seat")
        late = Page(few.server.address)
        late.wait(lambda: late.closed, "the end of the connection")
        assert late.newest == {}
        assert few.hub.clients == 3
        pages[0].close()
        pages[1].wait(lambda: few.hub.clients == 2, "room")
        next_one = Page(few.server.address)
        next_one.wait(lambda: "hello" in next_one.newest, "a seat")
        for page in (*pages, next_one, late):
            page.close()


def test_who_may_command_finds_a_seat_however_many_look():
    with Running(most_clients=3) as few:
        lookers = [Page(few.server.address) for _ in range(3)]
        for page in lookers:
            page.wait(lambda page=page: "hello" in page.newest, "a seat")
        waiting = [Page(few.server.address) for _ in range(7)]  # who shows nothing holds no place for long
        owners = []
        for _ in range(3):
            address = few.server.new_address()
            owners.append(Page(address))
            owners[-1].let_in(address)
            owners[-1].state(lambda _: True, "a picture")
        assert owners[0].ask("estop", on=True)["ok"]
        again = Page(few.server.address)
        again.say(type="session", session=owners[0].newest["hello"]["session"])
        again.wait(lambda: again.replies.get(None), "an answer")
        assert "3 pages that may command are open already" in again.replies[None]["message"]
        owners[1].close()
        once_more = Page(few.server.address)
        few_owners = lambda: few.hub.clients == 5  # noqa: E731
        lookers[0].wait(few_owners, "a seat that is free")
        once_more.say(type="session", session=owners[0].newest["hello"]["session"])
        once_more.wait(lambda: once_more.newest.get("hello", {}).get("control"), "control")
        for page in (*lookers, *waiting, *owners, again, once_more):
            page.close()


def test_a_looker_who_shows_a_token_frees_his_seat():
    with Running(most_clients=1) as few:
        address = few.server.new_address()
        owner = Page(address)
        owner.wait(lambda: "hello" in owner.newest, "a seat")
        owner.let_in(address)
        looker = Page(few.server.address)
        looker.wait(lambda: "hello" in looker.newest, "a seat")
        owner.close()
        looker.close()


def test_wrong_tokens_at_the_door_end_the_connection():
    with Running(most_clients=1) as few:
        looker = Page(few.server.address)
        looker.wait(lambda: "hello" in looker.newest, "a seat")
        guesser = Page(few.server.address)
        for _ in range(5):
            guesser.say(type="token", token="guess")
        guesser.wait(lambda: guesser.closed, "the end of the connection")
        looker.close()
        guesser.close()


@pytest.mark.parametrize("said", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: "])
def test_a_request_that_never_ends_is_ended(said):
    with Running(patience=0.5) as quick:
        host, port = quick.server.address[7:].rstrip("/").split(":")
        with socket.create_connection((host, int(port)), timeout=20) as connection:
            connection.sendall(said)
            with contextlib.suppress(ConnectionResetError):
                assert connection.recv(100) == b""
        page = Page(quick.server.address)  # which lasts, though it asks for nothing
        page.wait(lambda: page.counts["state"] > 3, "pictures")
        begin = time.monotonic()
        page.wait(lambda: time.monotonic() > begin + 1.5, "a while")
        assert not page.closed
        page.close()


def test_a_port_that_is_taken_is_said():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(Error, match=f"127.0.0.1:{port} cannot be used.*port 0"):
            Server(viewer_settings(port=port), Hub(), None, False).start()


def test_an_unknown_setting_is_said():
    with pytest.raises(Error, match="port: must be 0 to 65535: 70000"):
        viewer_settings(port=70000)
    with pytest.raises(Error, match="names"):
        viewer_settings(names=[1])
    with pytest.raises(Error, match="host: is missing"):
        read_settings(Section({"names": [], "port": 1}, "here"))


def test_a_stalled_client_is_cut_off_and_the_others_go_on():
    with Running(patience=1.0, rate=100.0) as running:
        stalled, other = Page(running.server.address), Page(running.server.address)
        stalled.state(lambda _: True, "a state")
        stalled.stall()
        # big enough that no buffer on the way holds what a second brings
        big = protocol.Fan((0.0, 0.0, 0.0), 0.0, 0.001, 0.0, 9.0, np.ones(60_000))
        deadline = time.monotonic() + 20.0
        while running.hub.clients == 2:
            assert time.monotonic() < deadline
            running.hub.state(protocol.State(t=0.0, wall=0.0), dict.fromkeys([(i, 0) for i in range(5)], big))
            time.sleep(0.01)
        assert running.hub.dropped > 0
        other.wait(lambda: running.server.accounts()[1] == 1, "the server to have counted it")
        (account,), _ = running.server.accounts()
        assert account.shown > 0
        assert account.seconds > 0
        other.wait(lambda: stalled.cut_off, "the kernel to throw away what was never sent")
        seen = other.counts["state"]
        other.wait(lambda: other.counts["state"] > seen + 10, "the other goes on")
        stalled._reads = True
        for page in (stalled, other):
            page.close()


def test_a_slow_client_gets_the_newest_and_memory_is_bounded():
    hub = Hub()
    mailbox = hub.join(lambda: None)
    for t in range(1000):
        hub.state(protocol.State(t=float(t), wall=0.0), {(0, 0): protocol.Fan((0, 0, 0), 0, 1, 0, 1, np.ones(10))})
    waiting = mailbox.take()
    assert len(waiting) == 2
    assert json.loads(waiting[0])["t"] == 999.0
    assert (mailbox.dropped, mailbox.missed, mailbox.shown) == (2 * 999, 999, 1)
    hub.leave(mailbox)
    assert hub.dropped == 2 * 999
    for _ in range(100):
        hub.map(b"png", 1, 1, 0.05, (0.0, 0.0, 0.0))
    assert sorted(hub.maps) == [99, 100]


def test_scans_of_another_world_are_forgotten():
    hub = Hub()
    mailbox = hub.join(lambda: None)
    hub.state(protocol.State(t=0.0, wall=0.0), {(3, 1): protocol.Fan((0, 0, 0), 0, 1, 0, 1, np.ones(10))})
    hub.world(protocol.World((), None))
    assert [type(message) for message in mailbox.take()] == [str, str]
    late = hub.join(lambda: None)
    assert [type(message) for message in late.take()] == [str, str]


def test_a_page_comes_back_after_the_server_was_started_anew(running):
    page = Page(running.server.address)
    page.let_in(running.server.new_address())
    session = page.newest["hello"]["session"]
    port = running.server.address.rsplit(":", 1)[1].strip("/")
    running.close()
    page.wait(lambda: page.closed, "the end")
    with Running(port=int(port)) as again:
        page = Page(again.server.address)
        page.say(type="session", session=session)
        page.wait(lambda: None in page.replies, "an answer")
        assert "may have been restarted" in page.replies[None]["message"]
        page.let_in(again.server.new_address())
        page.close()


def test_poses_of_a_drag_overtake_each_other_and_urgent_commands_everything(driver, running):
    running.rig.slow.set()
    driver.say(type="command", id=100, name="reset")
    driver.wait(lambda: ("reset", {}) in running.rig.commands, "a command under way")
    for number in range(20):
        driver.say(type="command", id=200 + number, name="set_pose", body="2", x=0.1 * number, y=0.0, yaw=0.0)
    driver.say(type="command", id=300, name="estop", on=True)
    driver.wait(lambda: 300 in driver.replies, "the stop, before anything else")
    assert running.rig.estop
    running.rig.slow.clear()
    driver.wait(lambda: 219 in driver.replies, "the last pose")
    driver.wait(lambda: {200 + n for n in range(20)} <= driver.replies.keys(), "an answer to each")
    assert [n for n in range(200, 220) if driver.replies[n]["ok"]] == [219]
    assert [name for name, _ in running.rig.commands].count("set_pose") == 1


def test_the_stick_is_obeyed_in_order_and_stops_though_all_else_hangs(running):
    """Nine pages, each with a command that hangs: more than are under way at a time."""
    running.rig.slow.set()
    pages = [Page(running.server.address) for _ in range(9)]
    try:
        for page in pages:
            page.let_in(running.server.new_address())
            page.say(type="command", id=1, name="reset")
        speeds = [0.001 * number for number in range(200)]
        for number, v in enumerate(speeds):
            pages[-1].say(type="command", id=number, name="drive", v=v, w=0.0)
        assert pages[-1].ask("estop", on=True)["ok"]
        pages[-1].wait(lambda: len(pages[-1].replies) > len(speeds), "an answer to each")
        assert [values["v"] for name, values in running.rig.commands if name == "drive"] == speeds
    finally:
        running.rig.slow.clear()
        for page in pages:
            page.close()


def test_too_many_commands_are_refused(driver, running):
    running.rig.slow.set()
    for number in range(100):
        driver.say(type="command", id=number, name="pause", on=True)
    driver.wait(lambda: 99 in driver.replies, "a refusal")
    assert "waiting already" in driver.replies[99]["message"]
    running.rig.slow.clear()
    driver.wait(lambda: len(driver.replies) == 100, "an answer to each")


def test_a_client_that_goes_in_the_middle_of_a_command_harms_nobody(driver, running):
    other = Page(running.server.address)
    running.rig.slow.set()
    driver.say(type="command", id=1, name="reset")
    driver.wait(lambda: running.rig.commands, "a command under way")
    driver.close()
    running.rig.slow.clear()
    other.state(lambda _: True, "the other goes on")
    other.close()


def test_numbers_that_are_none_become_null():
    state = protocol.State(t=float("nan"), wall=np.float64(1.5), poses={"1": (np.float32(0.5), float("inf"), 0)})
    content = json.loads(protocol.text(state))
    assert content["t"] is None
    assert content["poses"]["1"] == [0.5, None, 0]
    with pytest.raises(ValueError, match="equally long"):
        protocol.scan(protocol.Fan((0, 0, 0), 0, 1, 0, 1, [1.0], error=[1.0, 2.0]), (0, 0))
    with pytest.raises(ValueError, match="room for 65535"):
        protocol.scan(protocol.Fan((0, 0, 0), 0, 1, 0, 1, np.ones(70_000)), (0, 0))
    assert len(protocol.particles(np.zeros((200_000, 3)))) < 8 + 12 * 65_536

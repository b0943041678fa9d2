# SPDX-License-Identifier: BSD-3-Clause
"""Who may connect to the viewer's server, who may command it, and which files it gives away."""

import urllib.error
import urllib.request

import aiohttp
import pytest
from viewer_rig import Running

from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.errors import Error
from kurumaisu.viewer import access


def get(running, path, **headers):
    """Return status, headers and body of a request."""
    request = urllib.request.Request(running.server.address.rstrip("/") + path, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read()


def test_a_token_is_good_once(running, driver):
    address = running.server.new_address()
    second = Page(address)
    second.let_in(address)
    third = Page(address)
    third.say(type="token", token=address.split("#token=")[1])
    third.wait(lambda: None in third.replies, "a refusal")
    assert "used already" in third.replies[None]["message"]
    for page in (second, third):
        page.close()


def test_guessing_tokens_ends_the_connection(page):
    for _ in range(5):
        page.say(type="token", token="guess")
    page.wait(lambda: page.closed, "the end of the connection")


def test_without_control_no_token_is_good_and_nobody_commands():
    with Running(control=False, mode="robot") as robot:
        with pytest.raises(Error, match="is read-only"):
            robot.server.new_address()
        page = Page(robot.server.address)
        page.wait(lambda: "hello" in page.newest, "hello")
        assert page.newest["hello"]["abilities"] == []
        for name, arguments in (("drive", {"v": 0.1, "w": 0.0}), ("estop", {"on": False}), ("reset", {})):
            assert "is read-only" in page.ask(name, **arguments)["message"]
        assert robot.rig.commands == []
        page.close()


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "https://127.0.0.1", "http://127.0.0.1:1"])
def test_a_foreign_page_cannot_connect(running, origin):
    with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
        Page(running.server.address, origin=origin)
    assert refusal.value.status == 403
    assert running.hub.clients == 0


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8642", "localhost.evil.example", "127.0.0.1.nip.io", "[", ""]
)
def test_a_foreign_name_is_refused(running, host):
    """DNS rebinding: a page of evil.example, whose name suddenly means 127.0.0.1."""
    status, _, body = get(running, "/", Host=host)
    assert status in (400, 403)
    assert b"kurumaisu</title>" not in body


@pytest.mark.parametrize("host", ["localhost:9000", "127.0.0.1", "[::1]:9000", "192.168.0.7:8642"])
def test_addresses_and_localhost_are_no_foreign_names(running, host):
    assert get(running, "/", Host=host)[0] == 200


def test_a_name_can_be_allowed():
    access.check_host("Chair.local:8642", ("chair.local",))
    with pytest.raises(Error, match="names"):
        access.check_host("chair.local", ())
    with pytest.raises(Error, match="None"):
        access.check_host(None, ())


def test_every_answer_has_the_policy(running):
    for path in ("/", "/page/moon.js", "/map/7.png", "/report/moon.html", "/moon"):
        _, headers, _ = get(running, path)
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize(
    "path",
    [
        "/page/../server.py",
        "/page/..%2Fserver.py",
        "/page/..%2F..%2Fcritic%2Freport.html",  # of a kind that is served
        "/page/%2e%2e%2f%2e%2e%2fcritic%2freport.html",
        "/page/%2e%2e/hub.py",
        "/page//etc/passwd",
        "/page/.hidden.js",
    ],
)
def test_no_file_beside_the_page_is_served(running, path):
    status, _, body = get(running, path)
    assert status in (400, 403, 404)
    assert b"import" not in body
    assert b"<html" not in body
    assert b"root:" not in body

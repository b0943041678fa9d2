# SPDX-License-Identifier: BSD-3-Clause
"""Files of the page, as a browser's cache asks for them."""

import gzip
import http.client

import pytest
from viewer_rig import Running

from kurumaisu.viewer.server import PAGE


@pytest.fixture(scope="module")
def running():
    with Running() as one:
        yield one


def get(running, path, **headers):
    """Return status, headers and body of a request."""
    host, port = running.server.address.removeprefix("http://").strip("/").split(":")
    connection = http.client.HTTPConnection(host, int(port), timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


@pytest.mark.parametrize(("path", "name"), [("/", "index.html"), ("/page/main.js", "main.js")])
def test_text_is_squeezed_for_who_takes_that_and_only_for_him(running, path, name):
    content = (PAGE / name).read_bytes()
    status, headers, body = get(running, path)
    assert (status, body, headers["Content-Encoding"]) == (200, content, None)
    status, squeezed, body = get(running, path, **{"Accept-Encoding": "gzip"})
    assert (status, gzip.decompress(body), squeezed["Content-Encoding"]) == (200, content, "gzip")
    assert len(body) < len(content) / 2
    for answer in (headers, squeezed):
        assert answer["Vary"] == "Accept-Encoding"
        assert answer["Cache-Control"] == "no-cache"
        assert answer["Content-Type"].startswith("text/")
        assert "default-src 'none'" in answer["Content-Security-Policy"]


def test_who_has_a_file_does_not_get_it_again(running):
    _, headers, _ = get(running, "/page/main.js")
    for known in (headers["ETag"], f'"other", {headers["ETag"]}', "*"):
        status, again, body = get(running, "/page/main.js", **{"If-None-Match": known, "Accept-Encoding": "gzip"})
        assert (status, body, again["ETag"]) == (304, b"", headers["ETag"])
        assert again["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize("known", ['"other"', "nonsense", '"', "W/", ""])
def test_who_has_another_one_gets_this(running, known):
    status, _, body = get(running, "/page/main.js", **{"If-None-Match": known})
    assert (status, body) == (200, (PAGE / "main.js").read_bytes())


def test_a_changed_file_has_another_tag(running, tmp_path, monkeypatch):
    monkeypatch.setattr("kurumaisu.viewer.server.PAGE", tmp_path)
    tags = []
    for content in ("one", "two"):
        (tmp_path / "index.html").write_text(content)
        status, headers, body = get(running, "/", **({"If-None-Match": tags[-1]} if tags else {}))
        assert (status, body) == (200, content.encode())
        tags.append(headers["ETag"])


def test_a_page_that_is_not_there_has_no_tag(running):
    status, headers, _ = get(running, "/page/moon.js", **{"If-None-Match": "*"})
    assert (status, headers["ETag"]) == (404, None)

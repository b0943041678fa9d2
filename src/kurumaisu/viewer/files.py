# SPDX-License-Identifier: BSD-3-Clause
"""The small files that a page is made of: squeezed, and not sent again to who has them."""

from __future__ import annotations

import hashlib
from pathlib import Path

from aiohttp import ETag, web

from kurumaisu.bounded_files import MOST_PAGE, read_bytes

_TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".png": "image/png",
}
_SQUEEZED_ALREADY = (".png",)


def served(request: web.Request, path: Path) -> web.Response:
    """Return a file, of a kind that pages are made of. Raise HTTPNotFound for others."""
    kind = _TYPES.get(path.suffix)
    if kind is None or not path.is_file():
        raise web.HTTPNotFound
    body = read_bytes(path, MOST_PAGE)
    # by content, as files of an upgraded package may have older dates; weak, as the squeezed one is not the same bytes
    tag = ETag(hashlib.sha256(body).hexdigest()[:32], is_weak=True)
    known = request.if_none_match or ()
    if any(one.value in (tag.value, "*") for one in known):
        response = web.Response(status=304)
    else:
        response = web.Response(body=body, content_type=kind, charset="utf-8" if kind.startswith("text/") else None)
        if path.suffix not in _SQUEEZED_ALREADY:
            response.enable_compression()  # if the client takes any
    response.etag = tag
    response.headers["Cache-Control"] = "no-cache"  # keep it, but ask each time: another version may run here
    response.headers["Vary"] = "Accept-Encoding"
    return response

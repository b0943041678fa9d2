# SPDX-License-Identifier: BSD-3-Clause
"""The critic's report as the viewer serves it: the very page, and a script of our own that leads from it to the map."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

from kurumaisu.errors import Error

NAME = "report.html"
ADDRESS = f"report/{NAME}"
_LARGEST = 50_000_000  # bytes: the critic's are below 2 MB
_STYLE = re.compile(rb"<style[^>]*>(.*?)</style>", re.DOTALL)
_END = b"</body>"
_SCRIPT = b'<script type="module" src="../page/report/report.js"></script>\n'


def check(folder: Path) -> Path:
    """Return the report of a folder that the critic wrote into. Raise Error where there is none."""
    path = folder / NAME
    if not path.is_file():
        raise Error(f"--report: {path}: there is no such file; the critic writes it into the folder of its --output")
    return path


def page(content: bytes) -> tuple[bytes, dict[str, str]]:
    """Return a report to be served, and the headers that let it work.

    No inline script runs, whatever the file contains. Its style sheets may act, each by its hash, and the style
    attributes that pictures are full of.
    """
    if len(content) > _LARGEST:
        raise Error(f"the report is larger than {_LARGEST} bytes")
    sheets = (base64.b64encode(hashlib.sha256(text).digest()).decode() for text in _STYLE.findall(content))
    hashes = " ".join(dict.fromkeys(f"'sha256-{text}'" for text in sheets))
    policy = (
        f"default-src 'none'; script-src 'self'; style-src-elem 'self' {hashes}; style-src-attr 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    head, end, tail = content.rpartition(_END)
    return head + _SCRIPT + end + tail if end else content + _SCRIPT, {"Content-Security-Policy": policy}

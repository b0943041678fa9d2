# SPDX-License-Identifier: BSD-3-Clause
"""The files of the source tree, and a hash of what a check read."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def files(*suffixes: str) -> list[Path]:
    """Return the files that git tracks or would track, of these suffixes (all if none are given)."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z", "-co", "--exclude-standard"]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split("\0")
    paths = (ROOT / name for name in sorted(set(names)) if name)
    return [path for path in paths if path.is_file() and (not suffixes or path.suffix in suffixes)]


def python_files() -> list[Path]:
    """Return the Python files, scripts without suffix included."""
    scripts = (path for path in files("") if b"python" in path.read_bytes().split(b"\n", 1)[0])
    return [*files(".py"), *scripts]


def content_hash(paths: Iterable[Path], *more: str) -> str:
    """Return a hash of the names and contents of files, the same in all clones, and of more text."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        # what is built may change meanwhile; of a source, what it was when this was asked first
        digest.update(_digest(path) if ".ws" in path.parts else _first_digest(path))
    for text in more:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


def _digest(path: Path) -> bytes:
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    head = f"{name}\0{path.stat().st_mode}\0".encode()
    return hashlib.sha256(head + path.read_bytes()).digest()


_first_digest = cache(_digest)

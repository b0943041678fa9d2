# SPDX-License-Identifier: BSD-3-Clause
"""Files from outside: only regular ones are read, and none beyond its limit."""

from __future__ import annotations

import os
import stat
from io import FileIO
from pathlib import Path

from kurumaisu.errors import Error

MOST_TEXT = 2**20  # [bytes] of a file of settings or of a model, which have some thousand
MOST_TABLE = 2**30  # [bytes] of a table: a day of scans has a third of it
MOST_RECORDING = 2**38  # [bytes] of a bag, which is read piece by piece
MOST_RAWLOG = 8 * 10**9  # [bytes] of a rawlog; src/slam/mapping/rawlog.cpp has the same limit for it unpacked
MOST_IMAGE = 2**29  # [bytes] of an image's file; its pixels have a limit, too
MOST_STATE = 2**30  # [bytes] of a saved state of the simulator
MOST_PAGE = 2**28  # [bytes] of a page and its pictures

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_bytes(path: Path, most: int) -> bytes:
    """Return what is in a file. Raise Error naming it if it is no regular file, too large, or cannot be read."""
    try:
        with FileIO(str(path), opener=_open_at_once) as file:
            _check(path, os.fstat(file.fileno()), most)
            data = _at_most(file, most + 1)
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise Error(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    if len(data) > most:  # files of /proc have no size, and others may grow
        raise _too_large(path, len(data), most)
    return data


def read_text(path: Path, most: int, encoding: str = "utf-8") -> str:
    """Return the text of a file, line ends as they are. Raise Error as read_bytes, and for another encoding."""
    data = read_bytes(path, most)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise Error(f"{path}: is not {encoding.removesuffix('-sig').upper()} text") from error


def check_file(path: Path, most: int) -> None:
    """Raise Error as read_bytes does, of a file that a library is to read by itself."""
    try:
        _check(path, path.stat(), most)
    except (OSError, ValueError) as error:
        raise Error(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def _open_at_once(name: str, flags: int) -> int:
    """Open without waiting: a pipe would wait for who writes into it."""
    return os.open(name, flags | os.O_NONBLOCK | os.O_NOCTTY)


def _check(path: Path, found: os.stat_result, most: int) -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = next((words for is_one, words in _KINDS if is_one(found.st_mode)), "something else")
        raise Error(f"{path}: must be a regular file, and is {kind}")
    if found.st_size > most:
        raise _too_large(path, found.st_size, most)


def _at_most(file: FileIO, count: int) -> bytes:
    data = bytearray()
    while len(data) < count and (more := file.read(count - len(data))):
        data += more
    return bytes(data)


def _too_large(path: Path, size: int, most: int) -> Error:
    return Error(f"{path}: has {size} bytes or more, and at most {most} are read of such a file")

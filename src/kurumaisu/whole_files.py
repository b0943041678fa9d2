# SPDX-License-Identifier: BSD-3-Clause
"""Files that are there whole, or as they were before; those of one result all together."""

from __future__ import annotations

import os
import stat
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from kurumaisu.errors import Error


def write_whole(contents: Mapping[Path, str | bytes], gone: Iterable[Path] = ()) -> None:
    """Write the files of one result: all beside their places first and onto the disk, then each gets its name.

    gone: files of an older result that this one has not, which are taken away. A link is followed, and a file keeps
    its permissions. Raise Error naming what cannot be written; all is as it was then.
    """
    parts: dict[Path, Path] = {}  # by place
    path = Path()
    try:
        for path, content in contents.items():
            place = Path(os.path.realpath(path))
            mode = _mode(place)
            parts[place] = part = place.with_name(f".kurumaisu-{threading.get_native_id()}-{len(parts)}.part")
            _write(part, content.encode() if isinstance(content, str) else content, mode)
        for place, part in parts.items():
            path = place
            part.replace(place)
        for path in gone:
            path.unlink(missing_ok=True)
        for folder in {place.parent for place in parts}:
            _sync_folder(folder)
    except (OSError, ValueError) as error:  # ValueError: a null byte in a name
        raise Error(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}") from error
    finally:
        for part in parts.values():
            with suppress(OSError):
                part.unlink(missing_ok=True)


def _mode(place: Path) -> int | None:
    """Return the permissions of a file that is there. Raise Error for what is no file: it would be one then."""
    try:
        found = place.stat()
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(found.st_mode):
        raise Error(f"{place}: cannot be written: it is there, and is no regular file")
    return stat.S_IMODE(found.st_mode)


def _write(part: Path, content: bytes, mode: int | None) -> None:
    part.unlink(missing_ok=True)  # of a process that ended here
    with part.open("xb") as file:
        if mode is not None:
            os.fchmod(file.fileno(), mode)
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # some file systems cannot
            os.fsync(descriptor)
    finally:
        os.close(descriptor)

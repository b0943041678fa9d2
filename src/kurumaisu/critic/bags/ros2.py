# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 2: a folder with metadata.yaml, or one of its .db3 files alone."""

from __future__ import annotations

import struct
from collections.abc import Collection, Generator
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from kurumaisu import settings
from kurumaisu.bounded_files import MOST_RECORDING, check_file
from kurumaisu.critic.bags.limits import Unpacker, check_packed
from kurumaisu.critic.bags.mcap_file import McapFile
from kurumaisu.errors import Error

METADATA = "metadata.yaml"
_HEAD = struct.Struct(">16xH10xI")  # of an SQLite file: bytes of a page, 1 for 65536, and how many pages


class _Times:
    """Makes a reader of rosbags say when its messages came."""

    @property
    def start_time(self: Any) -> int:
        """Time of the first message [ns]."""
        return int(self.metadata.start_time)

    @property
    def end_time(self: Any) -> int:
        """Time just after the last message [ns]."""
        return int(self.metadata.end_time)


class Database(_Times, Sqlite3Reader):
    """One .db3 file."""

    path: Path

    def open(self) -> None:
        """Open. Raise Error for a file that was cut, or beside which the recorder left messages."""
        waiting = self.path.with_name(f"{self.path.name}-wal")
        if waiting.exists() and waiting.stat().st_size:
            raise Error(
                f"{self.path}: was not closed: {waiting.name} holds messages; "
                f"sqlite3 {self.path.name} 'PRAGMA wal_checkpoint(TRUNCATE)' puts them in"
            )
        _check_whole(self.path)
        super().open()


class Ros2Bag(_Times, DirectoryReader):
    """A folder with metadata.yaml, which names its files."""

    path: Path

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        plugins: Any = {"mcap": McapFile, "sqlite3": Database}
        self.STORAGE_PLUGINS = plugins
        self._messages_are_packed = False
        self._unpacker = Unpacker(path, sum(item.stat().st_size for item in path.iterdir() if item.is_file()))

    def open(self) -> None:
        """Open. Raise Error for files that are not there, no regular ones, or too large unpacked."""
        for file, mode in _files(self.path):
            check_file(file, MOST_RECORDING)
            if mode == "file":
                check_packed(file)
        super().open()
        # Unpacked here, to a limit, rather than there without one.
        self._messages_are_packed = self.metadata.compression_mode == "message"
        self.metadata = self.metadata._replace(compression_mode=None)

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield connection, time of receipt [ns] and data, file by file, from start until before stop."""
        for place, (connection, received, data) in enumerate(super().messages(connections, start, stop)):
            packed = self._messages_are_packed
            yield connection, received, self._unpacker.unpack("zstd", data, place) if packed else data


def _check_whole(path: Path) -> None:
    """Raise Error for a database of fewer pages than its head counts: SQLite would read zeros there."""
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
    if len(head) == _HEAD.size:
        page, pages = _HEAD.unpack(head)
        size, expected = path.stat().st_size, pages * (65536 if page == 1 else page)
        if size < expected:
            raise Error(f"{path}: is cut: it has {size} of {expected} bytes")


def _files(path: Path) -> list[tuple[Path, str]]:
    """Return the files that metadata.yaml names, and how they are packed. Raise Error naming file and key."""
    top = settings.load(path / METADATA).section("rosbag2_bagfile_information")
    names = top.take("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise top.error("relative_file_paths", "must be a list of files")
    mode = str(top.take("compression_mode")).lower() if "compression_mode" in top else ""
    return [(path / Path(name).name, mode) for name in names]

# SPDX-License-Identifier: BSD-3-Clause
"""Which files are bags, and what opens each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol

from rosbags.interfaces import Connection

from kurumaisu.bounded_files import MOST_RECORDING, check_file
from kurumaisu.critic.bags.mcap_file import McapFile
from kurumaisu.critic.bags.ros1 import Ros1Bag
from kurumaisu.critic.bags.ros1_old import MAGIC, OldRos1Bag
from kurumaisu.critic.bags.ros2 import METADATA, Database, Ros2Bag

SUFFIXES = (".bag", ".mcap", ".db3")
_MENDING = {
    ".bag": ("ROS 1 bag", "rosbag reindex"),
    ".mcap": ("MCAP file", "mcap recover"),
    ".db3": ("ROS 2 bag", "ros2 bag reindex"),
}


class Bag(Protocol):
    """An open bag, a context that closes it; times of receipt [ns], the end just after the last message."""

    @property
    def connections(self) -> list[Connection]:
        """Who published what."""

    @property
    def start_time(self) -> int:
        """Time of the first message."""

    @property
    def end_time(self) -> int:
        """Time just after the last message."""

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of receipt and data."""

    def __enter__(self) -> Bag:
        """Open."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> object:
        """Close."""


def is_bag(path: Path) -> bool:
    """Tell by its name whether a path is a bag: a file, or a folder of ROS 2 with its metadata.yaml."""
    return path.suffix in SUFFIXES if not path.is_dir() else (path / METADATA).is_file()


def bag_name(path: Path) -> str:
    """Return the name of a bag's run."""
    return path.resolve().name if path.is_dir() else path.stem


def opened(path: Path) -> Bag:
    """Return a bag to be opened as a context. Raise Error for what is no regular file, or too large."""
    if path.is_dir():
        return Ros2Bag(path)
    check_file(path, MOST_RECORDING)
    readers: dict[str, Callable[[Path], Bag]] = {".bag": _ros1, ".mcap": McapFile, ".db3": Database}
    return readers[path.suffix](path)


def _ros1(path: Path) -> Bag:
    with path.open("rb") as file:
        old = file.read(len(MAGIC)) == MAGIC
    return OldRos1Bag(path) if old else Ros1Bag(path)


def broken(path: Path) -> str:
    """Return what to say of a bag that cannot be read."""
    kind, mending = _MENDING[path.suffix if path.suffix in _MENDING and path.is_file() else ".db3"]
    return f"{path}: is not a complete {kind} ({mending} may help)"

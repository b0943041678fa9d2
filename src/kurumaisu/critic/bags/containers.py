# SPDX-License-Identifier: BSD-3-Clause
"""Which files are bags, and what opens each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from kurumaisu.bounded_files import MOST_RECORDING, check_file
from kurumaisu.critic.bags.mcap_file import McapFile
from kurumaisu.critic.bags.ros1 import MAGIC, OldRos1Bag, Ros1Bag
from kurumaisu.critic.bags.ros2 import METADATA, Database, Ros2Bag
from kurumaisu.errors import Error

SUFFIXES = (".bag", ".mcap", ".db3")
_MENDING = {
    ".bag": ("ROS 1 bag", "rosbag reindex"),
    ".mcap": ("MCAP file", "mcap recover"),
    ".db3": ("ROS 2 bag", "ros2 bag reindex"),
}

# Each has connections, start_time and end_time [ns], just after the last message, and messages().
Bag = Ros1Bag | OldRos1Bag | McapFile | Database | Ros2Bag


def is_bag(path: Path) -> bool:
    """Tell by its name whether a path is a bag: a file, or a folder of ROS 2 with its metadata.yaml."""
    return path.suffix in SUFFIXES if not path.is_dir() else (path / METADATA).is_file()


def bag_name(path: Path) -> str:
    """Return the name of a bag's run."""
    return path.resolve().name if path.is_dir() else path.stem


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a bag, and close it. Raise Error for what is no regular file, too large, or damaged."""
    try:
        if not path.is_dir():
            check_file(path, MOST_RECORDING)
        readers: dict[str, Callable[[Path], Bag]] = {".bag": _ros1, ".mcap": McapFile, ".db3": Database}
        bag = Ros2Bag(path) if path.is_dir() else readers[path.suffix](path)
        bag.open()
        try:
            yield bag
        finally:
            bag.close()
    except Error:
        raise
    except OSError as error:
        raise Error(f"{path}: {error.strerror or error}") from error
    except Exception as error:
        raise Error(f"{broken(path)}: {str(error) or type(error).__name__}") from error


def _ros1(path: Path) -> Bag:
    with path.open("rb") as file:
        old = file.read(len(MAGIC)) == MAGIC
    return OldRos1Bag(path) if old else Ros1Bag(path)


def broken(path: Path) -> str:
    """Return what to say of a bag that cannot be read."""
    kind, mending = _MENDING[path.suffix if path.suffix in _MENDING and path.is_file() else ".db3"]
    return f"{path}: is not a complete {kind} ({mending} may help)"

# SPDX-License-Identifier: BSD-3-Clause
"""Read topics of a ROS 1 bag, without ROS: a bag carries the definitions of its messages."""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import lz4.frame
import numpy as np
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Chunk, Compression, IndexData, decompressors
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from kurumaisu.bounded_files import MOST_RECORDING, check_file
from kurumaisu.critic.data import messages
from kurumaisu.critic.data.bag_parts import parts_of
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

_HEADER = "std_msgs/msg/Header"
_MOST_UNPACKED = 2**28  # [bytes] of a chunk; rosbag's have some 800 kB and at most one message more
_LEAST_UNPACKED = 2**26  # [bytes] of a whole bag, and
_TIMES_UNPACKED = 200  # times its size: scans are packed 2 to 20 times


@dataclass
class Topic:
    """Messages of one topic in the order of receipt: times [ns], whether stamped, one row each."""

    name: str
    type: str
    received: list[int] = field(default_factory=list)
    stamps: list[int | None] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)

    def times(self) -> FloatArray:
        """Return the stamp of each message, or else when it was received, (n,) [s]."""
        pairs = zip(self.stamps, self.received, strict=True)
        # Integers divide to the float nearest to the decimal number of seconds, the one CSV reads.
        return np.array([(stamp or received) / 1_000_000_000 for stamp, received in pairs])

    def lateness(self) -> float | None:
        """Return the median of receipt minus stamp [s], None when nothing is stamped."""
        late = [r - s for s, r in zip(self.stamps, self.received, strict=True) if s]
        return float(np.median(late)) / 1e9 if late else None


def read_topics(
    path: Path, parts: dict[str, str], instead: Mapping[str, Callable[[Any], Any]] = MappingProxyType({})
) -> dict[str, Topic]:
    """Read the topics that are in the bag, or in all parts of one that was split, by part of a run.

    parts: part by absolute topic.
    instead: what to keep of a row in place of it, by part, where an hour of rows would fill the memory.
    Raise Error naming file, topic and type for what cannot be read.
    """
    found: dict[str, Topic] = {}
    for bag in parts_of(path):
        _read_into(found, bag, parts, instead)
    return found


def _read_into(
    found: dict[str, Topic], path: Path, parts: dict[str, str], instead: Mapping[str, Callable[[Any], Any]]
) -> None:
    check_file(path, MOST_RECORDING)
    try:
        with _Reader(path) as reader:
            chosen = [connection for connection in reader.connections if _absolute(connection.topic) in parts]
            convert = {
                connection.id: _converter(path, parts[_absolute(connection.topic)], connection) for connection in chosen
            }
            for connection, received, data in reader.messages(chosen) if chosen else ():
                part = parts[_absolute(connection.topic)]
                topic = found.setdefault(part, Topic(connection.topic, _ros(connection.msgtype)))
                message, row = convert[connection.id](data)
                row = instead[part](row) if part in instead else row
                topic.received.append(received)
                topic.stamps.append(_stamp(message))
                topic.rows.append(row)
    except Error:
        raise
    except OSError as error:
        raise Error(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # whatever a parser trips over in a damaged file
        told = str(error) or type(error).__name__
        raise Error(f"{path}: is not a complete ROS 1 bag (rosbag reindex may help): {told}") from error


class _Reader(Reader):
    """Also reads bags of 2010, whose index records state a wrong length; the count of entries is right.

    Nothing is unpacked beyond a limit: a kilobyte can be made to hold gigabytes.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._sizes: dict[int, int] = {}  # [bytes] of chunks, unpacked, by their places
        self._most = _LEAST_UNPACKED + _TIMES_UNPACKED * path.stat().st_size  # [bytes] of all of them

    def read_chunk(self) -> Chunk:
        chunk = super().read_chunk()
        unpack = _UNPACKERS.get(chunk.decompressor)
        return chunk if unpack is None else chunk._replace(decompressor=partial(self._unpacked, chunk.datapos, unpack))

    def _unpacked(self, place: int, unpack: Callable[[bytes, int], bytes], data: bytes) -> bytes:
        unpacked = unpack(data, _MOST_UNPACKED + 1)
        self._sizes[place] = len(unpacked)
        if len(unpacked) > _MOST_UNPACKED:
            raise Error(f"{self.path}: a chunk has more than {_MOST_UNPACKED} bytes unpacked")
        if sum(self._sizes.values()) > self._most:
            raise Error(f"{self.path}: has more than {self._most} bytes unpacked: {_TIMES_UNPACKED} times its size")
        return unpacked

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        assert self.bio
        start = self.bio.tell()
        try:
            super().read_index_data(pos, indexes)
        except AssertionError:
            if self.index_data_header_offsets is None:
                raise
            self.bio.seek(start)
            header = self.bio.read(55)
            connection, count = (struct.unpack_from("<I", header, at)[0] for at in self.index_data_header_offsets)
            for seconds, ns, offset in struct.iter_unpack("<III", self.bio.read(12 * count)):
                indexes[connection].append(IndexData(seconds * 1_000_000_000 + ns, pos, offset))


# Each returns so many bytes at most.
_UNPACKERS: Mapping[Callable[[bytes], bytes], Callable[[bytes, int], bytes]] = {
    decompressors[Compression.BZ2.value]: lambda data, most: bz2.BZ2Decompressor().decompress(data, most),
    decompressors[Compression.LZ4.value]: lambda data, most: lz4.frame.LZ4FrameDecompressor().decompress(data, most),
}


def _absolute(topic: str) -> str:
    """Return a topic's absolute name: rosbag records a relative one as it was typed."""
    return f"/{topic.lstrip('/')}"


def _converter(path: Path, part: str, connection: Any) -> Callable[[bytes], tuple[Any, Any]]:
    """Return a function from raw data to a message and its row, built from the bag's own definition."""
    kind = connection.msgtype
    to_row = messages.converter(part, kind)
    if to_row is None:
        accepted = ", ".join(_ros(name) for name in messages.accepted(part))
        raise Error(f"{path}: {connection.topic}: is of type {_ros(kind)}, not of {accepted}")
    store = get_typestore(Stores.EMPTY)
    # Bags of 2010 call the header roslib/Header, so its definition is not found among theirs.
    header = {_HEADER: get_typestore(Stores.ROS1_NOETIC).fielddefs[_HEADER]}
    store.register({**header, **get_types_from_msg(connection.msgdef.data, kind)})

    def convert(data: bytes) -> tuple[Any, Any]:
        message = store.deserialize_ros1(data, kind)
        try:
            return message, to_row(message)
        except AttributeError as error:
            raise Error(f"{path}: {connection.topic}: {_ros(kind)} has another definition here: {error}") from error

    return convert


def _stamp(message: Any) -> int | None:
    header = getattr(message, "header", None)
    if header is None:
        return None
    stamp = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
    return stamp or None


def _ros(kind: str) -> str:
    return kind.replace("/msg/", "/")

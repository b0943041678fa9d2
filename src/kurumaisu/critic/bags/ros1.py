# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 1: format 2.0, and 1.2 of before C Turtle (2010), a record for each message, and no chunks."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path

from rosbags.interfaces import Connection, ConnectionExtRosbag1, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import (
    Chunk,
    Compression,
    Header,
    IndexData,
    decompressors,
    normalize,
    read_bytes,
    read_uint32,
)
from rosbags.typesys.msg import normalize_msgtype

from kurumaisu.critic.bags.limits import LATEST, Unpacker

_PACKED: dict[Callable[[bytes], bytes], str] = {
    decompressors[kind.value]: kind.value for kind in Compression if kind is not Compression.NONE
}
MAGIC = b"#ROSBAG V1.2\n"
_DEFINITION, _MESSAGE = 1, 2  # kinds of records


class Ros1Bag(Reader):
    """Also reads bags of 2010, whose index records state a wrong length; the count of entries is right."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._unpacker = Unpacker(path, path.stat().st_size)

    def read_chunk(self) -> Chunk:
        """Read the head of a chunk, which will be unpacked to a limit."""
        chunk = super().read_chunk()
        kind = _PACKED.get(chunk.decompressor)
        if kind is None:
            return chunk
        return chunk._replace(decompressor=partial(self._unpacker.unpack, kind, place=chunk.datapos))

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read the index of a chunk."""
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


class OldRos1Bag:
    """Reads from the beginning to the end; an index, where there is one, is not needed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.start_time, self.end_time = LATEST, 0  # [ns] of the first message, and just after the last

    def open(self) -> None:
        """Find the topics."""
        found: dict[str, Connection] = {}
        definitions: dict[str, MessageDefinition] = {}
        for header, _ in self._records(messages=False):
            topic, kind = normalize(header.get_string("topic")), normalize_msgtype(header.get_string("type"))
            if header.get_uint8("op") == _DEFINITION:
                definitions[kind] = MessageDefinition(MessageDefinitionFormat.MSG, header.get_string("def"))
                continue
            known = found.get(topic)
            if known is None:
                ext = ConnectionExtRosbag1(None, None)
                known = Connection(len(found), topic, kind, definitions[kind], "", 0, ext, self)
            found[topic] = known._replace(msgcount=known.msgcount + 1)
            self.start_time = min(self.start_time, _received(header))
            self.end_time = max(self.end_time, _received(header) + 1)
        self.connections = list(found.values())

    def close(self) -> None:
        """Forget the topics."""
        self.connections = []

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of receipt [ns] and data, in the order of the file."""
        wanted = {connection.topic: connection for connection in connections}
        for header, data in self._records(messages=True):
            topic = normalize(header.get_string("topic"))
            if header.get_uint8("op") == _MESSAGE and topic in wanted:
                yield wanted[topic], _received(header), data

    def _records(self, *, messages: bool) -> Iterator[tuple[Header, bytes]]:
        """Yield the heads of definitions and messages, and the messages where they are asked for."""
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            file.seek(len(MAGIC))
            while file.tell() < size:
                header = Header.read(file)
                length = read_uint32(file)
                if file.tell() + length > size:
                    raise EOFError("it ends within a record")
                kind = header.get_uint8("op")
                data = b""
                if messages and kind == _MESSAGE:
                    data = read_bytes(file, length)
                else:
                    file.seek(length, os.SEEK_CUR)
                if kind in (_DEFINITION, _MESSAGE):
                    yield header, data


def _received(header: Header) -> int:
    return header.get_uint32("sec") * 1_000_000_000 + header.get_uint32("nsec")

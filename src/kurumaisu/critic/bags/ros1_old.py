# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 1, format 1.2, which ROS wrote before C Turtle (2010): a record for each message, and no chunks."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType

from rosbags.interfaces import Connection, ConnectionExtRosbag1, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag1.reader import Header, normalize, read_bytes, read_uint32
from rosbags.typesys.msg import normalize_msgtype

from kurumaisu.critic.bags.limits import LATEST

MAGIC = b"#ROSBAG V1.2\n"
_DEFINITION, _MESSAGE = 1, 2  # kinds of records


class OldRos1Bag:
    """Reads from the beginning to the end; an index, where there is one, is not needed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.start_time, self.end_time = LATEST, 0  # [ns] of the first message, and just after the last

    def __enter__(self) -> OldRos1Bag:
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
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Forget the topics."""
        self.connections = []

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of receipt [ns] and data, in the order of the file, from start until before stop."""
        wanted = {connection.topic: connection for connection in connections}
        first, last = start or 0, LATEST if stop is None else stop
        for header, data in self._records(messages=True):
            topic = normalize(header.get_string("topic"))
            if header.get_uint8("op") == _MESSAGE and topic in wanted and first <= _received(header) < last:
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

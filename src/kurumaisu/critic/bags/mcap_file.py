# SPDX-License-Identifier: BSD-3-Clause
"""MCAP files with messages of ROS 1 or ROS 2."""

from __future__ import annotations

import io
import zlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, McapRecord, Message, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
from rosbags.typesys.msg import normalize_msgtype

from kurumaisu.critic.bags.limits import LATEST, MOST_UNPACKED, UNPACKERS, Unpacker
from kurumaisu.errors import Error, told

_FORMATS = {
    "ros1msg": MessageDefinitionFormat.MSG,
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
_ROS1, _ROS2 = "ros1", "cdr"
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER = 29  # bytes of its record, with opcode and length
_CRC = 4  # bytes of the sum that ends it
_MOST = 2**28  # bytes of a summary that is read


class McapFile:
    """Reads messages from the beginning to the end, so that a file whose end was never written is found to be cut."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.start_time, self.end_time = LATEST, 0  # [ns] of the first message, and just after the last
        self._unpacker = Unpacker(path, path.stat().st_size)

    @property
    def metadata(self) -> ReaderMetadata:
        """What a reader of ROS 2 bags knows of a file."""
        count = sum(connection.msgcount for connection in self.connections)
        duration = self.end_time - self.start_time if count else 0
        return ReaderMetadata(duration, self.start_time, self.end_time, count, None, None, None, None)

    def open(self) -> None:
        """Find the channels; some may hold messages that are none of ROS."""
        contents = stated_contents(self.path) or Contents.of(self._data())
        counts = contents.counts
        if sum(counts.values()):
            self.start_time, self.end_time = contents.first, contents.last + 1
        self.connections = [
            self._connection(channel, contents.schemas.get(channel.schema_id), counts.get(channel.id, 0))
            for channel in contents.channels.values()
        ]

    def close(self) -> None:
        """Forget the channels."""
        self.connections = []

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of logging [ns] and data, in the order of the file, from start until before stop."""
        wanted = {connection.id: connection for connection in connections}
        first, last = start or 0, LATEST if stop is None else stop
        known = {connection.id for connection in self.connections}
        for record in self._data():
            if isinstance(record, Channel) and record.id not in known:
                raise Error(f"{self.path}: what it states at its end lacks {told(record.topic)}")
            if isinstance(record, Message) and record.channel_id in wanted and first <= record.log_time < last:
                yield wanted[record.channel_id], record.log_time, record.data

    def _data(self) -> Iterator[McapRecord]:
        """Yield the records up to the end of the data, and read on to the end of the file, to see that it is there."""
        ended = False
        for record in self._records():
            ended = ended or isinstance(record, DataEnd)
            if not ended:
                yield record

    def _records(self) -> Iterator[McapRecord]:
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            whole: Any = _Whole(file, size)
            for place, record in enumerate(StreamReader(whole, emit_chunks=True, record_size_limit=size).records):
                if isinstance(record, Chunk):
                    yield from breakup_chunk(self._unpacked(record, place))
                else:
                    yield record

    def _unpacked(self, chunk: Chunk, place: int) -> Chunk:
        if not chunk.compression:
            return chunk
        if chunk.compression not in UNPACKERS:
            raise Error(f"{self.path}: is packed by {told(chunk.compression)}, which is not known")
        data = self._unpacker.unpack(chunk.compression, chunk.data, place)
        if len(data) != chunk.uncompressed_size or (
            chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc
        ):
            raise Error(f"{self.path}: a chunk is damaged: its sum or its size is wrong")
        return replace(chunk, compression="", data=data)

    def _connection(self, channel: Channel, schema: Schema | None, count: int) -> Connection:
        kind, definition = "", MessageDefinition(MessageDefinitionFormat.NONE, "")
        if schema is not None:
            kind = normalize_msgtype(schema.name) if channel.message_encoding in (_ROS1, _ROS2) else schema.name
            if schema.encoding in _FORMATS:
                definition = MessageDefinition(_FORMATS[schema.encoding], schema.data.decode())
        qos = channel.metadata.get("offered_qos_profiles", "")
        ext: ConnectionExtRosbag1 | ConnectionExtRosbag2 = ConnectionExtRosbag1(None, None)
        if channel.message_encoding != _ROS1:
            ext = ConnectionExtRosbag2(channel.message_encoding, parse_qos(qos) if qos else [])
        return Connection(channel.id, channel.topic, kind, definition, "", count, ext, self)


class _Whole:
    """A file that never gives less than it was asked for."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._size = file, size

    def read(self, count: int) -> bytes:
        if count > min(self._size - self._file.tell(), MOST_UNPACKED * 4):
            raise EOFError("it ends within a record")
        return self._file.read(count)


@dataclass
class Contents:
    """Channels, their schemas, and for each how many messages there are; times [ns] of the first and the last."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    first: int = LATEST
    last: int = 0
    stated: Statistics | None = None  # by the file itself

    @classmethod
    def of(cls, records: Iterable[McapRecord]) -> Contents:
        """Return what records tell: those of all data, or those of a summary."""
        found = cls()
        for record in records:
            if isinstance(record, Schema):
                found.schemas[record.id] = record
            elif isinstance(record, Channel):
                found.channels[record.id] = record
            elif isinstance(record, Statistics):
                found.stated = record
            elif isinstance(record, Message):
                found.counts[record.channel_id] = found.counts.get(record.channel_id, 0) + 1
                found.first, found.last = min(found.first, record.log_time), max(found.last, record.log_time)
        return found


def stated_contents(path: Path) -> Contents | None:
    """Return what a file states at its end; None where it states nothing, or what cannot be right."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(size - _FOOTER - len(_MAGIC), 0))
        end = file.read()
        if len(end) < _FOOTER + len(_MAGIC) or not end.endswith(_MAGIC):
            return None
        try:
            (footer,) = _records(end)
            start = footer.summary_start if isinstance(footer, Footer) else 0
            if not 0 < start < size or size - start > _MOST:
                return None
            file.seek(start)
            summary = file.read()
            if footer.summary_crc != zlib.crc32(summary[: -len(_MAGIC) - _CRC]):
                return None  # a sum that was not made is 0, and tells nothing either
            found = Contents.of(_records(summary))
        except (McapError, ValueError, EOFError, LookupError):
            return None
    schemas = {channel.schema_id for channel in found.channels.values()} - {0}
    stated = found.stated
    if stated is None or stated.channel_count != len(found.channels) or not schemas <= found.schemas.keys():
        return None
    counts = stated.channel_message_counts
    if sum(counts.values()) != stated.message_count or not counts.keys() <= found.channels.keys():
        return None
    return replace(found, counts=counts, first=stated.message_start_time, last=stated.message_end_time)


def _records(data: bytes) -> list[Any]:
    stream: Any = io.BytesIO(data)
    return list(StreamReader(stream, skip_magic=True, record_size_limit=len(data)).records)

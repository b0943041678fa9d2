# SPDX-License-Identifier: BSD-3-Clause
"""What an MCAP file says of itself at its end: channels and how many messages each has, without reading them."""

from __future__ import annotations

import io
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER = 29  # bytes of its record, with opcode and length
_CRC = 4  # bytes of the sum that ends it
_MOST = 2**28  # bytes of a summary that is read


@dataclass
class Contents:
    """Channels, their schemas, and for each how many messages there are; times [ns] of the first and the last."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    first: int = 0
    last: int = 0


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
            if (
                not isinstance(footer, Footer)
                or not 0 < footer.summary_start < size
                or size - footer.summary_start > _MOST
            ):
                return None
            file.seek(footer.summary_start)
            summary = file.read()
            if footer.summary_crc != zlib.crc32(summary[: -len(_MAGIC) - _CRC]):
                return None  # a sum that was not made is 0, and tells nothing either
            return _contents(_records(summary))
        except (McapError, ValueError, EOFError, LookupError, UnicodeDecodeError):
            return None


def _records(data: bytes) -> list[Any]:
    stream: Any = io.BytesIO(data)
    return list(StreamReader(stream, skip_magic=True, record_size_limit=len(data)).records)


def _contents(records: list[Any]) -> Contents | None:
    found, stated = Contents(), None
    for record in records:
        if isinstance(record, Schema):
            found.schemas[record.id] = record
        elif isinstance(record, Channel):
            found.channels[record.id] = record
        elif isinstance(record, Statistics):
            stated = record
    if stated is None or stated.channel_count != len(found.channels):
        return None
    found.counts = stated.channel_message_counts
    if sum(found.counts.values()) != stated.message_count or not found.counts.keys() <= found.channels.keys():
        return None
    if any(channel.schema_id and channel.schema_id not in found.schemas for channel in found.channels.values()):
        return None
    found.first, found.last = stated.message_start_time, stated.message_end_time
    return found

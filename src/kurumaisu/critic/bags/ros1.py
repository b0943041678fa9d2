# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 1, format 2.0."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Chunk, Compression, IndexData, decompressors

from kurumaisu.critic.bags.limits import Unpacker

_PACKED: dict[Callable[[bytes], bytes], str] = {
    decompressors[kind.value]: kind.value for kind in Compression if kind is not Compression.NONE
}


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

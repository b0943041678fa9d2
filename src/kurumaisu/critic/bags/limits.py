# SPDX-License-Identifier: BSD-3-Clause
"""How much is unpacked of what comes packed: a kilobyte can be made to hold gigabytes."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Mapping
from pathlib import Path

import lz4.frame
import zstandard

from kurumaisu.errors import Error

MOST_UNPACKED = 2**28  # [bytes] of a chunk; recorders' have 1 to 4 MB and at most one message more
LEAST_UNPACKED = 2**26  # [bytes] of a whole file, and
TIMES_UNPACKED = 200  # times its size: scans are packed 2 to 20 times


def _zstd(data: bytes, most: int) -> bytes:
    """Unpack frame by frame: the size that a frame states need not be true, nor small."""
    with zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(data, read_across_frames=True) as stream:
        return stream.read(most)


# Each returns so many bytes at most.
UNPACKERS: Mapping[str, Callable[[bytes, int], bytes]] = {
    "bz2": lambda data, most: bz2.BZ2Decompressor().decompress(data, most),
    "lz4": lambda data, most: lz4.frame.LZ4FrameDecompressor().decompress(data, most),
    "zstd": _zstd,
}


class Unpacker:
    """Unpacks the pieces of one file. Raises Error naming the file where that is too much."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._sizes: dict[int, int] = {}  # [bytes] of pieces, unpacked, by their places
        self._most = LEAST_UNPACKED + TIMES_UNPACKED * size  # [bytes] of all of them

    def unpack(self, kind: str, data: bytes, place: int) -> bytes:
        """Return a piece unpacked; place: tells the pieces apart, for one may be read again."""
        unpacked = UNPACKERS[kind](data, MOST_UNPACKED + 1)
        self._sizes[place] = len(unpacked)
        if len(unpacked) > MOST_UNPACKED:
            raise Error(f"{self._path}: a chunk has more than {MOST_UNPACKED} bytes unpacked")
        if sum(self._sizes.values()) > self._most:
            raise Error(f"{self._path}: has more than {self._most} bytes unpacked: {TIMES_UNPACKED} times its size")
        return unpacked

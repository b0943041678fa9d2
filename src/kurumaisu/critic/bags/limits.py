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
_WINDOW = 2**27  # [bytes] that zstd may look back
_PIECE = 2**20  # [bytes] unpacked at a time of a whole file
LATEST = 2**63 - 1  # [ns] a time that no message is after


def _zstd(data: bytes, most: int) -> bytes:
    """Unpack frame by frame: the size that a frame states need not be true, nor small."""
    with zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(data, read_across_frames=True) as stream:
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
        self._total, self._packed = 0, size  # [bytes] of all of them, and of the file

    def unpack(self, kind: str, data: bytes, place: int) -> bytes:
        """Return a piece unpacked; place: tells the pieces apart, for one may be read again."""
        unpacked = UNPACKERS[kind](data, MOST_UNPACKED + 1)
        self._total += len(unpacked) - self._sizes.get(place, 0)
        self._sizes[place] = len(unpacked)
        if len(unpacked) > MOST_UNPACKED:
            raise Error(f"{self._path}: a chunk has more than {MOST_UNPACKED} bytes unpacked")
        _check(self._path, self._packed, self._total)
        return unpacked


def check_packed(path: Path) -> None:
    """Raise Error for a file packed as a whole that has too much in it."""
    size = 0
    with path.open("rb") as packed, zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(packed) as stream:
        while piece := stream.read(_PIECE):
            size += len(piece)
            _check(path, path.stat().st_size, size)


def _check(path: Path, packed: int, unpacked: int) -> None:
    most = LEAST_UNPACKED + TIMES_UNPACKED * packed
    if unpacked > most:
        raise Error(f"{path}: has more than {most} bytes unpacked: {TIMES_UNPACKED} times its size")

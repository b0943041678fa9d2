# SPDX-License-Identifier: BSD-3-Clause
"""Scans out of the bytes that a URG-04LX sent, as a host wrote them down with its own times."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bounded_files import MOST_TABLE, read_bytes
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

_ECHO = b"GD0046072201\n"  # one scan, steps 46 to 722 of 1024, three characters a reading
_BEAMS = 722 - 46 + 1
_CODES = 20  # [mm] readings below are error codes


@dataclass(frozen=True)
class UrgLog:
    """Scans of a bench: host and device times (n,) [s]; readings (n, 677) [m], nan for an error code."""

    host: FloatArray
    device: FloatArray
    readings: FloatArray
    codes: frozenset[int]


def load(path: Path) -> UrgLog:
    """Read a log: records of seconds, microseconds, length (big-endian, 32 bit) and bytes.

    Raise Error naming the file and the place of a record that is cut, or a scan whose checksum is wrong.
    """
    content = read_bytes(path, MOST_TABLE)
    stream, times, at = b"", [], 0
    while at < len(content):
        if len(content) < at + 12:
            raise Error(f"{path}: is cut in the record at byte {at}")
        seconds, micros, size = struct.unpack_from(">III", content, at)
        if len(content) < at + 12 + size:
            raise Error(f"{path}: is cut in the record at byte {at}: {size} bytes are announced")
        times.append((len(stream), seconds + 1e-6 * micros))
        stream += content[at + 12 : at + 12 + size]
        at += 12 + size
    starts, hosts = np.array([start for start, _ in times]), np.array([host for _, host in times])
    found, place = [], stream.find(_ECHO)
    while place >= 0:
        lines = stream[place : stream.find(b"\n\n", place)].split(b"\n")
        host = hosts[np.searchsorted(starts, place, side="right") - 1]
        found.append((float(host), *_scan(path, lines)))
        place = stream.find(_ECHO, place + 1)
    if not found:
        raise Error(f"{path}: holds no scan {_ECHO.decode().strip()}")
    millimetres = np.array([row for _, _, row in found])
    codes = frozenset(np.unique(millimetres[millimetres < _CODES]).astype(int).tolist())
    readings = np.where(millimetres < _CODES, np.nan, 1e-3 * millimetres)
    return UrgLog(np.array([h for h, _, _ in found]), np.array([d for _, d, _ in found]), readings, codes)


def _scan(path: Path, lines: list[bytes]) -> tuple[float, FloatArray]:
    """Return the device's time [s] and the readings [mm] of the lines of an answer."""
    for line in lines[1:]:
        if (sum(line[:-1]) & 0x3F) + 0x30 != line[-1]:
            raise Error(f"{path}: the checksum of {line!r} is wrong")
    symbols = np.frombuffer(b"".join(line[:-1] for line in lines[3:]), dtype=np.uint8).astype(int) - 0x30
    if len(symbols) != 3 * _BEAMS:
        raise Error(f"{path}: a scan has {len(symbols)} characters, not {3 * _BEAMS}")
    stamp = 0
    for symbol in lines[2][:-1]:
        stamp = 64 * stamp + symbol - 0x30
    return 1e-3 * stamp, np.asarray(symbols.reshape(-1, 3) @ np.array([4096.0, 64.0, 1.0]))

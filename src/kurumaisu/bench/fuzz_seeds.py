# SPDX-License-Identifier: BSD-3-Clause
"""What a fuzzer begins with: a sensor's bytes, recorded or made, and a client's."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from kurumaisu.errors import Error

_BLOCK = 64  # characters of data in a line
_RECORD = struct.Struct(">III")  # of Player's log: seconds, microseconds, bytes that follow


def seeds(target: str, log: Path | None) -> Iterator[bytes]:
    """Yield a target's first inputs. Raise Error for a log that cannot be read."""
    replies = [*_made(), *(_recorded(log) if log else [])]
    if target == "device":
        yield from _commands()
        return
    for number, reply in enumerate(replies):
        yield bytes([number % 256]) + reply + replies[number - 1]


def _made() -> list[bytes]:
    """Return replies of each kind, small ones."""
    pp = [
        b"MODL:URG;",
        b"DMIN:20;",
        b"DMAX:5600;",
        b"ARES:1024;",
        b"AMIN:44;",
        b"AMAX:725;",
        b"AFRT:384;",
        b"SCAN:600;",
    ]
    replies = [_reply(b"PP", b"00", [line[:-1] for line in pp], b";"), _reply(b"QT", b"00", []), b"QT\nE\n\n"]
    for command, width, beams in (
        (b"MD0000000500000", 3, 6),
        (b"MS0100013501007", 2, 36),
        (b"ME0000001001100", 6, 11),
        (b"GD0000004001", 3, 41),
        (b"GS0000006302", 2, 32),
        (b"GE0000001001", 6, 11),
    ):
        data = bytes(0x30 + (7 * i) % 64 for i in range(width * beams))
        blocks = [data[at : at + _BLOCK] for at in range(0, len(data), _BLOCK)]
        replies.append(_reply(command, b"99" if command[:1] == b"M" else b"00", [b"m2@0", *blocks]))
    return replies


def _reply(echo: bytes, status: bytes, lines: list[bytes], ending: bytes = b"") -> bytes:
    return b"\n".join([echo, _summed(status), *(_summed(line, ending) for line in lines), b"", b""])


def _summed(line: bytes, ending: bytes = b"") -> bytes:
    return line + ending + bytes([sum(line) % 64 + 0x30])


def _recorded(log: Path) -> list[bytes]:
    """Return the first replies of a real sensor."""
    data = log.read_bytes()
    bytes_received = b""
    at = 0
    while at < len(data):
        if at + _RECORD.size > len(data):
            raise Error(f"{log}: byte {at}: a record's head is cut off")
        size = _RECORD.unpack_from(data, at)[2]
        bytes_received += data[at + _RECORD.size : at + _RECORD.size + size]
        at += _RECORD.size + size
    return [reply + b"\n\n" for reply in bytes_received.split(b"\n\n")[:20]]


def _commands() -> list[bytes]:
    """Return stories for the virtual sensor: two bytes choose it and its fault, 1 to 8 are events (1 a rotation)."""
    asked = [
        b"VV\nPP\nII\n",
        b"BM\nGD0003004001\n\1GS0000004505\n\1",
        b"TM0\nTM1\nTM2\n",
        b"SS115200\nCR05\nHS1\nDB03\n",
    ]
    asked += [b"MD0003004001000;a\n\1\1\1QT\n", b"MS0010003003103\n" + 8 * b"\1", b"ME0003004007000\n\1\2\6\1RS\n\3\1"]
    return [bytes([kind, fault]) + b"SCIP2.0\n" + asked[fault % len(asked)] for fault in range(28) for kind in (1, 12)]

# SPDX-License-Identifier: BSD-3-Clause
"""What a fuzzer begins with: a sensor's bytes, recorded or made, and a client's."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from kurumaisu.errors import Error

_BLOCK = 64  # characters of data in a line
_RECORDED = 20_000  # bytes of a recording that serve as seeds: what the sensor is, and some scans
_RECORD = struct.Struct(">III")  # of Player's log: seconds, microseconds, bytes that follow


def seeds(target: str, log: Path | None) -> Iterator[bytes]:
    """Yield a target's first inputs. Raise Error for a log that cannot be read."""
    if target in ("device", "guard"):
        yield from _commands() if target == "device" else _stories()
        return
    if target == "dac":
        yield from _boards()
        return
    replies = [*_made(), *(_recorded(log) if log else [])]
    if target == "stream":
        yield from _dialogues()
    for number, reply in enumerate(replies):
        yield bytes([number % 256]) + reply + replies[number - 1]


def _made() -> list[bytes]:
    """Return replies of each kind, small ones."""
    return [
        _PP,
        _reply(b"QT", b"00", []),
        b"QT\nE\n\n",
        _scan(b"MD0000000500000", 3, 6),
        _scan(b"MS0100013501007", 2, 36),
        _scan(b"ME0000001001100", 6, 11),
        _scan(b"GD0000004001", 3, 41),
        _scan(b"GS0000006302", 2, 32),
        _scan(b"GE0000001001", 6, 11),
    ]


def _dialogues() -> Iterator[bytes]:
    """Yield what a sensor says from QT on, asked for each of the target's scans; in SCIP 2.0 and 1.1."""
    words = [_reply(name, b"00", [], b";") for name in (b"QT", b"TM2")] + [_VV, _PP, _II, _reply(b"BM", b"00", [])]
    asked = (
        (b"MD0044005501000", 3, 12),
        (b"ME0044005000000", 6, 7),
        (b"MS0000003003000", 2, 11),
        (b"MD0044072501100", 3, 682),
    )
    for number, (command, width, beams) in enumerate(asked):
        scans = [_scan(command, width, beams, clock) for clock in (b"0001", b"001d", b"001d", b"0031")]
        yield bytes([number]) + b"".join([*words, _reply(command, b"00", []), *scans])
        yield bytes([number]) + b"QT\nE\n\nSCIP2.0\n0\n\n" + b"".join([*words, _reply(command, b"00", []), *scans])


def _boards() -> Iterator[bytes]:
    """Yield what a D/A board says after each command: replies, late and wrong ones, none."""
    yield b"\x3fOK 1\n\xffOK 2\n\xffOK 3\n"
    yield b"\0\xffOK 1\nOK 2\n\xff\xffOK 3\nOK 4\nOK 5\n\xffOK 5\n"
    yield b"\7?\n\xffOK 1\nOK\xff 2\nOK 3\n\xff" + 300 * b"x" + b"\n\xffOK 5"


def _scan(command: bytes, width: int, beams: int, clock: bytes = b"m2@0") -> bytes:
    data = bytes(0x30 + (7 * i) % 64 for i in range(width * beams))
    blocks = [data[at : at + _BLOCK] for at in range(0, len(data), _BLOCK)]
    return _reply(command, b"99" if command[:1] == b"M" else b"00", [clock, *blocks])


def _reply(echo: bytes, status: bytes, lines: list[bytes], ending: bytes = b"") -> bytes:
    return b"\n".join([echo, _summed(status), *(_summed(line, ending) for line in lines), b"", b""])


def _summed(line: bytes, ending: bytes = b"") -> bytes:
    return line + ending + bytes([sum(line) % 64 + 0x30])


_PP = _reply(
    b"PP",
    b"00",
    [b"MODL:URG", b"DMIN:20", b"DMAX:5600", b"ARES:1024", b"AMIN:44", b"AMAX:725", b"AFRT:384", b"SCAN:600"],
    b";",
)
_VV = _reply(b"VV", b"00", [b"VEND:a", b"PROD:b", b"FIRM:c", b"PROT:d", b"SERI:e"], b";")
_II = _reply(b"II", b"00", [b"LASR:OFF", b"STAT:good"], b";")


def _recorded(log: Path) -> list[bytes]:
    """Return the first replies of a real sensor."""
    data = log.read_bytes()
    received = bytearray()
    at = 0
    while at < len(data) and len(received) < _RECORDED:
        if at + _RECORD.size > len(data):
            raise Error(f"{log}: byte {at}: a record's head is cut off")
        size = _RECORD.unpack_from(data, at)[2]
        received += data[at + _RECORD.size : at + _RECORD.size + size]
        at += _RECORD.size + size
    return [reply + b"\n\n" for reply in bytes(received).split(b"\n\n")[:-1]]


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


def _stories() -> Iterator[bytes]:
    """Yield stories for the guard: neutral is held (0), then motion (1), which each of the other events may end."""
    hold, drive = bytes([0, 40]), b"".join(struct.pack("<BBhh", 1, 20, 2000 * k, -1000 * k) for k in range(1, 13))
    message = struct.pack("<IHHQqddd", 0x4B475244, 1, 1, 50, 10**12, 0.1, 0.1, 2.5)
    ends = [
        bytes([2]) + message,
        bytes([4, 200]),
        bytes([5]),
        bytes([6, 0, 6, 1]),
        bytes([6, 0]),
        bytes([7]) + 50 * b"x",
    ]
    ends += [struct.pack("<BBhhBQ", 3, 20, 20000, 0, word, 0x7FF8 << 48 | 1) for word in range(6)]
    ends += [struct.pack("<BBhhBBhIB", 3, 20, 20000, 0, 2, 0, made, 0, 0) for made in (-200, -30, 200)]
    ends += [struct.pack("<BBhhBIHH", 3, 20, 3000, 0, 0, 0x4B475244, 1, kind) for kind in (2, 9)]
    for end in ends:
        yield hold + drive + end + drive + hold + drive

# SPDX-License-Identifier: BSD-3-Clause
"""A client of a URG that shares no code with the package: what the tests read scans with."""

from __future__ import annotations

import os
import select
import socket
import termios
import time
import tty
from dataclasses import dataclass

import numpy as np

DEADLINE = 10.0  # [s] for whatever must come


def check_sum(line):
    return chr((sum(line) & 0x3F) + 0x30).encode()


def number(characters):
    value = 0
    for character in characters:
        value = value << 6 | character - 0x30
    return value


@dataclass(frozen=True)
class Scan:
    clock: int  # [ms]
    distances: np.ndarray  # [mm]


def scan_of(message):
    """Read a scan in three characters a beam; a wrong sum fails."""
    _, status, *lines = message.split(b"\n")
    assert status == b"99b", message[:40]
    assert all(check_sum(line[:-1]) == line[-1:] for line in lines)
    clock, *data = [line[:-1] for line in lines]
    text = b"".join(data)
    return Scan(number(clock), np.array([number(text[i : i + 3]) for i in range(0, len(text), 3)]))


class Client:
    """Bytes in and out of a descriptor, messages by their two LF."""

    def __init__(self, place):
        """Open a pty by its path, or a TCP port by its number."""
        self.socket = None
        if isinstance(place, int):
            self.socket = socket.create_connection(("127.0.0.1", place), timeout=DEADLINE)
            self.socket.setblocking(False)
            self.fd = self.socket.fileno()
        else:
            self.fd = os.open(place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.buffer = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self.socket is not None:
            self.socket.close()
        elif self.fd >= 0:
            os.close(self.fd)
        self.fd = -1

    def set_rate(self, rate):
        """Set a tty to a rate of termios, as B115200."""
        tty.setraw(self.fd, termios.TCSANOW)
        settings = termios.tcgetattr(self.fd)
        settings[4] = settings[5] = rate
        termios.tcsetattr(self.fd, termios.TCSANOW, settings)

    def send(self, text):
        os.write(self.fd, text)

    def some(self, deadline=DEADLINE):
        """Read what comes next; b"" where the other end closed. Fail where nothing comes."""
        ready, _, _ = select.select([self.fd], [], [], deadline)
        assert ready, "nothing came"
        return os.read(self.fd, 65536)

    def silent(self, seconds):
        return not select.select([self.fd], [], [], seconds)[0]

    def message(self):
        """Return the next message, without its end."""
        while b"\n\n" not in self.buffer:
            piece = self.some()
            if not piece:
                raise EOFError
            self.buffer += piece
        message, _, self.buffer = self.buffer.partition(b"\n\n")
        return message

    def ask(self, command):
        self.send(command + b"\n")
        return self.message()

    def stream(self, command=b"MD0044072501000"):
        """Start a stream."""
        assert self.ask(command) == command + b"\n00P"

    def scan(self):
        return scan_of(self.message())


def until(condition):
    """Wait for a condition."""
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.002)


def in_its_turn(check, tries=5):
    """Run a check of real time until it holds: a busy machine may spoil one run, a fault spoils all of so many."""
    for _ in range(tries - 1):
        try:
            return check()
        except (AssertionError, EOFError, OSError):
            continue
    return check()

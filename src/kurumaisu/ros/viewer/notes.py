# SPDX-License-Identifier: BSD-3-Clause
"""What nodes have warned of lately."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import rospy
from rosgraph_msgs.msg import Log

from kurumaisu.viewer.protocol import Note

_MOST = 5
_LONGEST = 300  # characters of one


class RosoutNotes:
    """Warnings and errors of /rosout, each for a while; one that comes again is not another one."""

    def __init__(self, seconds: float) -> None:
        """Show each note for so many seconds of wall time."""
        self._seconds = seconds
        self._heard: deque[tuple[float, Note]] = deque(maxlen=_MOST)
        self._subscriber: Any = None

    def open(self) -> None:
        """Listen."""
        self._subscriber = rospy.Subscriber("/rosout", Log, self._hear, queue_size=20)

    def close(self) -> None:
        """Listen no longer."""
        self._subscriber.unregister()
        self._heard.clear()

    def now(self) -> tuple[Note, ...]:
        """Return those to be shown, oldest first."""
        oldest = time.monotonic() - self._seconds
        return tuple(note for heard, note in list(self._heard) if heard >= oldest)

    def _hear(self, message: Any) -> None:
        if message.level < Log.WARN:
            return
        level = "warning" if message.level == Log.WARN else "error"
        note = Note(level, f"{message.name}: {message.msg}"[:_LONGEST])
        again = [pair for pair in list(self._heard) if pair[1] == note]
        for pair in again:
            self._heard.remove(pair)
        self._heard.append((time.monotonic(), note))

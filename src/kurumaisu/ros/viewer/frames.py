# SPDX-License-Identifier: BSD-3-Clause
"""The frames of tf: who says which of them how often. Heard only while somebody asks."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import dataclass

import rospy
from tf2_msgs.msg import TFMessage

from kurumaisu._core import frame_of
from kurumaisu.errors import Error
from kurumaisu.viewer.source import Outcome

_LISTEN = 1.5  # [s] of wall time
_FRESH = 2.0  # [s] that a list is good for who asks next: many pages cost no more than one
_MOST = 500  # frames
_LONGEST = 100  # characters of a name that are shown


@dataclass
class _Frame:
    """What was heard of a frame; by: the node that said so."""

    parent: str
    by: str
    static: bool
    count: int = 0


class Frames:
    """Lists frames when asked."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listed = ""
        self._when = -_FRESH  # [s]

    def list(self) -> Outcome:
        """Return all frames as JSON: child, parent, node, and rate [Hz], null for those said once for all."""
        with self._lock:
            if time.monotonic() - self._when > _FRESH:
                self._listed = json.dumps(_heard())
                self._when = time.monotonic()
        return Outcome("", self._listed)


def _heard() -> list[dict[str, object]]:
    """Listen for a while."""
    found: dict[str, _Frame] = {}

    def hear(message: TFMessage, static: bool) -> None:
        by = message._connection_header.get("callerid", "")
        for one in message.transforms:
            try:
                child, parent = frame_of(one.child_frame_id), frame_of(one.header.frame_id)
            except Error as error:
                rospy.logwarn_throttle(10.0, f"VIEWER_BAD_FRAME {by}: {error}")
                continue
            if child in found or len(found) < _MOST:
                frame = found.setdefault(child, _Frame(parent, by, static))
                frame.parent, frame.by, frame.count = parent, by, frame.count + 1

    topics = [
        rospy.Subscriber(name, TFMessage, hear, callback_args=name.endswith("static"), queue_size=100)
        for name in ("/tf", "/tf_static")
    ]
    time.sleep(_LISTEN)
    for topic in topics:
        topic.unregister()
    return [
        {
            "child": child[:_LONGEST],
            "parent": frame.parent[:_LONGEST],
            "node": frame.by[:_LONGEST],
            "rate": None if frame.static else frame.count / _LISTEN,
        }
        for child, frame in sorted(found.items())
    ]

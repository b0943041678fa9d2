# SPDX-License-Identifier: BSD-3-Clause
"""A topic whose messages are bytes, sent by the thread that makes them."""

from __future__ import annotations

import socket
from collections import deque
from typing import Any

import rospy

DEPTH = 10  # messages kept for a slow subscriber, on every topic but /tf, as in stage_ros


class Outlet:
    """Advertises as rospy.Publisher does, then hands bytes to the sockets itself.

    rospy wakes a thread for every message and subscriber, which costs several times the system call. Here a send never
    waits: what a slow subscriber's socket does not take is kept, the newest `depth` messages of it, and offered again
    by the next send or flush, as roscpp does.
    """

    def __init__(self, name: str, kind: type, depth: int) -> None:
        self._publisher = rospy.Publisher(name, kind, queue_size=depth)
        self._topic = self._publisher.impl
        self._topic.set_queue_size(None)  # no thread for each connection
        self._depth = depth
        self._late: dict[Any, deque[memoryview]] = {}
        self._sent = 0

    @property
    def wanted(self) -> bool:
        """Whether anybody listens."""
        return bool(self._topic.connections)

    @property
    def behind(self) -> bool:
        """Whether there is a subscriber that has not taken everything yet."""
        return bool(self._late)

    def next_number(self) -> int:
        """Return the next header's seq, which counts from 0 also while nobody listens, as roscpp's does."""
        self._sent += 1
        return self._sent - 1

    def send(self, data: bytearray) -> None:
        """Send a message, with the word of its length in front, to all who listen."""
        if self._late:
            self.flush()
        for connection in self._topic.connections:
            if connection in self._late:
                self._keep(connection, memoryview(bytes(data)))
                continue
            taken = self._offer(connection, data)
            if taken < len(data):
                self._late[connection] = deque([memoryview(bytes(data))[taken:]])

    def flush(self) -> None:
        """Offer what is kept again."""
        connections = self._topic.connections
        for connection, waiting in list(self._late.items()):
            while waiting and connection in connections:
                taken = self._offer(connection, waiting[0])
                if taken < len(waiting[0]):
                    waiting[0] = waiting[0][taken:]
                    break
                waiting.popleft()
            if not waiting or connection not in self._topic.connections:
                del self._late[connection]

    def close(self) -> None:
        """End the topic."""
        self._publisher.unregister()

    def _keep(self, connection: Any, data: memoryview) -> None:
        waiting = self._late[connection]
        if len(waiting) > self._depth:  # the first one may be half sent already: it must be finished
            del waiting[1]
        waiting.append(data)

    def _offer(self, connection: Any, data: bytearray | memoryview) -> int:
        """Return how many bytes the socket took, or all of them when there is none any more."""
        link = connection.socket
        if link is None:
            return len(data)
        try:
            taken: int = link.send(data, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return 0
        except OSError:
            connection.close()  # its topic drops it
            return len(data)
        connection.stat_bytes += taken
        connection.stat_num_msg += 1
        return taken


class OutletTopic:
    """What publishes on one outlet."""

    def __init__(self, name: str, kind: type) -> None:
        self._outlet = Outlet(name, kind, DEPTH)

    def close(self) -> None:
        """End the topic."""
        self._outlet.close()

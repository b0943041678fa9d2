# SPDX-License-Identifier: BSD-3-Clause
"""What a slow subscriber gets: whole messages in order, the newest ones; and nobody waits for it."""

import socket
import struct
from types import SimpleNamespace

import pytest
import rospy
from rosgraph_msgs.msg import Clock

from kurumaisu.ros.outlet import Outlet

DEPTH = 3
SIZE = 200_000  # bytes of a message: several fill any socket


class Connection:
    """As rospy's, around one end of a pair of sockets."""

    def __init__(self, topic):
        self.socket, self.other = socket.socketpair()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 16)
        self.stat_bytes = self.stat_num_msg = 0
        self._topic = topic

    def close(self):
        self.socket = None
        self._topic.connections = [c for c in self._topic.connections if c is not self]


@pytest.fixture
def outlet(monkeypatch):
    topic = SimpleNamespace(connections=[], set_queue_size=lambda size: None)
    monkeypatch.setattr(rospy, "Publisher", lambda *arguments, **options: SimpleNamespace(impl=topic))
    outlet = Outlet("/clock", Clock, DEPTH)
    outlet.connections = topic.connections
    topic.connections.append(Connection(topic))
    return outlet


def message(number, size=SIZE):
    return bytearray(struct.pack("<II", size - 4, number) + bytes(size - 8))


def receive(link):
    """Return the number of the next message, after checking that it is whole."""
    data = b""
    while len(data) < 4 or len(data) < 4 + struct.unpack_from("<I", data)[0]:
        wanted = 4 + struct.unpack_from("<I", data)[0] - len(data) if len(data) >= 4 else 4 - len(data)
        data += link.recv(wanted)
    assert not any(data[8:])
    return struct.unpack_from("<I", data, 4)[0]


def test_a_message_goes_out_at_once(outlet):
    (connection,) = outlet.connections
    outlet.send(message(7, 20))
    assert receive(connection.other) == 7
    assert (connection.stat_bytes, connection.stat_num_msg) == (20, 1)
    assert not outlet.behind


def test_the_newest_messages_of_a_slow_subscriber_are_kept_whole(outlet):
    (connection,) = outlet.connections
    buffer = bytearray(SIZE)
    for number in range(20):  # the same buffer is written again, as the wire's is
        buffer[:] = message(number)
        outlet.send(buffer)
    assert outlet.behind
    connection.other.settimeout(0.2)
    received = []
    while not received or received[-1] != 19:
        outlet.flush()
        try:
            while True:
                received.append(receive_with(outlet, connection.other))
        except TimeoutError:
            continue
    assert received[-DEPTH:] == [17, 18, 19]
    assert received == sorted(received)
    assert not outlet.behind


def receive_with(outlet, link):
    """Receive a message while the outlet keeps offering."""
    data = b""
    wanted = 4
    while len(data) < wanted:
        outlet.flush()
        data += link.recv(wanted - len(data))
        if len(data) == 4:
            wanted = 4 + struct.unpack("<I", data)[0]
    assert not any(data[8:])
    return struct.unpack_from("<I", data, 4)[0]


def test_a_subscriber_that_has_gone_is_dropped(outlet):
    (connection,) = outlet.connections
    connection.other.close()
    outlet.send(message(1, 20))
    outlet.send(message(2, 20))
    assert not outlet.wanted
    assert not outlet.behind


def test_one_slow_subscriber_does_not_hold_up_another(outlet):
    slow = outlet.connections[0]
    for number in range(5):
        outlet.send(message(number))
    quick = Connection(SimpleNamespace(connections=[]))
    outlet.connections.append(quick)
    outlet.send(message(9, 20))
    assert receive(quick.other) == 9
    assert outlet.behind
    slow.other.close()


def test_seq_counts_from_zero(outlet):
    assert [outlet.next_number() for _ in range(3)] == [0, 1, 2]

# SPDX-License-Identifier: BSD-3-Clause
"""What is set in a virtual sensor is what a client reads, by a decoder that shares nothing with src/scip."""

import math
import socket
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kurumaisu.virtual_urg import Tcp, VirtualUrg, load_sensor

DEADLINE = 10.0  # [s] of anything that is waited for
MOST = 2**18 - 1  # what three characters can say
BLOCK = 65  # characters of a full line, with its sum


def number(characters):
    """Return what characters of six bits say; none of another alphabet may be among them."""
    assert all(0x30 <= c < 0x70 for c in characters), characters
    return sum((c - 0x30) << 6 * place for place, c in enumerate(reversed(characters)))


def unsummed(line):
    """Return a line without its sum, which must be right."""
    assert line[-1] == (sum(line[:-1]) & 0x3F) + 0x30, line
    return line[:-1]


def decode(reply, command):
    """Return a reply's clock [ms] and numbers (beams, 1 or 2): distance, or distance and intensity."""
    echo, status, stamp, *blocks = reply[:-2].split(b"\n")
    assert echo == command
    assert unsummed(status) == (b"99" if command[:1] == b"M" else b"00")
    assert all(len(block) == BLOCK for block in blocks[:-1])
    assert 1 < len(blocks[-1]) <= BLOCK
    data = b"".join(map(unsummed, blocks))
    width = 2 if command[1:2] == b"S" else 3
    numbers = [number(data[at : at + width]) for at in range(0, len(data), width)]
    return number(unsummed(stamp)), np.reshape(numbers, (-1, 2 if command[1:2] == b"E" else 1))


class Client:
    """A client of a sensor that is fed, and who feeds it."""

    def __init__(self, name):
        self.sensor = load_sensor(name)
        self.urg = VirtualUrg(self.sensor, Tcp(), fed=True)
        self.socket = socket.create_connection(("127.0.0.1", self.urg.port), DEADLINE)
        self.received = b""
        self.heard = 0
        self.now = 1.0
        self.ask(b"SCIP2.0")

    def close(self):
        self.socket.close()
        self.urg.close()

    def send(self, command):
        self.socket.sendall(command + b"\n")
        self.heard += 1

    def reply(self):
        """Return the bytes of the next reply, with its empty line."""
        while b"\n\n" not in self.received:
            piece = self.socket.recv(1 << 16)
            assert piece, "the sensor hung up"
            self.received += piece
        reply, _, self.received = self.received.partition(b"\n\n")
        return reply + b"\n\n"

    def ask(self, command):
        self.send(command)
        return self.reply()

    def scan(self, command, **measured):
        """Return the scan that answers a command: clock [ms] and numbers; it was begun at self.now."""
        if command[:1] == b"G":
            self.ask(b"BM")
            self.send(command)
            self.until(lambda: self.urg.counters["commands"] >= self.heard)
        else:
            assert self.ask(command) == command + b"\n00P\n\n"
        start, self.now = self.now, self.now + self.sensor.scan_time
        assert self.urg.measure(self.now, start, **measured)
        scan = decode(self.reply(), command)
        assert self.ask(b"QT") == b"QT\n00P\n\n"
        assert scan[0] == math.floor(start * 1e3 + 1e-3) % 2**24
        return scan[1]

    def until(self, condition):
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end
            time.sleep(1e-4)


@pytest.fixture(scope="module", params=["urg_04lx", "urg_04lx_ug01", "utm_30lx"])
def client(request):
    client = Client(request.param)
    yield client
    client.close()


def nearest(values, at_least):
    """Return the index in a cluster of the least valid value, the first of them; 0 if none is valid."""
    valid = [(value, index) for index, value in enumerate(values) if value >= at_least]
    return min(valid)[1] if valid else 0


def expected(client, command, sent, intensities):
    """Return what a decoder must find: distance [mm], and intensity where the command asks for it."""
    first, last, cluster = int(command[2:6]), int(command[6:10]), max(int(command[10:12]), 1)
    parameters = dict(client.sensor.model.parameters)
    all_sent = np.full((client.sensor.model.end_step + 1, 2), (client.sensor.model.codes.outside, 0))
    all_sent[client.sensor.first : client.sensor.last + 1] = np.column_stack([sent, intensities])
    clusters = [all_sent[at : min(at + cluster, last + 1)] for at in range(first, last + 1, cluster)]
    beams = np.array([steps[nearest(steps[:, 0], int(parameters["DMIN"]))] for steps in clusters])
    if command[1:2] == b"S":
        beams = np.minimum(beams, 4095)
    return beams if command[1:2] == b"E" else beams[:, :1]


def commands(client):
    """Draw a command that the sensor has, of any window."""
    model = client.sensor.model
    names = [name for name in ("MD", "MS", "ME", "GD", "GS", "GE") if name not in model.refused]
    ends = st.tuples(*2 * [st.integers(0, model.end_step)]).map(sorted)
    return st.builds(
        lambda name, ends, cluster: (
            b"%s%04d%04d%02d%s" % (name.encode(), *ends, cluster, b"000" if name[0] == "M" else b"")
        ),
        st.sampled_from(names),
        ends,
        st.integers(0, 99),
    )


NO_CHECK = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


@settings(max_examples=60, deadline=None, suppress_health_check=NO_CHECK)
@given(data=st.data())
def test_any_command_brings_what_was_set(client, data):
    command = data.draw(commands(client), "command")
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32), "seed"))
    sent = rng.integers(0, data.draw(st.sampled_from([30, 4200, 60000, MOST]), "below"), client.sensor.steps)
    intensities = rng.integers(0, MOST + 1, client.sensor.steps)
    found = client.scan(command, ranges=0.0 * sent, intensities=1.0 * intensities, codes=sent)
    np.testing.assert_array_equal(found, expected(client, command, sent, intensities))


@settings(max_examples=40, deadline=None, suppress_health_check=NO_CHECK)
@given(data=st.data())
def test_any_range_comes_to_the_nearest_millimetre_or_as_a_code(client, data):
    sensor, codes = client.sensor, client.sensor.model.codes
    some = st.floats(-1.0, 70.0) | st.sampled_from(
        [math.nan, math.inf, -math.inf, 0.0, sensor.range_min, sensor.range_max]
    )
    values = data.draw(st.lists(some, min_size=1, max_size=20), "ranges")
    ranges = np.resize(values, sensor.steps)
    command = b"MD%04d%04d00000" % (sensor.first, sensor.last)
    for r, (distance,) in zip(ranges, client.scan(command, ranges=ranges), strict=True):
        if math.isnan(r):
            assert distance == codes.error
        elif distance == codes.no_return:
            assert r > sensor.range_max
        elif distance == codes.too_near:
            assert r < sensor.range_min
        else:
            assert abs(r - distance / 1000) <= 0.5e-3 + 1e-12
            assert sensor.range_min - 0.5e-3 <= r <= sensor.range_max + 0.5e-3


def test_every_millimetre(client):
    sensor = client.sensor
    low, high = round(sensor.range_min * 1000), round(sensor.range_max * 1000)
    command = b"MD%04d%04d01000" % (sensor.first, sensor.last)
    for start in range(low, high + 1, sensor.steps):
        distances = np.minimum(np.arange(start, start + sensor.steps), high)
        np.testing.assert_array_equal(client.scan(command, ranges=distances / 1000)[:, 0], distances)

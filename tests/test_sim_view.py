# SPDX-License-Identifier: BSD-3-Clause
"""What a simulator publishes for who looks: what it has, at a rate, and never waiting for anybody."""

import socket
import struct
import time
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from kurumaisu.msg import View

from kurumaisu.params import shipped
from kurumaisu.ros.view.fans import FleetFans
from kurumaisu.ros.view.topics import ViewTopics
from kurumaisu.settings import load
from kurumaisu.sim.options import read_options
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.world import load_world

NS = 1_000_000_000
WORLD = """
interval_sim 100
define laser ranger ( sensor ( range [0 5] fov 180 samples {beams} ) )
define robot position ( size [0.2 0.2 0.2] laser ( pose [0.1 0 0 0] ) )
robot ( pose [-1 0 0 0] )
robot ( pose [1 0 0 90] )
model ( size [8 8 1] boundary 1 color "red" )
"""


class Link:
    """A subscriber's connection, and its other end."""

    def __init__(self):
        self.socket, self._other = socket.socketpair()
        self._other.setblocking(False)
        self.stat_bytes = self.stat_num_msg = 0
        self._read = b""

    def close(self):
        self.socket.close()
        self.socket = None

    def views(self):
        """Return what has come."""
        while True:
            try:
                self._read += self._other.recv(1 << 20)
            except BlockingIOError:
                break
        found = []
        while len(self._read) >= 4 and len(self._read) >= 4 + (size := struct.unpack_from("<I", self._read)[0]):
            view = View()
            view.deserialize_numpy(self._read[4 : 4 + size], np)
            found.append(view)
            self._read = self._read[4 + size :]
        return found


class Rig:
    """A simulation as stageros runs it, without a master; wall time is what the test says."""

    def __init__(self, folder, monkeypatch, beams):
        self.links = []
        self.worlds = []
        self.wall = 100.0
        self.view_topic = SimpleNamespace(connections=self.links, set_queue_size=lambda size: None)
        monkeypatch.setattr(rospy, "Publisher", self._publisher)
        monkeypatch.setattr(time, "monotonic", lambda: self.wall)
        path = folder / "two.world"
        path.write_text(WORLD.format(beams=beams))
        options = read_options(load(shipped("launch/simulator.yaml")))
        world = load_world(path, image_extents=False, values={})
        self.simulator = Simulator(world, options)
        self.simulator.reset(1)
        self.fans = FleetFans(self.simulator)
        drives = {0: "/cmd_vel"}
        self.topics = ViewTopics(
            10.0, "map", lambda: self.simulator.machinery, self.fans, lambda: drives, lambda: self.simulator.seed
        )
        self.number = 0

    def _publisher(self, name, *_, **__):
        return SimpleNamespace(impl=self.view_topic, publish=self.worlds.append)

    def join(self):
        self.links.append(Link())
        return self.links[-1]

    def step(self, seconds, paused=False):
        """Let wall time pass, and a step."""
        self.wall += seconds
        if not paused:
            self.simulator.step(np.array([[0.3, 0.0, 0.5], [0.1, 0.0, 0.0]]))
            self.number += 1
            if self.topics.due:
                self.fans.note(self.number * NS // 10)
        self.topics.show(self.number * NS // 10, paused, 2.0)


@pytest.fixture
def rig(tmp_path, monkeypatch):
    return Rig(tmp_path, monkeypatch, beams=90)


def test_a_view_says_what_the_simulation_is(rig):
    link = rig.join()
    rig.step(1.0)
    assert len(link.views()[0].ranges) == 0  # where the fans are has only just been described
    for _ in range(3):
        rig.step(1.0)
        (view,) = link.views()
        machinery = rig.simulator.machinery
        assert view.header.stamp.to_nsec() == rig.number * NS // 10
        assert (view.header.frame_id, view.speed, bool(view.paused)) == ("map", 2.0, False)
        assert view.poses.reshape(-1, 3) == pytest.approx(machinery.frames[:-1][:, [0, 1, 3]])
        assert view.ranges == pytest.approx(rig.simulator.scans.ranges)
        assert view.intensities == pytest.approx(np.concatenate([scan.returns for scan in rig.simulator.scans]))
        assert [stamp.to_nsec() for stamp in view.stamps] == [rig.number * NS // 10] * 2
        x, y, yaw = view.poses.reshape(-1, 3)[0]
        assert view.sensors.reshape(-1, 3)[0] == pytest.approx([x + 0.1 * np.cos(yaw), y + 0.1 * np.sin(yaw), yaw])
    assert len(rig.worlds) == 1


def test_the_rate_is_of_wall_time_and_nobody_gets_nothing(rig):
    for _ in range(20):
        rig.step(0.01)
    assert rig.worlds == []
    link = rig.join()
    for _ in range(300):
        rig.step(0.01)
    assert len(link.views()) in (29, 30, 31)
    for _ in range(5):
        rig.step(0.001)
    assert len(link.views()) <= 1


def test_scans_go_once_and_again_to_who_comes_later(rig):
    link = rig.join()
    rig.step(1.0)
    rig.step(1.0)
    rig.step(1.0, paused=True)
    _, with_scans, without = link.views()
    assert len(with_scans.ranges) == 180
    assert len(without.ranges) == len(without.stamps) == 0
    assert len(without.poses) == 6
    rig.links.clear()
    rig.step(1.0, paused=True)
    late = rig.join()
    rig.step(1.0, paused=True)
    assert len(late.views()[0].ranges) == 180


def test_who_takes_nothing_costs_no_memory_and_holds_up_nobody(tmp_path, monkeypatch):
    rig = Rig(tmp_path, monkeypatch, beams=60_000)  # a view is bigger than the socket's buffer
    dead, live = rig.join(), rig.join()
    size = 0
    seen = []
    for _ in range(30):
        rig.step(0.2)
        for _ in range(100):  # what a socket did not take at once comes in the next steps, without a new view
            rig.wall += 0.003
            seen += live.views()
            rig.topics.show(rig.number * NS // 10, True, 2.0) if rig.topics._view.behind else None
        size = max(size, sum(map(len, rig.topics._view._late.get(dead, ()))))
    assert 0 < size < 3 * 2_000_000  # the one that is half sent, and the newest
    assert len(seen) >= 30
    assert all(len(view.ranges) in (0, 120_000) for view in seen)
    newest = [view.header.stamp.to_nsec() for view in seen]
    assert newest == sorted(newest)
    assert newest[-1] == rig.number * NS // 10
    rest = []
    while rig.topics._view.behind:
        rig.wall += 0.003
        rig.topics._view.flush()
        rest += dead.views()
    assert len(rest) <= 3
    assert rest[-1].header.stamp.to_nsec() == newest[-1]

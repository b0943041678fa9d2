# SPDX-License-Identifier: BSD-3-Clause
"""base_node when the ROS master dies, and when another one takes its place. Fault 14 of the base."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml

from kurumaisu.bench.processes import free_port
from kurumaisu.params import shipped

PATIENCE = 30.0  # [s]
TIMEOUT = 1.5  # [s] master_timeout of the test's base_node
DECELERATION = 1.2  # [m/s^2] launch/base_node.yaml


def until(condition, what, patience=PATIENCE):
    deadline = time.monotonic() + patience
    while not (found := condition()):
        assert time.monotonic() < deadline, what
        time.sleep(0.005)
    return found


class Graph:
    """A master of our own, and processes that find it; all end with the test."""

    def __init__(self, stack):
        self.stack = stack
        self.port = free_port()
        uri = f"http://localhost:{self.port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": uri, "ROS_HOSTNAME": "localhost"}
        self.start_master()

    def run(self, *command, **options):
        process = subprocess.Popen(command, env=self.environment, text=True, **options)
        self.stack.callback(lambda: (process.kill(), process.wait()))
        return process

    def start_master(self):
        self.master = self.run("rosmaster", "--core", "-p", str(self.port), stdout=subprocess.DEVNULL)
        until(lambda: not socket.socket().connect_ex(("localhost", self.port)), "a master")

    def kill_master(self):
        self.master.kill()
        self.master.wait()

    def start_base(self, folder):
        values = yaml.safe_load(shipped("launch/base_node.yaml").read_text())
        values["model"] = yaml.safe_load(shipped("launch/md100.yaml").read_text())
        values["guard"] = yaml.safe_load(shipped("launch/guard.yaml").read_text())
        path = folder / "base_node.yaml"
        path.write_text(yaml.safe_dump({**values, "master_timeout": TIMEOUT}))
        assert self.run("rosparam", "load", str(path), "/base_node").wait(PATIENCE) == 0
        return self.run("rosrun", "kurumaisu", "base_node", stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


class Peer:
    """base_peer.py: what it heard is a list of (time, v, w)."""

    def __init__(self, graph):
        program = str(Path(__file__).parent / "base_peer.py")
        self.process = graph.run(sys.executable, program, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.heard = []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        for line in self.process.stdout:
            self.heard.append((time.monotonic(), *map(float, line.split())))

    def say(self, v, w):
        self.process.stdin.write(f"{v} {w}\n")
        self.process.stdin.flush()

    def drives(self, v):
        return bool(self.heard) and self.heard[-1][1] == v

    def stops(self):
        """Return when the chair came to rest."""
        until(lambda: self.drives(0.0), "rest")
        return self.heard[-1][0]


@pytest.fixture
def graph():
    with contextlib.ExitStack() as stack:
        yield Graph(stack)


def set_off(graph, folder):
    base, peer = graph.start_base(folder), Peer(graph)
    until(lambda: peer.drives(0.0), "the base")
    peer.say(0.0, 0.0)
    time.sleep(0.5)  # a zero releases the input; nothing that one could wait for tells
    peer.say(0.6, 0.0)
    until(lambda: peer.drives(0.6), "motion")
    return base, peer


def test_a_master_that_dies_brakes_and_another_one_ends_it(graph, tmp_path):
    base, peer = set_off(graph, tmp_path)
    graph.kill_master()
    died = time.monotonic()
    took = peer.stops() - died  # though the peer commands on
    assert took < TIMEOUT * 1.2 + 0.6 / DECELERATION + 0.5
    v = [rates[1] for rates in peer.heard if rates[0] > died]
    assert max(a - b for a, b in zip([0.6, *v], v, strict=False)) < DECELERATION * 0.1 + 1e-9  # a ramp
    time.sleep(1.0)
    assert peer.drives(0.0)
    assert base.poll() is None
    graph.start_master()
    said, _ = base.communicate(timeout=PATIENCE)
    assert base.returncode == 1
    assert "BASE_MASTER_LOST" in said
    assert "BASE_MASTER_FORGOT" in said
    assert peer.drives(0.0)


def test_with_its_commander_gone_too_it_stops_at_the_command_s_timeout(graph, tmp_path):
    base, commander = set_off(graph, tmp_path)
    listener = Peer(graph)
    until(lambda: listener.drives(0.6), "a second listener")
    graph.kill_master()
    commander.process.kill()
    died = time.monotonic()
    assert listener.stops() - died < 0.25 + 0.6 / DECELERATION + 0.3
    base.terminate()
    base.communicate(timeout=PATIENCE)
    assert base.returncode == 0


def test_a_master_that_is_busy_for_a_moment_is_none_of_it(graph, tmp_path):
    _, peer = set_off(graph, tmp_path)
    graph.master.send_signal(19)  # SIGSTOP
    time.sleep(0.5 * TIMEOUT)
    graph.master.send_signal(18)  # SIGCONT
    time.sleep(TIMEOUT)
    assert peer.drives(0.6)

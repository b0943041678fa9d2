# SPDX-License-Identifier: BSD-3-Clause
"""base_node when the ROS master dies, and when another one takes its place. Fault 14 of the base, without a guard."""

import contextlib
import signal
import subprocess
import time
from itertools import pairwise

import pytest
import yaml

from kurumaisu.bench.faults.base.peers import Commander, Graph, until
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.params import shipped

NODE = "/base_node"
BASE = yaml.safe_load(shipped("launch/base_node.yaml").read_text())
TIMEOUT = 1.5  # [s] master_timeout of the test's base_node
V = 0.6  # [m/s]
DECELERATION = BASE["limits"]["ride"]["v_deceleration"]
RUNS_OUT = BASE["inputs"]["navigation"]["timeout"]


class Chair:
    """A master, a base_node that only publishes its voltages, and a commander."""

    def __init__(self, stack, folder):
        self.graph = Graph(stack)
        self.log = folder / "peer.log"
        values = BASE | {"master_timeout": TIMEOUT}
        for name, file in (("model", "md100"), ("guard", "guard")):
            values[name] = yaml.safe_load(shipped(f"launch/{file}.yaml").read_text())
        self.graph.set_parameter(NODE, values)
        self.base = self.graph.run([program("base_node")], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.peer = Commander(self.graph, self.log)

    def set_off(self):
        self.peer.say(0.0, 0.0)
        self.peer.wait("active", lambda event: event["name"] == "navigation")
        self.peer.say(V, 0.0)
        self.peer.wait("voltages", lambda event: event["v"] == V)

    def rests(self, peer, since):
        """Return when the chair came to rest after that [s, monotonic]."""
        return peer.wait("voltages", lambda event: event["v"] == 0.0, since).t

    def goes_on_as(self, v, count):
        """So many more samples are all of that speed."""
        begin = time.monotonic()
        until(lambda: len(self.peer.heard("voltages", begin)) >= count, f"{count} samples")
        assert {event["v"] for event in self.peer.heard("voltages", begin)} == {v}


def samples(seconds):
    return round(seconds * BASE["rate"])


@pytest.fixture
def chair(tmp_path):
    with contextlib.ExitStack() as stack:
        yield Chair(stack, tmp_path)


def test_a_master_that_dies_brakes_and_another_one_ends_it(chair):
    chair.set_off()
    died = chair.graph.kill_master()
    took = chair.rests(chair.peer, died) - died  # though the peer commands on
    assert took < TIMEOUT * 1.2 + V / DECELERATION + 0.5
    speeds = [event["v"] for event in chair.peer.heard("voltages", died)]
    assert max(a - b for a, b in pairwise(speeds)) < DECELERATION * BASE["longest_step"] + 1e-9  # a ramp
    chair.goes_on_as(0.0, samples(1.0))
    assert chair.base.poll() is None
    chair.graph.start_master()
    said, _ = chair.base.communicate(timeout=PATIENCE)
    assert chair.base.returncode == 1
    assert "BASE_MASTER_LOST" in said
    assert "BASE_MASTER_FORGOT" in said
    assert chair.peer.heard("voltages")[-1]["v"] == 0.0


def test_with_its_commander_gone_too_it_stops_at_the_command_s_timeout(chair):
    listener = Commander(chair.graph, chair.log)
    chair.set_off()
    listener.wait("voltages", lambda event: event["v"] == V)
    chair.graph.kill_master()
    died = chair.peer.signal(signal.SIGKILL)
    assert chair.rests(listener, died) - died < RUNS_OUT + V / DECELERATION + 0.3
    chair.base.terminate()
    chair.base.communicate(timeout=PATIENCE)
    assert chair.base.returncode == 0


def test_a_master_that_is_busy_for_a_moment_is_none_of_it(chair):
    chair.set_off()
    chair.graph.master.send_signal(signal.SIGSTOP)
    chair.goes_on_as(V, samples(0.5 * TIMEOUT))
    chair.graph.master.send_signal(signal.SIGCONT)
    chair.goes_on_as(V, samples(TIMEOUT))

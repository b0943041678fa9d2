# SPDX-License-Identifier: BSD-3-Clause
"""base_node's ports: strangers find them closed, and it goes to no stranger."""

import contextlib
import socket
import subprocess
import time
import xmlrpc.client
from pathlib import Path

import pytest
import yaml

from kurumaisu.bench.faults.base.peers import Graph, until
from kurumaisu.bench.processes import PATIENCE, program
from kurumaisu.params import shipped

NODE = "/base_node"
STRANGER = "192.0.2.1"  # an address of documentation: nobody has it


class Base:
    """A base_node whose log is read."""

    def __init__(self, stack, folder, **changes):
        self.graph = Graph(stack)
        values = yaml.safe_load(shipped("launch/base_node.yaml").read_text()) | changes
        for name, file in (("model", "md100"), ("guard", "guard")):
            values[name] = yaml.safe_load(shipped(f"launch/{file}.yaml").read_text())
        self.graph.set_parameter(NODE, values)
        self.log = folder / "log"
        self.process = self.graph.run(
            [program("base_node")], stdout=stack.enter_context(self.log.open("w")), stderr=subprocess.STDOUT
        )

    def ports(self):
        """Return the addresses and ports at which it listens."""
        sockets = set()
        for link in Path(f"/proc/{self.process.pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                sockets.add(str(link.readlink()))
        found = set()
        for line in Path(f"/proc/{self.process.pid}/net/tcp").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and f"socket:[{words[9]}]" in sockets:
                host, port = words[1].split(":")
                found.add((socket.inet_ntoa(bytes.fromhex(host)[::-1]), int(port, 16)))
        return found


@pytest.fixture
def stack():
    with contextlib.ExitStack() as stack:
        yield stack


def test_it_listens_at_the_loopback_only_where_ros_is_local(stack, tmp_path):
    base = Base(stack, tmp_path)
    until(lambda: len(base.ports()) == 2, "both ports are open")
    assert {host for host, _ in base.ports()} == {"127.0.0.1"}


def listed(base):
    """Have it told that a stranger publishes what it hears."""
    until(lambda: len(base.ports()) == 2, "both ports are open")
    master = xmlrpc.client.ServerProxy(base.graph.environment["ROS_MASTER_URI"])
    until(lambda: master.lookupNode("/test", NODE)[0] == 1, "it is registered")
    uri = master.lookupNode("/test", NODE)[2]
    time.sleep(0.5)
    xmlrpc.client.ServerProxy(uri).publisherUpdate("/master", "/cmd_vel", [f"http://{STRANGER}:1/"])


def test_it_goes_to_no_stranger(stack, tmp_path):
    base = Base(stack, tmp_path)
    listed(base)
    until(lambda: f"BASE_HOST_REFUSED: a connection to {STRANGER}" in base.log.read_text(), "a warning")


def test_it_goes_to_whom_it_may(stack, tmp_path):
    base = Base(stack, tmp_path, allowed_hosts=["192.0.2.0/24"])
    listed(base)
    time.sleep(1.0)
    assert "BASE_HOST_REFUSED" not in base.log.read_text()


def test_a_host_that_is_none_is_named(stack, tmp_path):
    base = Base(stack, tmp_path, allowed_hosts=["laptop"])
    assert base.process.wait(PATIENCE) == 1
    assert "/base_node/allowed_hosts: must have addresses like 192.168.1.20" in base.log.read_text()
    assert "not laptop" in base.log.read_text()

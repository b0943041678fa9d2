# SPDX-License-Identifier: BSD-3-Clause
"""robot.launch beside a master that is replaced ends with an error; beside one that is not, as it is told."""

import contextlib
import os
import signal
import socket
import xmlrpc.client
from pathlib import Path

import pytest

from kurumaisu.bench.processes import PATIENCE, free_port, running
from kurumaisu.ros.testing.nodes import wait_for


@pytest.fixture
def environment(tmp_path):
    return {
        **os.environ,
        "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        "ROS_HOSTNAME": "localhost",
        "ROS_LOG_DIR": str(tmp_path / "log"),
        "ROS_HOME": str(tmp_path),
    }


@contextlib.contextmanager
def master(environment):
    port = int(environment["ROS_MASTER_URI"].rpartition(":")[2])
    with running(["rosmaster", "--core", "-p", str(port)], None, environment) as process:
        wait_for(lambda: not socket.socket().connect_ex(("localhost", port)), "a master")
        yield process


@contextlib.contextmanager
def robot(tmp_path, environment):
    """Run robot.launch until its nodes are there."""
    command = ["roslaunch", "kurumaisu", "robot.launch", "laser:=none"]
    with running(command, tmp_path / "said", environment) as launch:
        proxy = xmlrpc.client.ServerProxy(environment["ROS_MASTER_URI"])
        wait_for(lambda: proxy.lookupNode("/test", "/base_node")[0] == 1, "base_node is registered")
        watch = wait_for(lambda: [pid for pid in below(launch.pid) if "launch_watch" in words(pid)], "launch_watch")
        wait_for(lambda: is_blocked(watch[0]), "launch_watch watches")
        yield launch


def below(pid):
    return [int(word) for file in Path(f"/proc/{pid}/task").glob("*/children") for word in file.read_text().split()]


def words(pid):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


def is_blocked(pid):
    """Whether a process waits for SIGINT itself."""
    (mask,) = [line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("SigBlk")]
    return bool(int(mask.split()[1], 16) >> (signal.SIGINT - 1) & 1)


def test_a_master_that_is_replaced_ends_it_with_an_error(tmp_path, environment):
    with master(environment) as first, robot(tmp_path, environment) as launch:
        nodes = below(launch.pid)
        first.send_signal(signal.SIGINT)
        first.wait(PATIENCE)
        with master(environment):
            assert launch.wait(PATIENCE) != 0
            wait_for(lambda: not [pid for pid in nodes if "kurumaisu" in words(pid)], "none is left behind")
    assert "LAUNCH_MASTER_REPLACED" in (tmp_path / "said").read_text()


def test_it_ends_as_it_is_told(tmp_path, environment):
    with master(environment), robot(tmp_path, environment) as launch:
        launch.send_signal(signal.SIGINT)
        assert launch.wait(PATIENCE) == 0
    assert "LAUNCH_MASTER_REPLACED" not in (tmp_path / "said").read_text()

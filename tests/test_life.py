# SPDX-License-Identifier: BSD-3-Clause
"""Every node in Python ends within 5 s of SIGINT or SIGTERM, at any moment, whatever the master does or does not."""

from __future__ import annotations

import contextlib
import os
import random
import re
import signal
import socket
import subprocess
import time
import xmlrpc.client
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import roslaunch.config
import roslaunch.xmlloader
import roslib.packages

TREE = Path(__file__).resolve().parents[1]
ENDS = 5.0  # [s]
LIMIT = 60.0  # [s] for anything else on a busy machine
SIGNALS = (signal.SIGINT, signal.SIGTERM)
MAP = TREE / "worlds/maps/room.yaml"
# Command lines; and the launch file whose parameters the node reads.
NODES: dict[str, tuple[list[str], str]] = {
    "sim_node": ([], "sim.launch"),
    "viewer": (["__name:=viewer_node", "_port:=0"], "viewer.launch"),
    "stageros": (["-g", str(TREE / "worlds/room.world")], ""),
    "waypoint_node": (["__name:=driver"], "round.launch"),
    "map_server": ([str(MAP)], ""),
    "map_saver": ([], ""),
    "odom_to_tf": ([], ""),
    "replay_odometry": ([], ""),
    "joystick": (["_device:=/dev/null"], ""),
    "teleop_joy": ([], ""),
    "teleop_keyboard": ([], ""),
    "critic watch": ([], ""),
    "critic experiment": (["creep"], ""),
    "calibrate record": (["drive.bag"], ""),
}


def command(name: str) -> list[str]:
    program, *part = name.split()
    (found,) = roslib.packages.find_node("kurumaisu", program)
    return [found, *part, *NODES.get(name, ([], ""))[0]]


def test_every_node_is_here():
    """What imports rospy at its start, of all scripts."""
    starts = [path for path in (TREE / "src/kurumaisu/ros").rglob("*.py") if "life.run(" in path.read_text()]
    names = {name for path in starts for name in re.findall(r'life\.run\(\s*"(\w+)"', path.read_text())}
    known = {name.split()[-1] for name in NODES}
    renamed = {"viewer_node": "viewer", "critic_watch": "watch", "calibrate": "record"}
    assert {renamed.get(name, name) for name in names} == known
    others = [path for path in (TREE / "src/kurumaisu/ros").rglob("*.py") if "init_node(" in path.read_text()]
    assert {path.name for path in others} == {"life.py", "base_peer.py"}  # the last one is a peer of tests


@contextlib.contextmanager
def started(name: str, uri: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    environment = {
        **os.environ,
        "ROS_MASTER_URI": uri,
        "ROS_HOSTNAME": "localhost",
        "ROS_LOG_DIR": str(folder / "log"),
        "ROS_HOME": str(folder),
    }
    folder.mkdir(exist_ok=True)
    with (folder / "said").open("wb") as said:
        master, terminal = os.openpty() if "keyboard" in name else (None, subprocess.DEVNULL)
        process = subprocess.Popen(
            command(name), env=environment, stdin=terminal, stdout=said, stderr=said, cwd=folder, start_new_session=True
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for end in (master, terminal):
            if end is not None and end >= 0:
                os.close(end)


def ends(process: subprocess.Popen[bytes], number: int) -> None:
    begin = time.monotonic()
    process.send_signal(number)
    process.wait(ENDS)
    assert time.monotonic() - begin < ENDS


def until(condition, what: str) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


@contextlib.contextmanager
def deaf_master() -> Iterator[str]:
    """Serve a port that takes connections, and never answers."""
    with socket.create_server(("127.0.0.1", 0), backlog=64) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}/"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def real_master(folder: Path, launch: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run a master with the parameters of a launch file."""
    port = free_port()
    uri = f"http://localhost:{port}"
    environment = {**os.environ, "ROS_LOG_DIR": str(folder / "log"), "ROS_HOSTNAME": "localhost"}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], env=environment, **silent)
    try:
        until(lambda: not socket.socket().connect_ex(("127.0.0.1", port)), "the master answers")
        if launch:
            loader, config = roslaunch.xmlloader.XmlLoader(), roslaunch.config.ROSLaunchConfig()
            loader.load(str(TREE / "launch" / launch), config, argv=["bag:=none"], verbose=False)
            for key, parameter in config.params.items():
                xmlrpc.client.ServerProxy(uri).setParam("/test", key, parameter.value)
        yield uri, process
    finally:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()


@pytest.mark.parametrize("name", NODES)
def test_ends_without_a_master(name, tmp_path):
    with started(name, f"http://localhost:{free_port()}", tmp_path) as process:
        said = tmp_path / "said"
        until(lambda: b"no master at" in said.read_bytes(), f"{name} says that there is none")
        assert b"start roscore, or use roslaunch" in said.read_bytes()
        time.sleep(1.0)
        assert said.read_bytes().count(b"no master at") == 1
        ends(process, signal.SIGINT)
    assert b"Traceback" not in said.read_bytes()


def all_at_once(case, name: str, latest: float) -> None:
    """Run a case with either signal at moments of a start, [s] to latest; the same ones each time."""
    moments = [random.Random(f"{name} {number}").uniform(0.0, latest) for number in range(4)]
    with ThreadPoolExecutor(len(moments)) as pool:
        cases = [pool.submit(case, str(i), moment, SIGNALS[i % 2]) for i, moment in enumerate(moments)]
    for each in cases:
        each.result()


@pytest.mark.parametrize("name", NODES)
def test_ends_beside_a_deaf_master(name, tmp_path):
    with deaf_master() as uri:

        def case(folder: str, moment: float, number: int) -> None:
            with started(name, uri, tmp_path / folder) as process:
                time.sleep(moment)
                ends(process, number)

        all_at_once(case, name, 4.0)


@pytest.mark.parametrize("name", NODES)
def test_ends_when_the_master_falls_silent_while_it_registers(name, tmp_path):
    def case(folder: str, moment: float, number: int) -> None:
        with (
            real_master(tmp_path, NODES[name][1]) as (uri, master),
            started(name, uri, tmp_path / folder) as process,
        ):
            time.sleep(moment)
            master.send_signal(signal.SIGSTOP)
            time.sleep(0.3)
            ends(process, number)

    all_at_once(case, name, 5.0)


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
def test_ends_in_order_beside_a_good_master(name, number, tmp_path):
    """Signed off: nothing of it is left on the master's books."""
    with real_master(tmp_path, NODES[name][1]) as (uri, _), started(name, uri, tmp_path / "node") as process:
        proxy = xmlrpc.client.ServerProxy(uri)

        def nodes() -> set[str]:
            return {node for side in proxy.getSystemState("/test")[2] for _, those in side for node in those}

        until(lambda: nodes() or process.poll() is not None, f"{name} is registered")
        time.sleep(1.0)
        ends(process, number)
        assert nodes() == set()
    said = (tmp_path / "node/said").read_text()
    assert "Traceback" not in said or "/usr/bin/rosbag" in said  # which has one of its own while it loads


def test_an_address_that_is_none_is_named(tmp_path):
    with started("odom_to_tf", "http://localhost:none", tmp_path) as process:
        assert process.wait(LIMIT) == 1
    assert "ROS_MASTER_URI: must be http://HOST:PORT, not http://localhost:none" in (tmp_path / "said").read_text()


@pytest.mark.parametrize("name", ["odom_to_tf", "laser_node"])  # one in each language
def test_says_that_the_clock_is_silent(name, tmp_path):
    with real_master(tmp_path, "") as (uri, _):
        xmlrpc.client.ServerProxy(uri).setParam("/test", "/use_sim_time", True)
        with started(name, uri, tmp_path / "node"):
            said = tmp_path / "node/said"
            until(lambda: "/use_sim_time is true, but nothing comes on /clock" in said.read_text(), "it says so")

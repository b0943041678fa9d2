# SPDX-License-Identifier: BSD-3-Clause
"""What stageros costs a second of simulated time with every topic heard, next to stage_ros where it is built."""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
import xmlrpc.client
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, cpu, master, memory, program
from kurumaisu.bench.speed.user_worlds import Case, cases, cave
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error

_TOPICS = ("odom", "base_scan", "base_pose_ground_truth")


@dataclass(frozen=True)
class _Cost:
    """What was measured: CPU [s] per simulated second, simulated seconds per second, share of messages lost."""

    cpu: float
    speed: float
    lost: float
    memory: float  # [MB] resident


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables. Return 1 if the peer is there and cheaper."""
    parser = argparse.ArgumentParser(prog="scripts/bench stageros", description=__doc__)
    parser.add_argument("--peer", help="stage_ros' executable; LD_LIBRARY_PATH must lead to its libstage")
    parser.add_argument("--map", type=Path, help="bitmap of 16 m a side, as Stage's cave.png; else boxes")
    parser.add_argument("--stage-ros-tree", type=Path, metavar="DIR", help="stage_ros' sources, for its willow")
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 10], help="in the map or among the boxes")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement")
    parser.add_argument("--repeats", type=int, default=3, help="the median counts")
    options = parser.parse_args(arguments)
    nodes = {"stageros": [program("stageros")]}
    if options.peer:
        nodes["stage_ros"] = [options.peer]
    with tempfile.TemporaryDirectory() as name, master() as environment:
        folder = Path(name)
        worlds = [cave(folder, robots, options.map) for robots in options.robots]
        worlds += cases(folder, options.stage_ros_tree)
        dearer = _running(nodes, worlds, options, environment)
        _starting(nodes, worlds, options.repeats, environment)
    return int(dearer)


def _running(
    nodes: dict[str, list[str]], worlds: Sequence[Case], options: argparse.Namespace, environment: dict[str, str]
) -> bool:
    """Print what a simulated second costs; return whether any is dearer than the peer's."""
    table = Table(
        "flat out, every topic heard by roscpp; robots x beams, in steps of 100 ms where nothing else is said",
        *("world and node", "CPU s per simulated s", "real-time factor", "lost [%]", "memory [MB]", "times stage_ros"),
    )
    dearer = False
    for world in worlds:
        costs = _in_turn(nodes, world, options, environment)
        for name, cost in costs.items():
            ratio = cost.cpu / costs["stage_ros"].cpu if "stage_ros" in costs else math.nan
            table.row(f"{world.name}, {name}", cost.cpu, cost.speed, 100 * cost.lost, cost.memory, ratio)
            dearer |= ratio > 1
    return dearer


def _starting(nodes: dict[str, list[str]], worlds: Sequence[Case], repeats: int, environment: dict[str, str]) -> None:
    """Print what it costs until a world runs."""
    table = Table("from the start until the world runs", "world and node", "CPU [s]", "wall [s]")
    for world in worlds:
        runs: dict[str, list[tuple[float, float]]] = {name: [] for name in nodes}
        for _ in range(repeats):
            for name, command in nodes.items():
                runs[name].append(_start(command, world, environment))
        for name, times in runs.items():
            table.row(f"{world.name}, {name}", *sorted(times)[len(times) // 2])


def _start(command: list[str], world: Case, environment: dict[str, str]) -> tuple[float, float]:
    """Return CPU and wall time [s] of a node until it has its service, the last thing that both nodes make."""
    name, begin = f"start_{time.monotonic_ns()}", time.monotonic()
    node = _begun([*command, f"__name:={name}"], world, environment)
    try:
        while not _is_serving(environment["ROS_MASTER_URI"], f"/{name}"):
            if node.poll() is not None or time.monotonic() > begin + PATIENCE:
                raise Error(f"{command[0]}: {world.path.name}: did not start")
            time.sleep(0.01)
        return cpu(node.pid), time.monotonic() - begin
    finally:
        node.terminate()
        node.wait(PATIENCE)


def _in_turn(
    nodes: dict[str, list[str]], world: Case, options: argparse.Namespace, environment: dict[str, str]
) -> dict[str, _Cost]:
    """Return each node's cost, the run of median CPU time; they take turns, so that a busy machine is busy for all."""
    runs: dict[str, list[_Cost]] = {name: [] for name in nodes}
    for _ in range(options.repeats):
        for name, command in nodes.items():
            runs[name].append(_measure(command, world, options.seconds, environment))
    return {name: sorted(costs, key=lambda cost: cost.cpu)[len(costs) // 2] for name, costs in runs.items()}


def _measure(command: list[str], world: Case, seconds: float, environment: dict[str, str]) -> _Cost:
    """Run a node with a listener on every topic."""
    prefixes = [f"/robot_{i}/" for i in range(world.robots)] if world.robots > 1 else ["/"]
    topics = ["/clock", "/tf", *(prefix + topic for prefix in prefixes for topic in (*_TOPICS, "cmd_vel"))]
    node = _begun(command, world, environment)
    try:
        with _listening(seconds, topics, environment) as listener:
            before = _counts(_line(listener)), cpu(node.pid), time.monotonic()
            after = _counts(_line(listener)), cpu(node.pid), time.monotonic()
            resident = memory(node.pid)
    finally:
        node.terminate()
        node.wait(PATIENCE)
    _all_heard(after[0], command, world)
    heard = {topic: after[0][topic] - before[0][topic] for topic in after[0]}
    simulated = heard["/clock"] * world.interval
    others = [count for topic, count in heard.items() if topic not in ("/clock", "/tf")]
    lost = 1 - sum(others) / len(others) / heard["/clock"]
    return _Cost((after[1] - before[1]) / simulated, simulated / (after[2] - before[2]), lost, resident)


def _begun(command: list[str], world: Case, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    # flat out, 0.2 s of simulated time go by before a command is heard
    line = [*command, "_base_watchdog_timeout:=0", "-g", str(world.path)]
    return children.start(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@contextmanager
def _listening(seconds: float, topics: Sequence[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    line = [program("listener"), str(seconds), *topics]
    with children.start(line, env=environment, stdout=subprocess.PIPE, text=True) as listener:
        yield listener


def _line(listener: subprocess.Popen[str]) -> str:
    assert listener.stdout is not None
    return listener.stdout.readline()


def _is_serving(uri: str, node: str) -> bool:
    """Return whether a node has its service."""
    answer: Any = xmlrpc.client.ServerProxy(uri).getSystemState("/bench")
    return ["/reset_positions", [node]] in answer[2][2]


def _all_heard(heard: dict[str, int], command: Sequence[str], world: Case) -> None:
    if not heard or 0 in heard.values():
        raise Error(f"{command[0]}: {world.path.name}: nothing came on {[t for t, n in heard.items() if n == 0]}")


def _counts(line: str) -> dict[str, int]:
    words = line.split()
    return dict(zip(words[::2], map(int, words[1::2]), strict=True))

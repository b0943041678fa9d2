# SPDX-License-Identifier: BSD-3-Clause
"""What stageros costs a second of simulated time with every topic heard, next to stage_ros where it is built."""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, cpu, master, memory, program
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

_INTERVAL = 0.1  # [s] of the world
_SIDE = 16.0  # [m] of the room or the map, as of Stage's cave
_PACE = 1.5  # [m] between robots
_TOPICS = ("odom", "base_scan", "base_pose_ground_truth")
_MODELS = """
resolution 0.02
interval_sim 100
define room model ( size [{side} {side} 1] boundary 1 {bitmap} )
define box model ( size [0.5 0.5 1] )
define laser ranger ( size [0.05 0.05 0.1] sensor ( range [0 5.6] fov 240 samples 682 ) )
define robot position ( size [0.1 0.1 0.1] drive "diff" laser ( pose [0 0 0 0] ) )
room ( pose [0 0 0 0] )
"""


@dataclass(frozen=True)
class _Cost:
    """What was measured: CPU [s] per simulated second, simulated seconds per second, share of messages lost."""

    cpu: float
    speed: float
    lost: float
    memory: float  # [MB] resident


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if the peer is there and cheaper."""
    parser = argparse.ArgumentParser(prog="scripts/bench stageros", description=__doc__)
    parser.add_argument("--peer", help="stage_ros' executable; LD_LIBRARY_PATH must lead to its libstage")
    parser.add_argument("--map", type=Path, help=f"bitmap of {_SIDE:g} m a side, as Stage's cave.png; else boxes")
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 10])
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement")
    parser.add_argument("--repeats", type=int, default=3, help="the median counts")
    options = parser.parse_args(arguments)
    nodes = {"stageros": [sys.executable, "-c", "from kurumaisu.ros.stageros.node import main; main()"]}
    if options.peer:
        nodes["stage_ros"] = [options.peer]
    table = Table(
        f"flat out, 682 beams, every topic heard by roscpp, {'map ' + options.map.name if options.map else 'boxes'}",
        *("node and robots", "CPU s per simulated s", "real-time factor", "lost [%]", "memory [MB]", "times stage_ros"),
    )
    dearer = False
    with tempfile.TemporaryDirectory() as folder, master() as environment:
        for robots in options.robots:
            world = Path(folder) / f"{robots}.world"
            write_whole({world: world_of(robots, options.map)})
            costs = _in_turn(nodes, world, robots, options, environment)
            for name, cost in costs.items():
                ratio = cost.cpu / costs["stage_ros"].cpu if "stage_ros" in costs else math.nan
                table.row(f"{name}, {robots}", cost.cpu, cost.speed, 100 * cost.lost, cost.memory, ratio)
                dearer |= ratio > 1
    return int(dearer)


def world_of(robots: int, bitmap: Path | None) -> str:
    """Return a world file: robots on a lattice in a room of boxes, or around the middle of a map."""
    text = _MODELS.format(side=_SIDE, bitmap=f'bitmap "{bitmap.resolve()}"' if bitmap else "")
    columns = math.ceil(math.sqrt(robots))
    places = [(i % columns, i // columns) for i in range(robots)]
    middle = (columns - 1) / 2
    text += "".join(f"robot ( pose [{_PACE * (x - middle)} {_PACE * (y - middle)} 0 0] )\n" for x, y in places)
    if not bitmap:
        rim = np.linspace(0, 2 * math.pi, 24, endpoint=False)
        text += "".join(f"box ( pose [{6 * math.cos(a):.3f} {6 * math.sin(a):.3f} 0 20] )\n" for a in rim)
    return text


def _in_turn(
    nodes: dict[str, list[str]], world: Path, robots: int, options: argparse.Namespace, environment: dict[str, str]
) -> dict[str, _Cost]:
    """Return each node's cost, the run of median CPU time; they take turns, so that a busy machine is busy for all."""
    runs: dict[str, list[_Cost]] = {name: [] for name in nodes}
    for _ in range(options.repeats):
        for name, command in nodes.items():
            runs[name].append(_measure(command, world, robots, options.seconds, environment))
    return {name: sorted(costs, key=lambda cost: cost.cpu)[len(costs) // 2] for name, costs in runs.items()}


def _measure(command: list[str], world: Path, robots: int, seconds: float, environment: dict[str, str]) -> _Cost:
    """Run a node with a listener on every topic."""
    prefixes = [f"/robot_{i}/" for i in range(robots)] if robots > 1 else ["/"]
    topics = ["/clock", "/tf", *(prefix + topic for prefix in prefixes for topic in (*_TOPICS, "cmd_vel"))]
    # flat out, 0.2 s of simulated time go by before a command is heard
    line = [*command, "_base_watchdog_timeout:=0", "-g", str(world)]
    node = children.start(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with children.start(
            [program("listener"), str(seconds), *topics], env=environment, stdout=subprocess.PIPE, text=True
        ) as listener:
            assert listener.stdout is not None
            before = _counts(listener.stdout.readline()), cpu(node.pid), time.monotonic()
            after = _counts(listener.stdout.readline()), cpu(node.pid), time.monotonic()
            resident = memory(node.pid)
    finally:
        node.terminate()
        node.wait(PATIENCE)
    if not after[0] or 0 in after[0].values():
        raise Error(f"{command[0]}: {world.name}: nothing came on {[t for t, n in after[0].items() if n == 0]}")
    heard = {topic: after[0][topic] - before[0][topic] for topic in after[0]}
    simulated = heard["/clock"] * _INTERVAL
    others = [count for topic, count in heard.items() if topic not in ("/clock", "/tf")]
    lost = 1 - sum(others) / len(others) / heard["/clock"]
    return _Cost((after[1] - before[1]) / simulated, simulated / (after[2] - before[2]), lost, resident)


def _counts(line: str) -> dict[str, int]:
    words = line.split()
    return dict(zip(words[::2], map(int, words[1::2]), strict=True))

# SPDX-License-Identifier: BSD-3-Clause
"""What base_node costs beside roscpp alone: from a command to its voltage, and CPU at 50 Hz and at 1 kHz."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from kurumaisu import children
from kurumaisu.bench.guard_rig import Rig
from kurumaisu.bench.processes import PATIENCE, cpu, master, memory, program
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

_INPUT = "experiment_vel"  # of base_node.yaml: its limits let a small step through at once
_RATES = ((50.0, 50.0), (50.0, 1000.0), (1000.0, 1000.0))  # [Hz] of the loop, of commands
_PEER = "diff_drive_controller"
_LATENCY, _SHARE = 1e-3, 0.01  # at 50 Hz: p99 [s] at most, and share of a core


@dataclass(frozen=True)
class Cost:
    """Of one run: seconds from each command to its voltage, commands overtaken by the next, share of a core, MB."""

    latencies: FloatArray
    overtaken: int
    cpu: float
    memory: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per rate of loop and commands. Return 1 if at 50 Hz it is slow or dear."""
    parser = argparse.ArgumentParser(prog="scripts/bench drive", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each row")
    parser.add_argument(
        "--peer", type=Path, metavar="PROGRAM", help="drivers/diff_drive.cpp, built elsewhere: more rows"
    )
    options = parser.parse_args(arguments)
    title = f"base_node, {options.seconds:g} s a row: from a command's publishing to the coming of its voltage"
    columns = ("commands", "median [ms]", "p99 [ms]", "longest [ms]", "overtaken", "CPU [%]", "memory [MB]")
    table = Table(title, "D/A or peer, loop, commands", *columns)
    more = [(_PEER, str(options.peer))] if options.peer else []
    good = True
    for loop, commands in _RATES:
        for name, peer in (("roscpp alone", program("drive_floor")), *more, ("topic", None), ("guard", None)):
            cost = measure(name, peer, loop, commands, options.seconds)
            late = _row(table, f"{name}, {loop:g} Hz, {commands:g} Hz", cost)
            if commands == _RATES[0][1] and name == "topic":
                good = late < _LATENCY and cost.cpu < _SHARE
    table.note("roscpp alone: a node with the same topics and rates that computes nothing.")
    table.note("guard: with a virtual board at a pty; the time has its answer, the share not the guard's own CPU.")
    table.note(f"Limits at 50 Hz, topic: p99 {1e3 * _LATENCY:g} ms, CPU {100 * _SHARE:g} %.")
    return int(not good)


def _row(table: Table, name: str, cost: Cost) -> float:
    """Print a row; return the 99th percentile of the latencies [s]."""
    median, late, longest = np.percentile(1e3 * cost.latencies, [50, 99, 100])
    count = len(cost.latencies) + cost.overtaken
    table.row(name, str(count), median, late, longest, str(cost.overtaken), 100 * cost.cpu, cost.memory)
    return float(1e-3 * late)


def measure(name: str, peer: str | None, loop: float, commands: float, seconds: float) -> Cost:
    """Run base_node with that D/A converter, or a peer, with so many Hz and commands a second for so long [s]."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        environment = stack.enter_context(master())
        rig = Rig(folder)
        if name == "guard":
            stack.enter_context(rig.board())
            rig.start()
        if peer is not None:
            command = [peer, str(loop)]
        else:
            _load(loop, rig.settings if name == "guard" else None, folder, environment)
            command = [program("base_node")]
        pid = stack.enter_context(_node(command, folder, environment))
        probe = children.start(
            [program("drive_probe"), _INPUT, str(commands), str(seconds)],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert probe.stdout is not None
        probe.stdout.readline()  # it begins
        begin, used = time.monotonic(), cpu(pid)
        latencies = np.array([float(line) for line in probe.stdout])  # its end
        share = (cpu(pid) - used) / (time.monotonic() - begin)
        probe.wait(PATIENCE)
        answered = latencies[latencies >= 0]
        if not len(answered):
            raise Error("drive_probe: no command was obeyed")
        return Cost(answered, int(np.sum(latencies < 0)), share, memory(pid))


def _load(loop: float, guard: Path | None, folder: Path, environment: dict[str, str]) -> None:
    """Give base_node the shipped settings but for the rate of its loop."""
    settings = _yaml(shipped("launch/base_node.yaml"))
    settings["rate"] = loop
    settings["dac"]["kind"] = "guard" if guard else "topic"
    settings["guard"] = _yaml(guard or shipped("launch/guard.yaml"))
    settings["model"] = _yaml(shipped("launch/md100.yaml"))
    file = folder / "parameters.yaml"
    write_whole({file: yaml.safe_dump(settings)})
    subprocess.run(["rosparam", "load", str(file), "/base_node"], env=environment, check=True, timeout=PATIENCE)


@contextlib.contextmanager
def _node(command: list[str], folder: Path, environment: dict[str, str]) -> Iterator[int]:
    """Run a node; yield its process id."""
    with (folder / "log").open("w") as log:
        process = children.start(command, env=environment, stdout=log, stderr=log)
    try:
        time.sleep(1.0)  # what it costs to start does not count
        if process.poll() is not None:
            raise Error(f"{command[0]}: ended: {(folder / 'log').read_text(encoding='utf-8')}")
        yield process.pid
    finally:
        process.terminate()
        process.wait(PATIENCE)


def _yaml(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))

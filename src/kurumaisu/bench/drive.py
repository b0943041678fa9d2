# SPDX-License-Identifier: BSD-3-Clause
"""What base_node costs: from a command to the voltage that obeys it, and CPU at 50 Hz and at 1 kHz."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from kurumaisu.bench.processes import PATIENCE, cpu, master, memory, program
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_INPUT = "experiment_vel"  # of base_node.yaml: its limits let a small step through at once
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
    parser = argparse.ArgumentParser(prog="bench drive", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each row")
    options = parser.parse_args(arguments)
    title = f"base_node, topic back end, {options.seconds:g} s a row: a command's publishing to its voltage's coming"
    columns = ("commands", "median [ms]", "p99 [ms]", "longest [ms]", "overtaken", "CPU [%]", "memory [MB]")
    table = Table(title, "loop and commands", *columns)
    good = True
    for loop, commands in ((50.0, 50.0), (50.0, 1000.0), (1000.0, 1000.0)):
        cost = measure(loop, commands, options.seconds)
        median, late, longest = np.percentile(1e3 * cost.latencies, [50, 99, 100])
        count = len(cost.latencies) + cost.overtaken
        name = f"{loop:g} Hz, commands {commands:g} Hz"
        table.row(name, str(count), median, late, longest, str(cost.overtaken), 100 * cost.cpu, cost.memory)
        if commands == 50.0:
            good = late < 1e3 * _LATENCY and cost.cpu < _SHARE
    print(f"limits at 50 Hz: p99 {1e3 * _LATENCY:g} ms, CPU {100 * _SHARE:g} %")
    return int(not good)


def measure(loop: float, commands: float, seconds: float) -> Cost:
    """Run base_node with a loop of so many Hz for so long, with so many commands a second."""
    with (
        tempfile.TemporaryDirectory() as folder,
        master() as environment,
        _base(loop, Path(folder), environment) as pid,
    ):
        probe = subprocess.Popen(
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


@contextlib.contextmanager
def _base(loop: float, folder: Path, environment: dict[str, str]) -> Iterator[int]:
    """Run base_node with the shipped settings but for the rate of its loop; yield its process id."""
    settings = yaml.safe_load(shipped("launch/base_node.yaml").read_text(encoding="utf-8"))
    settings["rate"] = loop
    settings["model"] = yaml.safe_load(shipped("launch/md100.yaml").read_text(encoding="utf-8"))
    file = folder / "parameters.yaml"
    file.write_text(yaml.safe_dump(settings), encoding="utf-8")
    subprocess.run(["rosparam", "load", str(file), "/base_node"], env=environment, check=True, timeout=PATIENCE)
    with (folder / "log").open("w") as log:
        process = subprocess.Popen([program("base_node")], env=environment, stdout=log, stderr=log)
    try:
        time.sleep(1.0)  # what it costs to start does not count
        if process.poll() is not None:
            raise Error(f"base_node: ended: {(folder / 'log').read_text(encoding='utf-8')}")
        yield process.pid
    finally:
        process.terminate()
        process.wait(PATIENCE)

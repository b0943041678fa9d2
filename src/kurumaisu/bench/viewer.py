# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer costs a simulation that runs flat out: nobody looks, one page, ten of which one hangs; and a soak."""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from kurumaisu.bench.processes import PATIENCE, master, memory, running
from kurumaisu.bench.stageros import world_of
from kurumaisu.bench.table import Table
from kurumaisu.bench.viewer_page import Page
from kurumaisu.errors import Error
from kurumaisu.params import shipped

_STAGEROS = "from kurumaisu.ros.stageros import main; main()"
_VIEWER = "from kurumaisu.ros.viewer_node import main; main()"
_CALL = (
    "import rospy, sys; from std_srvs.srv import {kind}; print(rospy.ServiceProxy('{name}', {kind})({said}).message)"
)
# In one process, without anything between: starting one takes longer than some thousand steps.
_CLOCKS = """
import rospy, time
from std_srvs.srv import SetBool
pause = rospy.ServiceProxy("/stageros/pause", SetBool)
def clocks():
    said = pause(False).message
    return said.split()[1], time.monotonic(), *(time.clock_gettime((~pid << 3) | 2) for pid in ({simulator}, {viewer}))
pause(False)
before = clocks()
time.sleep({seconds})
print(*before, *clocks())
"""
_PHASES = {"nobody looks": 0, "one page": 1, "ten pages, one hangs": 10}
_SETTLE = 0.5  # [s] after pages have come or gone


@dataclass
class _Rig:
    """The processes, and how they are asked."""

    environment: dict[str, str]
    simulator: int
    viewer: int
    address: str
    pages: list[Page] = field(default_factory=list)

    def passed(self, seconds: float) -> list[float]:
        """Return simulated time, wall time, and CPU time [s] of simulator and viewer that have passed meanwhile."""
        program = _CLOCKS.format(simulator=self.simulator, viewer=self.viewer, seconds=seconds)
        numbers = [float(word) for word in _said(self.environment, program).split()]
        return [b - a for a, b in zip(numbers[:4], numbers[4:], strict=True)]

    def look(self, count: int) -> None:
        """Have so many pages; the last of ten hangs, and comes again when it was cut off."""
        for page in self.pages:
            page.close()
        self.pages = [Page(self.address) for _ in range(count)]
        for page in self.pages:
            page.wait(partial(page.counts.get, "scan"), "scans")
        if count > 1:
            self.pages[-1].stall()
        time.sleep(_SETTLE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables. Return 1 if one page costs the simulator 5 % or more."""
    parser = argparse.ArgumentParser(prog="bench viewer")
    parser.add_argument("--robots", type=int, default=10, help="with 682 beams each")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each measurement")
    parser.add_argument("--repeats", type=int, default=5, help="of all, in turns; the median counts")
    parser.add_argument("--soak", type=float, default=0.0, help="seconds of ten pages, one of which hangs, besides")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, master() as environment:
        world = Path(folder) / "bench.world"
        world.write_text(world_of(options.robots, None))
        simulator = [sys.executable, "-c", _STAGEROS, "-g", str(world)]
        viewer = [sys.executable, "-c", _VIEWER, *_parameters(environment)]
        with running(simulator, environment=environment) as one, running(viewer, environment=environment) as other:
            rig = _Rig(environment, one.pid, other.pid, _address(environment))
            dearer = _costs(rig, options)
            if options.soak:
                _soak(rig, options.soak)
            rig.look(0)
    return int(dearer)


def _costs(rig: _Rig, options: argparse.Namespace) -> bool:
    """Print what each phase costs; return whether one page costs too much."""
    runs: dict[str, list[tuple[float, float, float, float]]] = {name: [] for name in _PHASES}
    for _ in range(options.repeats):
        for name, count in _PHASES.items():
            rig.look(count)
            runs[name].append(_measure(rig, options.seconds))
    table = Table(
        f"stageros flat out, {options.robots} robots of 682 beams, {os.cpu_count()} cores",
        *("", "CPU s per simulated s", "times nobody", "real-time factor", "viewer, CPU [%]", "frames/s of a page"),
    )
    medians = {name: [statistics.median(column) for column in zip(*rows, strict=True)] for name, rows in runs.items()}
    # of neighbours in time, so that what else the machine does counts for both
    ratios = {
        name: statistics.median(a[0] / b[0] for a, b in zip(rows, runs["nobody looks"], strict=True))
        for name, rows in runs.items()
    }
    for name, (spent, speed, viewer, frames) in medians.items():
        table.row(name, spent, ratios[name], speed, viewer, frames)
    limit = 1.05
    return ratios["one page"] >= limit


def _measure(rig: _Rig, seconds: float) -> tuple[float, float, float, float]:
    """Return CPU [s] and wall [s] per simulated second, the viewer's share of a core [%], states a page had [1/s]."""
    count, start = rig.pages[0].counts["state"] if rig.pages else 0, time.monotonic()
    simulated, wall, spent, viewer = rig.passed(seconds)
    frames = rig.pages[0].counts["state"] - count if rig.pages else 0
    return spent / simulated, simulated / wall, 100 * viewer / wall, frames / (time.monotonic() - start)


def _soak(rig: _Rig, seconds: float) -> None:
    """Print the viewer's memory over time with ten pages, one of which hangs, is cut off and comes again."""
    table = Table(
        "ten pages, one hangs", "[s]", "viewer [MB]", "simulator [MB]", "frames/s of a page", "cut off so far"
    )
    rig.look(10)
    begin = time.monotonic()
    cut = 0
    part = max(seconds / 10, 1.0)
    while time.monotonic() - begin < seconds:
        seen, start = rig.pages[0].counts["state"], time.monotonic()
        while time.monotonic() - start < part:
            time.sleep(0.1)
            if rig.pages[-1].cut_off:
                cut += 1
                rig.pages[-1].close()
                rig.pages[-1] = Page(rig.address)
                rig.pages[-1].stall()
        rate = (rig.pages[0].counts["state"] - seen) / (time.monotonic() - start)
        table.row(f"{time.monotonic() - begin:.0f}", memory(rig.viewer), memory(rig.simulator), rate, cut)


def _parameters(environment: dict[str, str]) -> list[str]:
    """Set the viewer's parameters; return what its command line adds."""
    subprocess.run(
        ["rosparam", "load", str(shipped("launch/viewer.yaml")), "/viewer_node"], env=environment, check=True
    )
    said = {
        "port": 0,
        "control": "false",
        "simulator": "stageros",
        "base": "none",
        "drive/topic": "none",
        "model": str(shipped("launch/md100.yaml")),
    }
    for name, value in said.items():
        subprocess.run(["rosparam", "set", f"/viewer_node/{name}", str(value)], env=environment, check=True)
    return ["__name:=viewer_node"]


def _address(environment: dict[str, str]) -> str:
    """Return where the page is, as soon as the viewer says so."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            return _call(environment, "Trigger", "/viewer_node/new_token", "")
        except Error:
            time.sleep(0.2)
    raise Error("viewer_node: does not answer")


def _call(environment: dict[str, str], kind: str, name: str, said: str) -> str:
    return _said(environment, _CALL.format(kind=kind, name=name, said=said))


def _said(environment: dict[str, str], program: str) -> str:
    """Return what a program in Python prints. Raise Error with its last words if it fails."""
    answer = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    if answer.returncode:
        raise Error(answer.stderr.splitlines()[-1] if answer.stderr else program)
    return answer.stdout.strip()

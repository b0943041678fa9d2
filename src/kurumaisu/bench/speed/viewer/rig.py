# SPDX-License-Identifier: BSD-3-Clause
"""A simulator with its viewer, and pages without a browser, for the benchmark of the viewer."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from kurumaisu import children
from kurumaisu.bench.processes import PATIENCE, master, running
from kurumaisu.bench.speed.user_worlds import cave
from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.whole_files import write_whole

_NODE = "from kurumaisu.ros.{}.node import main; main()"
_VIEWER = "from kurumaisu.ros.viewer.node import main; main()"
# What the ray caster's threads cost depends on which cores are free, by more than a page costs.
_FLEET = {"simulator": {"threads": 1}}
_SETTLE = 0.5  # [s] after pages have gone
_COME = 1.5  # [s] after they have come: the first second costs more, as topics are asked for
# One process for all that is asked of the nodes: starting one takes longer than some thousand steps. With seconds it
# answers time, wall time, and CPU time of simulator and viewer, before and after; else with what the service says.
_ASK = """
import rospy, sys, time
from std_srvs.srv import SetBool, Trigger
rospy.wait_for_service("{pause}", {patience})
pause = rospy.ServiceProxy("{pause}", SetBool)
def clocks():
    said = pause(False).message
    return said.split()[1], time.monotonic(), *(time.clock_gettime((~pid << 3) | 2) for pid in ({simulator}, {viewer}))
for line in sys.stdin:
    kind, what = line.split()
    if kind == "pass":
        pause(False)
        before = clocks()
        time.sleep(float(what))
        print(*before, *clocks(), flush=True)
    else:
        rospy.wait_for_service(what, {patience})
        print(rospy.ServiceProxy(what, Trigger)().message.replace(chr(10), "; "), flush=True)
"""


@dataclass
class Rig:
    """The processes, and how they are asked."""

    simulator: int
    viewer: int
    asked: subprocess.Popen[str]
    address: str = ""
    pages: list[Page] = field(default_factory=list)

    def passed(self, seconds: float) -> list[float]:
        """Return simulated time, wall time, and CPU time [s] of simulator and viewer that have passed meanwhile."""
        numbers = [float(word) for word in self._ask(f"pass {seconds}").split()]
        return [b - a for a, b in zip(numbers[:4], numbers[4:], strict=True)]

    def service(self, name: str) -> str:
        """Return what a service of the viewer says."""
        return self._ask(f"call /viewer_node/{name}")

    def look(self, count: int) -> None:
        """Have so many pages; the last of ten hangs."""
        for page in self.pages:
            page.close()
        self.pages = [Page(self.address) for _ in range(count)]
        for page in self.pages:
            page.wait(partial(page.counts.get, "scan"), "scans")
        if count > 1:
            self.pages[-1].stall()
        time.sleep(_COME if count else _SETTLE)

    @contextlib.contextmanager
    def stopped(self) -> Iterator[None]:
        """Let the viewer's whole process hang, with what it listens to."""
        os.kill(self.viewer, signal.SIGSTOP)
        try:
            time.sleep(_SETTLE)
            yield
        finally:
            os.kill(self.viewer, signal.SIGCONT)

    def _ask(self, line: str) -> str:
        assert self.asked.stdin is not None
        assert self.asked.stdout is not None
        self.asked.stdin.write(line + "\n")
        self.asked.stdin.flush()
        answer = self.asked.stdout.readline()
        if not answer:
            raise Error(f"{line}: the nodes do not answer")
        return answer.strip()


@contextlib.contextmanager
def rig_of(simulator: str, robots: int, clocked: Path | None = None) -> Iterator[Rig]:
    """Run a simulator flat out: stageros with so many robots, or sim_node with the chair; and its viewer.

    clocked: where the simulator is to leave what its thread did for the viewer, when it ends.
    """
    with tempfile.TemporaryDirectory() as folder, master() as environment:
        if simulator == "stageros":
            arguments, services = ["-g", str(cave(Path(folder), robots, None).path)], "/stageros/"
        else:
            arguments, services = [], "/"
        program = ["-c", _NODE.format(simulator.removesuffix("_node"))]
        if clocked is not None:
            program = ["-m", "kurumaisu.bench.speed.viewer.thread", simulator, str(clocked)]
        command = [sys.executable, *program, *arguments]
        viewer = [sys.executable, "-c", _VIEWER]
        parameters = Path(folder) / "parameters.yaml"
        said = {"sim_node": _chair(), "stageros": _FLEET, "viewer_node": _viewer(simulator)}
        write_whole({parameters: yaml.safe_dump(said)})
        subprocess.run(["rosparam", "load", str(parameters)], env=environment, check=True)
        with running(command, environment=environment) as one, running(viewer, environment=environment) as other:
            questions = _ASK.format(pause=f"{services}pause", simulator=one.pid, viewer=other.pid, patience=PATIENCE)
            with children.start(
                [sys.executable, "-c", questions],
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            ) as asked:
                rig = Rig(one.pid, other.pid, asked)
                rig.address = rig.service("new_token")
                yield rig
                rig.look(0)


def _chair() -> dict[str, Any]:
    """Return what sim.launch sets, but flat out."""
    files = {
        "world": "worlds/building.world",
        "model": "launch/md100.yaml",
        "dynamics": "launch/physical.yaml",
        "laser_sensor": "launch/urg/urg_04lx.yaml",
    }
    return {
        **_loaded("launch/sim_node.yaml"),
        **{name: str(shipped(file)) for name, file in files.items()},
        **dict.fromkeys(("effects", "start", "world_values", "sensors", "laser_faults"), "none"),
        "laser": "direct",
        "laser_port": "urg",
        "image_extents": False,
        "base_frame": "base_link",
        "seed": 1,
        "speed": 0.0,
    }


def _viewer(simulator: str) -> dict[str, Any]:
    """Return what viewer.launch sets."""
    shown = _loaded("launch/viewer.yaml")
    return {
        **shown,
        "port": 0,
        "control": False,
        "simulator": simulator,
        "base": "none",
        "odom_frame": "odom",
        "base_frame": "base_link",
        "drive": {**shown["drive"], "topic": "none"},
        "model": str(shipped("launch/md100.yaml")),
    }


def _loaded(file: str) -> dict[str, Any]:
    values: dict[str, Any] = yaml.safe_load(shipped(file).read_text())
    return values

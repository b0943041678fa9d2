# SPDX-License-Identifier: BSD-3-Clause
"""Stage itself, built elsewhere, as the peer of a benchmark."""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, FloatArray, IntArray

DRIVERS = Path(__file__).parent / "drivers"  # programs that are compiled against a peer


@dataclass(frozen=True)
class Run:
    """What a simulator needed: CPU time to load [s] and to run [s], memory at its most [MiB]; final poses (n, 4)."""

    load: float
    cpu: float
    memory: float
    poses: FloatArray
    models: int = 0  # as the driver counts them; 0: not asked


def read_run(text: str) -> Run:
    """Read the `key value` lines that a driver prints. Raise Error if one is missing."""
    values: dict[str, float] = {}
    poses = []
    for words in (line.split() for line in text.splitlines()):
        if len(words) == 5 and words[0] == "pose":
            poses.append([float(word) for word in words[1:]])
        elif len(words) == 2 and words[0] in ("load", "cpu", "memory", "models"):
            values[words[0]] = float(words[1])
    if not {"load", "cpu", "memory"} <= values.keys():
        raise Error(f"a driver printed no load, cpu or memory: {text[-500:]!r}")
    return Run(
        values["load"], values["cpu"], values["memory"], np.array(poses).reshape(-1, 4), round(values.get("models", 0))
    )


class Stage:
    """A Stage 4.3 installed under a prefix, driven by a program of ours that is compiled into a folder."""

    def __init__(self, prefix: Path, folder: Path, driver: str = "stage") -> None:
        """Compile a driver. Raise Error with the compiler's words if that fails."""
        self._folder = folder
        self._program = folder / driver
        libraries = prefix / "lib"
        self._environment = {**os.environ, "STAGEPATH": str(next(libraries.glob("Stage-*"), libraries))}
        flags = self._run(
            "pkg-config", "--cflags", "stage", environment={**os.environ, "PKG_CONFIG_PATH": f"{libraries}/pkgconfig"}
        ).split()
        search = [f"-L{libraries}", "-lstage", f"-Wl,-rpath,{libraries}"]
        source, program = str(DRIVERS / f"{driver}.cpp"), str(self._program)
        self._run("g++", "-O2", "-w", "-std=c++17", *flags, source, *search, "-o", program)

    def _run(self, *command: str, environment: dict[str, str] | None = None) -> str:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise Error(f"{' '.join(command)}: returned {done.returncode}: {done.stderr[-1000:]}")
        return done.stdout

    def scan(self, world: Path, poses: FloatArray) -> tuple[FloatArray, FloatArray, Run]:
        """Scan from the first robot at poses (n, 3).

        Return ranges [m] and numbers of the models met, 0 also for none, (n, beams), and what it cost.
        """
        given, taken = self._folder / "poses", self._folder / "ranges"
        np.ascontiguousarray(poses, dtype=np.float64).tofile(given)
        command = (str(self._program), "scan", str(world), str(given), str(taken))
        text = self._run(*command, environment=self._environment)
        readings = np.fromfile(taken).reshape(len(poses), -1, 2)
        return readings[..., 0], readings[..., 1], read_run(text)

    def drive(self, world: Path, commands: FloatArray) -> tuple[FloatArray, BoolArray, IntArray]:
        """Give commands (steps, robots, 3) to the robots of a world, a row each step, by the driver stage_drive.

        Return poses (steps, robots, 4) after each step, who stalled in it (steps, robots), and the order (robots,) in
        which Stage moved them.
        """
        given, taken = self._folder / "commands", self._folder / "trace"
        np.ascontiguousarray(commands, dtype=np.float64).tofile(given)
        command = (str(self._program), str(world), str(given), str(taken))
        text = self._run(*command, environment=self._environment)
        order = next((line for line in text.splitlines() if line.startswith("order ")), "order")
        trace = np.fromfile(taken).reshape(*commands.shape[:2], 5)
        return trace[..., :4], trace[..., 4] != 0, np.array(order.split()[1:], dtype=np.int64)

    def run(self, world: Path, seconds: float, v: float, w: float) -> Run:
        """Run a world for so many simulated seconds, all robots at v [m/s], w [rad/s]."""
        arguments = (str(world), f"{seconds:g}", f"{v!r}", f"{w!r}")
        return read_run(self._run(str(self._program), "poses", *arguments, environment=self._environment))

# SPDX-License-Identifier: BSD-3-Clause
"""Stage itself, built elsewhere, as the peer of a benchmark."""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

_SOURCE = Path(__file__).parent / "drivers" / "stage.cpp"


@dataclass(frozen=True)
class Run:
    """What a simulator needed: CPU time to load [s] and to run [s], memory at its most [MiB]; final poses (n, 4)."""

    load: float
    cpu: float
    memory: float
    poses: FloatArray


def read_run(text: str) -> Run:
    """Read the `key value` lines that a driver prints. Raise Error if one is missing."""
    values: dict[str, float] = {}
    poses = []
    for words in (line.split() for line in text.splitlines()):
        if len(words) == 5 and words[0] == "pose":
            poses.append([float(word) for word in words[1:]])
        elif len(words) == 2 and words[0] in ("load", "cpu", "memory"):
            values[words[0]] = float(words[1])
    if len(values) != 3:
        raise Error(f"a driver printed no load, cpu or memory: {text[-500:]!r}")
    return Run(values["load"], values["cpu"], values["memory"], np.array(poses).reshape(-1, 4))


class Stage:
    """A Stage 4.3 installed under a prefix, driven by a program of ours that is compiled into a folder."""

    def __init__(self, prefix: Path, folder: Path) -> None:
        """Compile the driver. Raise Error with the compiler's words if that fails."""
        self._folder = folder
        self._program = folder / "stage"
        libraries = prefix / "lib"
        self._environment = {**os.environ, "STAGEPATH": str(next(libraries.glob("Stage-*"), libraries))}
        flags = self._run(
            "pkg-config", "--cflags", "stage", environment={**os.environ, "PKG_CONFIG_PATH": f"{libraries}/pkgconfig"}
        ).split()
        search = [f"-L{libraries}", "-lstage", f"-Wl,-rpath,{libraries}"]
        self._run("g++", "-O2", "-w", "-std=c++17", *flags, str(_SOURCE), *search, "-o", str(self._program))

    def _run(self, *command: str, environment: dict[str, str] | None = None) -> str:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise Error(f"{' '.join(command)}: returned {done.returncode}: {done.stderr[-1000:]}")
        return done.stdout

    def scan(self, world: Path, poses: FloatArray) -> tuple[FloatArray, FloatArray, Run]:
        """Return ranges [m] and intensities (n, beams) of the first robot at poses (n, 3), and what it cost."""
        given, taken = self._folder / "poses", self._folder / "ranges"
        np.ascontiguousarray(poses, dtype=np.float64).tofile(given)
        text = self._run(str(self._program), "scan", str(world), str(given), str(taken), environment=self._environment)
        readings = np.fromfile(taken).reshape(len(poses), -1, 2)
        return readings[..., 0], readings[..., 1], read_run(text)

    def run(self, world: Path, seconds: float, v: float, w: float) -> Run:
        """Run a world for so many simulated seconds, all robots at v [m/s], w [rad/s]."""
        arguments = (str(world), f"{seconds:g}", f"{v!r}", f"{w!r}")
        return read_run(self._run(str(self._program), "poses", *arguments, environment=self._environment))

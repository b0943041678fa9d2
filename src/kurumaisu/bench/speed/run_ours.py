# SPDX-License-Identifier: BSD-3-Clause
"""Run a world as the driver of Stage does, alone in a process, and print what it cost."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.params import shipped
from kurumaisu.sim import Simulator, load_options
from kurumaisu.world import load_world


def main(world: Path, seconds: float, v: float, w: float, semantics: str, threads: int) -> None:
    """Drive all robots at v [m/s], w [rad/s]; print CPU times [s], memory [MiB] and poses as `key value` lines."""
    options = replace(load_options(shipped("launch/simulator.yaml")), semantics=semantics, threads=threads)
    start = time.process_time()
    simulator = Simulator(load_world(world), options)
    print("load", time.process_time() - start)
    commands = np.tile([v, 0.0, w], (len(simulator.robots), 1))
    start, wall = time.process_time(), time.perf_counter()
    for _ in range(round(seconds / simulator.interval)):
        observation = simulator.step(commands)
    print("cpu", time.process_time() - start)
    print("wall", time.perf_counter() - wall)
    print("memory", _peak_memory())
    for pose in observation.poses:
        print("pose", *(f"{value:.9g}" for value in pose))


def _peak_memory() -> float:
    """Return that of this process [MiB]; getrusage would count that of its parent too."""
    words = Path("/proc/self/status").read_text().split()
    return float(words[words.index("VmHWM:") + 1]) / 1024


if __name__ == "__main__":
    _seconds, _v, _w = (float(word) for word in sys.argv[2:5])
    main(Path(sys.argv[1]), _seconds, _v, _w, sys.argv[5], int(sys.argv[6]))

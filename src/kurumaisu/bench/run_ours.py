# SPDX-License-Identifier: BSD-3-Clause
"""Run a world as the driver of Stage does, alone in a process, and print what it cost."""

from __future__ import annotations

import resource
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
    print("memory", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    for pose in observation.poses:
        print("pose", *(f"{value:.9g}" for value in pose))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(float, sys.argv[2:5]), sys.argv[5], int(sys.argv[6]))

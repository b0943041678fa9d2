# SPDX-License-Identifier: BSD-3-Clause
"""What a second thread is worth to simulations side by side: wall time; run it on a machine that does nothing else."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.bench.table import Table
from kurumaisu.params import shipped
from kurumaisu.sim import Simulator, SimulatorPool, load_options
from kurumaisu.whole_files import write_whole
from kurumaisu.world import World, load_world

_SIMULATIONS = 8
_SCENES = ((1, 682), (10, 121), (100, 682))  # robots, beams


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark; return 0."""
    parser = argparse.ArgumentParser(prog="scripts/bench pool", description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args(arguments)
    table = Table(
        f"{_SIMULATIONS} simulations side by side: wall time of a step",
        "robots, beams",
        "1 thread [us]",
        "2 threads [us]",
        "faster",
    )
    with tempfile.TemporaryDirectory() as folder:
        for robots, beams in _SCENES:
            world = _world(Path(folder) / "a.world", robots, beams)
            one, two = _times(world, max(4, 400 // robots), options.repeats)
            table.row(f"{robots}, {beams}", one * 1e6, two * 1e6, one / two)
    return 0


def _times(world: World, steps: int, repeats: int) -> tuple[float, ...]:
    """Return the least wall time [s] of a step of one simulation with one thread and with two, in turn."""
    options = replace(load_options(shipped("launch/simulator.yaml")), semantics="stage", threads=1)
    simulators = [Simulator(world, options) for _ in range(_SIMULATIONS)]
    commands = np.zeros((_SIMULATIONS, len(simulators[0].robots), 3))
    commands[:, :, 2] = 0.5
    least = {1: np.inf, 2: np.inf}
    for _ in range(repeats):
        for threads in least:
            with SimulatorPool(simulators, threads) as pool:
                start = time.perf_counter()
                for _ in range(steps):
                    pool.step(commands)
                least[threads] = min(least[threads], (time.perf_counter() - start) / steps / _SIMULATIONS)
    return tuple(least.values())


def _world(path: Path, robots: int, beams: int) -> World:
    """Write a world of robots in rows in the shipped building; none minds the others' bodies."""
    laser = f"ranger ( sensor ( range [0 5.6] fov 240 samples {beams} ) )"
    rows = (f"pose [{1 + 0.2 * (i % 40):g} {0.8 + 0.3 * (i // 40):g} 0 {i}]" for i in range(robots))
    lines = [f"position ( {row} size [0.1 0.1 0.4] obstacle_return 0 {laser} )" for row in rows]
    write_whole({path: "\n".join([f'include "{shipped("worlds/building.world")}"', *lines])})
    return load_world(path)

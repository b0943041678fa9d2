# SPDX-License-Identifier: BSD-3-Clause
"""Worlds and simulators for the tests of the simulator."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.params import shipped
from kurumaisu.sim import Observation, Options, Simulator, load_options
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

OPTIONS: Options = replace(load_options(shipped("launch/simulator.yaml")), semantics="stage", timing="stage")
LASER = "ranger ( size [0 0 0.1] sensor ( range [0 20] fov 180 samples 181 size [0 0 0] ) )"
ROOM = """
model ( name "east" pose [5.05 0 0 0] size [0.1 10 2] ranger_return 7 )
model ( name "west" pose [-5.05 0 0 0] size [0.1 10 2] )
"""


def simulator(folder: Path, text: str, **options: Any) -> Simulator:
    path = folder / "t.world"
    path.write_text(text)
    return Simulator(load_world(path), replace(OPTIONS, **options))


def robot(inside: str = "", pose: str = "0 0 0 0") -> str:
    return f"position ( pose [{pose}] size [0.4 0.4 0.4] {inside} )\n"


def drive(sim: Simulator, command: Any, steps: int) -> list[Observation]:
    commands = np.broadcast_to(np.array(command, dtype=np.float64), (len(sim.robots), 3))
    return [sim.step(commands) for _ in range(steps)]


def euler(start: FloatArray, velocity: FloatArray, dt: float, steps: int, turn_first: bool = False) -> FloatArray:
    """Where (x, y) Stage's rule leads: a sum of equal steps along headings one turn apart, as a geometric series."""
    x, y, heading = start
    v, w = complex(velocity[0], velocity[1]) * dt, velocity[2] * dt
    first = np.exp(1j * (heading + w * turn_first))
    turns = steps if w == 0 else (1 - np.exp(1j * w * steps)) / (1 - np.exp(1j * w))
    end = complex(x, y) + v * first * turns
    return np.array([end.real, end.imag])

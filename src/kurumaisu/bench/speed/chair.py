# SPDX-License-Identifier: BSD-3-Clause
"""How fast simulated time runs for one chair with all that its model file says."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from kurumaisu.bench.speed.turns import in_turn
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import Model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.world import Start, World

_CIRCLE = (0.2, 0.5)  # v [m/s], w [rad/s]: a radius of 0.4 m
_START = np.array([2.9, 6.95, 0.0])  # in the first room, where the whole circle is free


def simulated_time(model: Model, world: World, seconds: float, repeats: int) -> None:
    """Print how much faster than real time the simulator drives a circle; reset and first scan count."""
    v, w = _CIRCLE
    table = Table(
        f"{seconds:g} s on a circle of {v / w:g} m in {world.name}, {model.laser.beams} beams at "
        f"{1 / model.laser.scan_time:g} Hz, one core",
        *("floor", "simulated s per CPU s", "CPU [ms per simulated s]", "scans"),
    )
    uneven = with_effects(model, shipped("launch/uneven_floor.yaml"))
    simulators = {name: _on_circle(chair, world) for name, chair in (("even", model), ("uneven", uneven))}
    actions = {name: partial(_drive, simulator, model, seconds) for name, simulator in simulators.items()}
    scans = {name: action() for name, action in actions.items()}
    costs = in_turn(actions, repeats)
    for name, cost in costs.items():
        table.row(name, seconds / cost, 1e3 * cost / seconds, str(scans[name]))


def _on_circle(model: Model, world: World) -> ChairSimulator:
    return ChairSimulator(
        model, replace(world, starts=(Start("circle", _START),)), load_dynamics(shipped("launch/physical.yaml"))
    )


def _drive(simulator: ChairSimulator, model: Model, seconds: float) -> int:
    """Drive the circle; return the number of scans. Raise Error if it is not free."""
    v, w = _CIRCLE
    command = Command(
        float(model.translation.volts(np.array(v))), float(model.steering.volts(np.array(w))), np.sign(v), np.sign(w)
    )
    scans = int(simulator.reset(1).scan is not None)
    for _ in range(round(seconds / simulator.step_time)):
        observation = simulator.step(command)
        scans += observation.scan is not None
        if observation.contact:
            raise Error(f"the circle is not free: contact at {observation.time:.2f} s, pose {observation.pose}")
    return scans

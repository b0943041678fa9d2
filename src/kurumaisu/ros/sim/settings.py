# SPDX-License-Identifier: BSD-3-Clause
"""Private parameters of sim_node: launch/sim_node.yaml and the arguments of sim.launch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kurumaisu.params import Model, load_model
from kurumaisu.settings import Section
from kurumaisu.sim.robots.state_folder import StateFolder
from kurumaisu.sim.sensors.settings import SensorSettings, load_sensors
from kurumaisu.sim.settings import Dynamics, load_dynamics, with_effects
from kurumaisu.world import Start, World, load_world
from kurumaisu.world.files import parse_values

NONE = "none"  # of a file or a text that is not given


@dataclass(frozen=True)
class DriverSettings:
    """The virtual URG that a driver reads, if it is to: files of model and sensor, where it is, what it does wrong."""

    model: Path
    sensor: Path
    port: str
    faults: tuple[str, ...]
    patience: float  # [s] of wall time
    intensity: float  # of reflectance 1


@dataclass(frozen=True)
class SimSettings:
    """What sim_node needs to know; see launch/sim_node.yaml for units and meaning."""

    model: Model
    world: World
    seed: int
    speed: float
    start_time: float
    clock_every: int  # [steps]
    ground_truth_every: int  # [steps]
    view_rate: float
    states: StateFolder
    map_frame: str
    base_frame: str
    voltage_timeout: float
    voltage_horizon: float
    voltage_lead: float
    voltage_patience: float
    dynamics: Dynamics
    sensors: tuple[SensorSettings, ...]
    driver: DriverSettings | None  # None: the simulator publishes the scan itself


def read_settings(values: Any, where: str) -> SimSettings:
    """Return the settings of a parameter tree. Raise Error naming the file or key for anything wrong."""
    top = Section(values, where)
    dynamics = load_dynamics(Path(top.text("dynamics")))
    step = dynamics.contacts.step
    model = Path(top.text("model"))
    settings = SimSettings(
        model=_model(top, model),
        world=_world(top),
        seed=top.integer("seed", at_least=0),
        speed=top.number("speed", at_least=0),
        start_time=top.number("start_time", above=0),
        clock_every=_every(top, "clock_rate", step),
        ground_truth_every=_every(top, "ground_truth_rate", step),
        view_rate=top.number("view_rate", above=0),
        states=StateFolder(Path(top.text("states"))),
        map_frame=_frame(top, "map_frame"),
        base_frame=_frame(top, "base_frame"),
        voltage_timeout=top.number("voltage_timeout", above=0),
        voltage_horizon=top.number("voltage_horizon", at_least=0),
        voltage_lead=top.number("voltage_lead", above=0),
        voltage_patience=top.number("voltage_patience", at_least=0),
        dynamics=dynamics,
        sensors=_sensors(top),
        driver=_driver(top, model),
    )
    top.end()
    return settings


def _model(top: Section, path: Path) -> Model:
    model = load_model(path)
    effects = top.text("effects")
    return model if effects == NONE else with_effects(model, Path(effects))


def _world(top: Section) -> World:
    """Return the world, with values for its parameters, and the chair where `start` says if not where the file does."""
    path, values, start = Path(top.text("world")), top.text("world_values"), top.text("start")
    given = {} if values == NONE else parse_values(values.split())
    world = load_world(path, image_extents=top.flag("image_extents"), values=given)
    if start == NONE:
        return world
    try:
        pose = np.array([float(number) for number in start.split()])
    except ValueError:
        pose = np.empty(0)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise top.error("start", f"must be x y yaw [m, m, rad], or {NONE}: {start!r}")
    return replace(world, starts=(Start("chair", pose), *world.starts[1:]))


def start_outside(world: World) -> str:
    """Return words for a start that lies outside of the world's walls, or none."""
    if not world.starts or not world.has_walls:
        return ""
    x, y, _ = world.start.tolist()
    x0, y0, x1, y1 = world.bounds
    if x0 <= x <= x1 and y0 <= y <= y1:
        return ""
    return (
        f"start: x {x:g}, y {y:g} m lies outside of the walls of {world.path}, which reach from x {x0:g} to {x1:g}, "
        f"y {y0:g} to {y1:g} m"
    )


def _sensors(top: Section) -> tuple[SensorSettings, ...]:
    file = top.text("sensors")
    return () if file == NONE else load_sensors(Path(file))


def _driver(top: Section, model: Path) -> DriverSettings | None:
    chosen, faults = top.text("laser", choices=("direct", "driver")), top.text("laser_faults")
    settings = DriverSettings(
        model=model,
        sensor=Path(top.text("laser_sensor")),
        port=top.text("laser_port"),
        faults=() if faults == NONE else tuple(faults.split()),
        patience=top.number("laser_patience", at_least=0),
        intensity=top.number("laser_intensity", at_least=0),
    )
    return settings if chosen == "driver" else None


def _frame(top: Section, key: str) -> str:
    frame = top.text(key)
    if frame.startswith("/"):
        raise top.error(key, f"must not start with a slash, which tf2 rejects: {frame}")
    return frame


def _every(top: Section, key: str, step: float) -> int:
    """Return how many steps a rate [Hz] of simulated time is apart."""
    rate = top.number(key, above=0)
    every = 1 / (rate * step)
    rounding = 1e-6
    if round(every) < 1 or abs(every - round(every)) > rounding:
        raise top.error(key, f"must divide 1 / physics.step = {1 / step:g} Hz: {rate:g}")
    return round(every)

# SPDX-License-Identifier: BSD-3-Clause
"""How bodies behave, launch/physical.yaml, and files of further effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from kurumaisu import settings
from kurumaisu.params import Model, effects_of


@dataclass(frozen=True)
class Physics:
    """Step [s], the longest in which contacts are solved once; slop [m]; friction, iterations [-].

    bias: share of an overlap left after 1 s.
    """

    step: float
    collision_slop: float
    collision_bias: float
    iterations: int
    friction: float


def _physics(section: settings.Section) -> Physics:
    physics = Physics(
        step=section.number("step", above=0),
        collision_slop=section.number("collision_slop", at_least=0),
        collision_bias=section.number("collision_bias", above=0),
        iterations=section.integer("iterations", at_least=1),
        friction=section.number("friction", at_least=0),
    )
    section.end()
    return physics


def with_effects(model: Model, path: Path) -> Model:
    """Return the model with the effects of a file besides its own: `effects: [{id: ..., parameters: {...}}]`.

    Raise Error naming file and key.
    """
    top = settings.load(path)
    more = effects_of(top)
    top.end()
    return replace(model, effects=(*model.effects, *more))


@dataclass(frozen=True)
class Dynamics:
    """What bodies do when they touch, and what the floor does to them; [-] but for density [kg/m^3].

    wheel_friction: of a robot's wheels, which limits the force of its motors; floor_friction: of other movable bodies;
    density: of robots and doors whose file gives no mass; hinge_torque [N m]: friction of a hinge.
    slope_speed [m/s]: what a rise of 1 m per metre along its heading takes from the speed of a robot.
    """

    contacts: Physics
    wheel_friction: float
    floor_friction: float
    density: float
    hinge_torque: float
    slope_speed: float
    slip: bool


def load_dynamics(path: Path) -> Dynamics:
    """Read a physical.yaml. Raise Error naming file and key."""
    top = settings.load(path)
    dynamics = Dynamics(
        contacts=_physics(top.section("physics")),
        wheel_friction=top.number("wheel_friction", above=0),
        floor_friction=top.number("floor_friction", at_least=0),
        density=top.number("density", above=0),
        hinge_torque=top.number("hinge_torque", at_least=0),
        slope_speed=top.number("slope_speed", at_least=0),
        slip=top.text("slip", ("on", "off")) == "on",
    )
    top.end()
    return dynamics

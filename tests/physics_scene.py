# SPDX-License-Identifier: BSD-3-Clause
"""Boxes and walls for the tests of physical motion; not a test."""

from dataclasses import replace

import numpy as np

from kurumaisu.params import shipped
from kurumaisu.sim.motion.physical import PhysicalMotion
from kurumaisu.sim.motion.rigid import Ground, Part, Rigid, rigid
from kurumaisu.sim.settings import Dynamics, load_dynamics
from kurumaisu.types import FloatArray

DYNAMICS: Dynamics = load_dynamics(shipped("launch/physical.yaml"))
SMOOTH: Dynamics = replace(DYNAMICS, contacts=replace(DYNAMICS.contacts, friction=0.0))  # sides without friction
SKIN = DYNAMICS.contacts.collision_slop
DT = 0.1


def box(
    length: float = 0.4,
    width: float = 0.4,
    *,
    tree: int = 0,
    mass: float = 20.0,
    driven: bool = True,
    friction: float = DYNAMICS.wheel_friction,
    heights: tuple[float, float] = (0.0, 1.0),
) -> Rigid:
    """Return a box about its origin."""
    x, y = length / 2, width / 2
    return prism([(x, y), (-x, y), (-x, -y), (x, -y)], tree, mass, driven, friction, heights)


def prism(
    corners: list[tuple[float, float]],
    tree: int,
    mass: float,
    driven: bool,
    friction: float,
    heights: tuple[float, float],
) -> Rigid:
    ring, z = np.array(corners), np.array(heights)
    edges = np.concatenate([ring, np.roll(ring, -1, axis=0), np.broadcast_to(z, (len(ring), 2))], axis=1)
    return rigid([Part(ring, z)], edges, driven=driven, tree=tree, mass=mass, friction=friction)


def thing(tree: int, mass: float = 20.0, friction: float = 0.5, size: float = 0.4) -> Rigid:
    """Return a box that nobody drives."""
    return box(size, size, tree=tree, mass=mass, driven=False, friction=friction)


def walls(*ends: tuple[float, float, float, float], heights: tuple[float, float] = (0.0, 1.0)) -> Ground:
    """Return walls of no thickness."""
    rows = np.array([[*end, *heights] for end in ends]).reshape(-1, 6)
    return Ground(rows, np.full(len(rows), 10**6))


def room(half: float) -> Ground:
    """Return a square room about the origin."""
    h = half
    return walls((-h, -h, h, -h), (h, -h, h, h), (h, h, -h, h), (-h, h, -h, -h))


def motion(rigids: list[Rigid], ground: Ground, poses: list[tuple[float, ...]], dynamics: Dynamics) -> PhysicalMotion:
    """Return bodies at poses of x, y, heading."""
    moved = PhysicalMotion(rigids, ground, dynamics)
    moved.place(np.array([[x, y, 0.0, heading] for x, y, heading in poses]))
    return moved


def run(moved: PhysicalMotion, velocities: list[tuple[float, float, float]], steps: int) -> FloatArray:
    """Return the poses (steps, b, 4) after each step of constant commands."""
    commands = np.array(velocities)
    return np.array([moved.move(commands, DT)[0] for _ in range(steps)])

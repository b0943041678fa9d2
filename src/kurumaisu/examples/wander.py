# SPDX-License-Identifier: BSD-3-Clause
"""Ten robots wander for a minute: the simulator, numpy, and nothing else."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.params import shipped
from kurumaisu.sim import Observation, Simulator, load_options
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

SPEED = 0.6  # [m/s] with nothing ahead
NEAR = 1.2  # [m] at which a robot slows down
SHARPEST = 1.2  # [rad/s]


def wander(observation: Observation, side: FloatArray) -> FloatArray:
    """Return commands (n, 3): slower the nearer something is ahead, turning to the robot's own side (n,), 1 or -1."""
    scans = np.stack([np.minimum(scan.ranges, 5.0) for scan in observation.scans])
    right, ahead, left = (part.min(axis=1) for part in np.array_split(scans, 3, axis=1))
    blocked = np.clip(1.5 - ahead / NEAR, 0.0, 1.0)
    forward = np.where(observation.stalled, -0.3, SPEED * (1.0 - blocked))
    turn = SHARPEST * blocked * side + 0.2 * (np.minimum(left, NEAR) - np.minimum(right, NEAR))
    return np.stack([forward, np.zeros_like(forward), turn], axis=-1)


def main(arguments: list[str] | None = None) -> int:
    """Run the example; return 0, or 1 for bad input, which is told on stderr."""
    parser = program.Parser(prog="example_numpy", description=__doc__)
    parser.add_argument("world", type=Path, nargs="?", metavar="FILE.world", help="worlds/wander.world by default")
    parser.add_argument("--seconds", type=float, default=60.0, help="of simulated time (60)")
    options = parser.parse_args(arguments)
    try:
        world = load_world(options.world or shipped("worlds/wander.world"))
        simulator = Simulator(world, load_options(shipped("launch/simulator.yaml")))
        if not simulator.robots or len(simulator.rangers) != len(simulator.robots):
            raise Error(f"{world.path}: this example wants robots with one laser each")
    except Error as error:
        return failed("example_numpy", error)
    began = time.perf_counter()
    observation = simulator.reset(seed=1)
    way = np.zeros(len(simulator.robots))
    side = np.random.default_rng(1).choice([-1.0, 1.0], len(simulator.robots))
    while observation.time < options.seconds:
        before = observation.poses
        observation = simulator.step(wander(observation, side))
        way += np.hypot(*(observation.poses - before)[:, :2].T)
    took = time.perf_counter() - began
    for robot, (x, y, _, _), metres in zip(simulator.robots, observation.poses, way, strict=True):
        print(f"{robot.name or robot.place}: {metres:5.1f} m driven, now at {x:6.2f}, {y:6.2f}")
    print(f"{observation.time:.0f} s simulated in {took:.2f} s; state {simulator.state_hash()[:16]}")
    return 0

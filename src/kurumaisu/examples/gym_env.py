# SPDX-License-Identifier: BSD-3-Clause
"""A Gymnasium environment: a robot with a laser shall reach places; pip install gymnasium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.params import shipped
from kurumaisu.sim import Observation, Simulator, load_options
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

Float32s = NDArray[np.float32]
REACHED = 0.3  # [m] from the goal
FARTHEST = 1.0e6  # [m] that a distance can be
LIMIT = 600  # steps of an episode
FARTHEST_GOAL = 3.0  # [m] from the start
STALL_COST = 10.0  # [m] of progress that a collision is worth


class GoalEnv(gymnasium.Env[Float32s, Float32s]):
    """Drives the first robot of a world; the others stand still.

    Action (2,): forward and turn, as shares of the file's largest velocities, -1 to 1. Observation (samples + 3,): the
    laser's readings as shares of its range, distance [m] to the goal, sine and cosine of its bearing. Reward: metres
    nearer to the goal. The episode ends at the goal or at the first collision.
    """

    metadata = {"render_modes": []}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, world: Path | None = None) -> None:
        """Build the world, worlds/wander.world by default. Raise Error if its first robot has no laser."""
        path = world or shipped("worlds/wander.world")
        self._simulator = Simulator(load_world(path), load_options(shipped("launch/simulator.yaml")))
        self._eye = next((i for i, fan in enumerate(self._simulator.rangers) if fan.robot == 0), None)
        if self._eye is None:
            raise Error(f"{path}: the first robot has no laser")
        self._fan = self._simulator.rangers[self._eye].fan
        self._robot = self._simulator.robots[0]
        self._goal = np.zeros(2)
        self._steps = 0
        high = np.append(np.ones(self._fan.samples, dtype=np.float32), np.array([FARTHEST, 1.0, 1.0], dtype=np.float32))
        low = np.append(np.zeros(self._fan.samples + 1, dtype=np.float32), np.array([-1.0, -1.0], dtype=np.float32))
        self.observation_space = spaces.Box(low, high, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32s, dict[str, Any]]:
        """Go back to the start and choose a goal."""
        super().reset(seed=seed)
        seen = self._simulator.reset(int(self.np_random.integers(2**31)))
        distance, bearing = self.np_random.uniform((1.0, -np.pi), (FARTHEST_GOAL, np.pi))
        self._goal = seen.poses[0, :2] + distance * np.array([np.cos(bearing), np.sin(bearing)])
        self._steps = 0
        return self._observe(seen), {"goal": self._goal.copy()}

    def step(self, action: Float32s) -> tuple[Float32s, float, bool, bool, dict[str, Any]]:
        """Drive for one interval of the world."""
        commands = np.zeros((len(self._simulator.robots), 3))
        commands[0, [0, 2]] = np.clip(action, -1.0, 1.0) * self._most
        before = self._distance(self._simulator.observe())
        seen = self._simulator.step(commands)
        self._steps += 1
        left, stalled = self._distance(seen), bool(seen.stalled[0])
        reward = before - left - STALL_COST * stalled
        return self._observe(seen), reward, stalled or left < REACHED, self._steps >= LIMIT, {"pose": seen.poses[0]}

    @property
    def _most(self) -> FloatArray:
        """Largest forward velocity [m/s] and turn [rad/s]."""
        bounds = self._robot.device.velocity_bounds  # type: ignore[union-attr]  # robots are positions
        return np.asarray(bounds[[0, 3], 1], dtype=np.float64)

    def _distance(self, seen: Observation) -> float:
        return float(np.hypot(*(self._goal - seen.poses[0, :2])))

    def _observe(self, seen: Observation) -> Float32s:
        assert self._eye is not None
        readings = np.minimum(seen.scans[self._eye].ranges / self._fan.range_max, 1.0)
        dx, dy = self._goal - seen.poses[0, :2]
        bearing = float(wrap(np.arctan2(dy, dx) - seen.poses[0, 3]))
        goal = [self._distance(seen), np.sin(bearing), np.cos(bearing)]
        return np.concatenate([np.maximum(readings, 0.0), goal]).astype(np.float32)

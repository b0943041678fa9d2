# SPDX-License-Identifier: BSD-3-Clause
"""A hand-written driver in the Gymnasium environment: what a learning one has to beat."""

from __future__ import annotations

from typing import Any

import numpy as np

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.types import FloatArray


def driver(observation: FloatArray) -> FloatArray:
    """Return an action (2,): towards the goal, slower where something is ahead, turning away from it."""
    *readings, _, sine, cosine = observation.tolist()
    thirds = np.array_split(np.array(readings), 3)
    room = float(thirds[1].min())
    away = 0.0 if room > 0.25 else 1.0 if thirds[2].mean() > thirds[0].mean() else -1.0
    turn = away or np.clip(np.arctan2(sine, cosine), -1, 1)
    forward = max(0.0, float(np.clip(4 * (room - 0.1), 0, 1))) * max(0.1, cosine if not away else 0.3)
    return np.array([forward, turn], dtype=np.float32)


def main(arguments: list[str] | None = None) -> int:
    """Run the example; return 0, or 1 for bad input, which is told on stderr."""
    parser = program.Parser(prog="example_gym", description=__doc__)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    try:
        env = _make()
    except Error as error:
        return failed("example_gym", error)
    for episode in range(options.episodes):
        observation, _ = env.reset(seed=options.seed + episode)
        total, ended, steps = 0.0, False, 0
        while not ended:
            observation, reward, terminated, truncated, _ = env.step(driver(observation))
            total, ended, steps = total + float(reward), terminated or truncated, steps + 1
        print(f"episode {episode + 1}: {steps} steps, {total:+.2f} m nearer, goal {observation[-3]:.2f} m away")
    return 0


def _make() -> Any:
    try:
        from kurumaisu.examples.gym_env import GoalEnv
    except ModuleNotFoundError as error:
        raise Error(f"{error.name} is missing: pip install gymnasium") from error
    return GoalEnv()

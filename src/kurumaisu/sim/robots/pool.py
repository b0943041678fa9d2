# SPDX-License-Identifier: BSD-3-Clause
"""Several simulations side by side, on several threads; the ray caster and the collisions run without Python's lock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TypeVar

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.sim.robots.observation import Observation
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.types import FloatArray

_T = TypeVar("_T")


class SimulatorPool:
    """Steps simulators together; results are those of each alone, whatever the number of threads."""

    def __init__(self, simulators: Sequence[Simulator], threads: int) -> None:
        """Share the simulators out among threads; close the pool, or use it in a with statement.

        Raise Error for less than one thread.
        """
        if threads < 1:
            raise Error(f"threads: must be at least 1: {threads}")
        self.simulators = tuple(simulators)
        count = min(threads, max(len(self.simulators), 1))
        self._shares = [range(first, len(self.simulators), count) for first in range(count)]
        self._executor = ThreadPoolExecutor(count) if count > 1 else None

    def reset(self, seeds: Sequence[int]) -> tuple[Observation, ...]:
        """Reset each with its seed. Raise Error for another number of seeds."""
        self._check("seeds", seeds)
        return self.map(lambda number, simulator: simulator.reset(seeds[number]))

    def step(self, commands: Sequence[FloatArray] | FloatArray) -> tuple[Observation, ...]:
        """Step each with its commands (n, 3). Raise Error for another number of them, or another shape."""
        self._check("commands", commands)
        return self.map(lambda number, simulator: simulator.step(np.asarray(commands[number])))

    def map(self, action: Callable[[int, Simulator], _T]) -> tuple[_T, ...]:
        """Return what an action, such as a whole episode, returns for each number and simulator, in their order.

        What it raises is raised here, after all others have ended.
        """

        def run(share: range) -> list[_T]:
            return [action(number, self.simulators[number]) for number in share]

        if self._executor is None:
            return tuple(run(self._shares[0]))
        futures = [self._executor.submit(run, share) for share in self._shares]
        done = [future.exception() or future.result() for future in futures]
        for problem in done:
            if isinstance(problem, BaseException):
                raise problem
        found = [iter(values) for values in done if isinstance(values, list)]
        return tuple(next(found[number % len(found)]) for number in range(len(self.simulators)))

    def close(self) -> None:
        """End the threads."""
        if self._executor is not None:
            self._executor.shutdown()

    def __enter__(self) -> SimulatorPool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check(self, what: str, given: Sequence[object] | FloatArray) -> None:
        if len(given) != len(self.simulators):
            raise Error(f"{what}: must be {len(self.simulators)}, one for each simulation, not {len(given)}")

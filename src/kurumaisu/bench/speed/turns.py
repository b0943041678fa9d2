# SPDX-License-Identifier: BSD-3-Clause
"""Timing that a busy machine does not spoil."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np


def in_turn(actions: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Return each action's median CPU time [s]; they take turns, so that a busy machine is busy for all."""
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats):
        for name, action in actions.items():
            start = time.process_time()
            action()
            times[name].append(time.process_time() - start)
    return {name: float(np.median(values)) for name, values in times.items()}

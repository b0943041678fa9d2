# SPDX-License-Identifier: BSD-3-Clause
"""A saved state of stageros: the simulator's, with the names under which its robots were published."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kurumaisu.errors import Error, told
from kurumaisu.ros.stageros.names import Names
from kurumaisu.sim.robots import state


def with_names(saved: bytes, names: Sequence[Names], numbered: int) -> bytes:
    """Return a simulator's state with the robots' names, in order, and how many robots there have ever been."""
    simulator = np.frombuffer(saved, dtype=np.uint8)
    return state.pack({"robots": [each.prefix for each in names], "numbered": numbered, "simulator": simulator})


def without_names(saved: bytes) -> tuple[list[str | None], int, bytes]:
    """Return the front of each robot's names, how many there have been, and the rest. Raise Error for other bytes."""
    known = state.unpack(saved)
    if known.keys() != {"robots", "numbered", "simulator"}:
        raise Error(f"state: is not one that stageros saved: it holds {told(sorted(map(str, known)))}")
    robots, numbered, simulator = known["robots"], known["numbered"], known["simulator"]
    if not (isinstance(robots, list) and all(each is None or _is_name(each) for each in robots)):
        raise Error(f"state: robots: must be names: {told(robots)}")
    if type(numbered) is not int or not isinstance(simulator, np.ndarray):
        raise Error(f"state: numbered, simulator: must be a number and bytes: {told(numbered)}, {told(simulator)}")
    return robots, numbered, simulator.tobytes()


def _is_name(each: object) -> bool:
    return isinstance(each, str) and re.fullmatch(r"[A-Za-z0-9_/]{1,200}", each) is not None

# SPDX-License-Identifier: BSD-3-Clause
"""What somebody who drives by hand asks for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """v forward [m/s], w to the left [rad/s]; held: somebody holds the dead-man."""

    v: float
    w: float
    held: bool


REST = Command(0.0, 0.0, held=False)

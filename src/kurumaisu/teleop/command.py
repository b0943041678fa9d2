# SPDX-License-Identifier: BSD-3-Clause
"""What somebody who drives by hand asks for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HandCommand:
    """v forward [m/s], w to the left [rad/s]; held: somebody holds the dead-man; drives: and wants to drive himself."""

    v: float
    w: float
    held: bool
    drives: bool = True


REST = HandCommand(0.0, 0.0, held=False, drives=False)
ALLOW = HandCommand(0.0, 0.0, held=True, drives=False)  # others may drive

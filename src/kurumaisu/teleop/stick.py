# SPDX-License-Identifier: BSD-3-Clause
"""A joystick's axes and buttons to a command, while its dead-man button is held."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from kurumaisu.settings import Section
from kurumaisu.teleop.command import ALLOW, REST, HandCommand


@dataclass(frozen=True)
class StickSettings:
    """Which axes and buttons mean what; v [m/s] and w [rad/s] at the end of the stick's way; timeout [s]."""

    axis_v: int
    axis_w: int
    dead_man: int
    v: float
    w: float
    fast: int
    fast_factor: float
    allow: int
    timeout: float


def read_stick(section: Section) -> StickSettings:
    """Take the keys of launch/teleop_joy.yaml. Raise Error naming key and value."""
    return StickSettings(
        axis_v=section.integer("axis_v", at_least=0),
        axis_w=section.integer("axis_w", at_least=0),
        dead_man=section.integer("dead_man", at_least=0),
        v=section.number("v", above=0),
        w=section.number("w", above=0),
        fast=section.integer("fast", at_least=-1),
        fast_factor=section.number("fast_factor", at_least=1),
        allow=section.integer("allow", at_least=-1),
        timeout=section.number("timeout", above=0),
    )


class Stick:
    """The last word of a joystick, which is rest when it is old, makes no sense, or the dead-man is not held."""

    def __init__(self, settings: StickSettings) -> None:
        self._settings = settings
        self._command = REST
        self._heard = -math.inf
        self.refused = 0  # words that made no sense

    def hear(self, axes: Sequence[float], buttons: Sequence[int], t: float) -> bool:
        """Take axes (-1 to 1, left and forward positive) and buttons at time t [s]; False if they make no sense."""
        command = self._read(axes, buttons)
        self._command = command or REST
        self._heard = t
        self.refused += command is None
        return command is not None

    def command(self, t: float) -> HandCommand:
        """Return what holds at time t [s]. A clock that ran backwards is silence, too."""
        if not 0 <= t - self._heard <= self._settings.timeout:
            self._command = REST
        return self._command

    def _read(self, axes: Sequence[float], buttons: Sequence[int]) -> HandCommand | None:
        s = self._settings
        if max(s.axis_v, s.axis_w) >= len(axes) or max(s.dead_man, s.fast, s.allow) >= len(buttons):
            return None
        v, w = axes[s.axis_v], axes[s.axis_w]
        if not (abs(v) <= 1 and abs(w) <= 1):  # NaN, too
            return None
        if not buttons[s.dead_man]:
            return ALLOW if s.allow >= 0 and buttons[s.allow] else REST
        factor = s.fast_factor if s.fast >= 0 and buttons[s.fast] else 1.0
        return HandCommand(factor * s.v * v, s.w * w, held=True)

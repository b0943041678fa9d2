# SPDX-License-Identifier: BSD-3-Clause
"""Keys to a command; that keys keep coming is the dead-man: a terminal does not say when one is let go."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kurumaisu.settings import Section
from kurumaisu.teleop.command import REST, HandCommand

# as teleop_twist_keyboard has them: which way v, w go
DIRECTIONS = {
    "u": (1, 1),
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "k": (0, 0),
    "l": (0, -1),
    "m": (-1, -1),
    ",": (-1, 0),
    ".": (-1, 1),
}
# which speeds a key makes greater or smaller: v, w
SPEEDS = {"q": (1, 1), "z": (-1, -1), "w": (1, 0), "x": (-1, 0), "e": (0, 1), "c": (0, -1)}
HELP = """\
   u    i    o       i , forward, backward      hold a key: when none comes for {timeout:g} s, the chair stops
   j    k    l       j l turn                   k or any other key: stop
   m    ,    .       u o m . in curves
q/z both speeds, w/x forward speed, e/c turning speed: {percent:g} % more or less        Ctrl-C ends
"""


@dataclass(frozen=True)
class KeySettings:
    """v [m/s], w [rad/s] to begin with and at most; step: by how much of itself a key changes them; timeout [s]."""

    v: float
    w: float
    v_max: float
    w_max: float
    step: float
    timeout: float


def read_keys(section: Section) -> KeySettings:
    """Take the keys of launch/teleop_keyboard.yaml. Raise Error naming key and value."""
    return KeySettings(**{name: section.number(name, above=0) for name in KeySettings.__annotations__})


class Keys:
    """What the keys say; rest as soon as they fall silent."""

    def __init__(self, settings: KeySettings) -> None:
        self._settings = settings
        self.v, self.w = settings.v, settings.w
        self._direction: tuple[int, int] | None = None
        self._heard = -math.inf

    def press(self, key: str, t: float) -> None:
        """Take a key at time t [s]."""
        if key in SPEEDS:  # it does not hold the chair in motion, nor does it stop it
            self.v, self.w = (
                min(speed * (1 + self._settings.step) ** sign, most)
                for speed, sign, most in zip(
                    (self.v, self.w), SPEEDS[key], (self._settings.v_max, self._settings.w_max), strict=True
                )
            )
            return
        self._direction = DIRECTIONS.get(key)
        self._heard = t

    def command(self, t: float) -> HandCommand:
        """Return what holds at time t [s]. A clock that ran backwards is silence, too."""
        if self._direction is None or not 0 <= t - self._heard <= self._settings.timeout:
            self._direction = None
            return REST
        return HandCommand(self.v * self._direction[0], self.w * self._direction[1], held=True)

# SPDX-License-Identifier: BSD-3-Clause
"""A joystick's events to axes and buttons, in the order and with the signs that joy_node gives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

_KEY, _ABSOLUTE, _SYN_DROPPED, _SYN = 1, 3, 3, 0  # of linux/input-event-codes.h
_FIRST_BUTTON = 0x100  # BTN_MISC: codes below are a keyboard's
_LAST_AXIS = 0x28  # ABS_VOLUME and those above are no sticks


class Event(Protocol):
    """An event of evdev."""

    type: int
    code: int
    value: int


@dataclass(frozen=True)
class JoystickAxis:
    """The code of an axis and its ends, as the kernel says; flat: around the middle, that counts as the middle."""

    code: int
    low: int
    high: int
    flat: int


class Joystick:
    """Axes from -1 to 1, left, up and forward positive, and buttons 0 or 1, as the events have made them."""

    def __init__(self, axes: Sequence[JoystickAxis], buttons: Iterable[int], dead_zone: float) -> None:
        """Take what the device has; dead_zone [1]: at least so much of a way counts as the middle."""
        self._axes = sorted((a for a in axes if a.code < _LAST_AXIS and a.high > a.low), key=lambda axis: axis.code)
        codes = sorted(code for code in buttons if code >= _FIRST_BUTTON)
        self._index = {code: i for i, code in enumerate(codes)}
        self._dead_zone = dead_zone
        self.axes = [0.0] * len(self._axes)
        self.buttons = [0] * len(codes)
        self.lost_events = False  # the kernel dropped some: what a button says may be old

    def take(self, event: Event) -> None:
        """Take one event."""
        if event.type == _KEY and event.code in self._index:
            self.buttons[self._index[event.code]] = int(event.value != 0)
        elif event.type == _ABSOLUTE:
            self.move(event.code, event.value)
        elif event.type == _SYN and event.code == _SYN_DROPPED:
            self.lost_events = True

    def press_only(self, codes: Iterable[int]) -> None:
        """Let these buttons be pressed, and no others."""
        pressed = set(codes)
        for code, i in self._index.items():
            self.buttons[i] = int(code in pressed)

    def move(self, code: int, value: int) -> None:
        """Put an axis to a value of the kernel's."""
        for i, axis in enumerate(self._axes):
            if axis.code == code:
                self.axes[i] = self._scaled(axis, value)

    def _scaled(self, axis: JoystickAxis, value: int) -> float:
        half = (axis.high - axis.low) / 2
        place = min(max((value - axis.low) / half - 1, -1.0), 1.0)
        dead = max(self._dead_zone, axis.flat / half)
        if abs(place) <= dead:
            return 0.0
        beyond = (abs(place) - dead) / (1 - dead)
        return -beyond if place > 0 else beyond  # the kernel counts to the right and to the rear

# SPDX-License-Identifier: BSD-3-Clause
"""A joystick read by evdev."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

from kurumaisu.errors import Error
from kurumaisu.teleop.device import Event, Joystick, JoystickAxis

_KEY, _ABSOLUTE = 1, 3  # of linux/input-event-codes.h


class Device(Protocol):
    """What is used of evdev.InputDevice."""

    def capabilities(self) -> dict[int, Any]:
        """Return codes by type of event; of axes, with what absinfo says."""

    def read(self) -> Iterable[Event]:
        """Return what has happened, or raise BlockingIOError."""

    def active_keys(self) -> Sequence[int]:
        """Return the codes of the buttons that are pressed."""

    def absinfo(self, axis_num: int) -> Any:
        """Return value, min, max and flat of an axis."""

    def close(self) -> None:
        """Close it."""


def open_device(path: Path) -> Device:
    """Open /dev/input/event* or a link to one. Raise Error naming it when that fails."""
    import evdev  # here: tests do without a device

    try:
        device: Device = evdev.InputDevice(path)
    except OSError as error:
        raise Error(f"{path}: {error.strerror or error}") from error
    return device


class JoystickReader:
    """A device and what its axes and buttons are by now."""

    def __init__(self, device: Device, dead_zone: float) -> None:
        """Raise Error for a device without axes or buttons of a joystick."""
        self._device = device
        has = device.capabilities()
        axes = [JoystickAxis(code, info.min, info.max, info.flat) for code, info in has.get(_ABSOLUTE, ())]
        self.joystick = Joystick(axes, has.get(_KEY, ()), dead_zone)
        if not self.joystick.axes or not self.joystick.buttons:
            raise Error("the device has no axes, or no buttons: it is not a joystick")
        self._codes = [axis.code for axis in axes]
        self._synchronise()

    def poll(self) -> None:
        """Take what has happened. Raise Error when the device is gone."""
        try:
            for event in self._device.read():
                self.joystick.take(event)
            if self.joystick.lost_events:
                self._synchronise()
        except BlockingIOError:
            pass  # nothing has
        except OSError as error:
            raise Error(f"the device is gone: {error.strerror}") from error

    def close(self) -> None:
        """Leave the device to others."""
        self._device.close()

    def _synchronise(self) -> None:
        self.joystick.press_only(self._device.active_keys())
        for code in self._codes:
            self.joystick.move(code, self._device.absinfo(code).value)
        self.joystick.lost_events = False

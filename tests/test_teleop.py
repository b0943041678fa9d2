# SPDX-License-Identifier: BSD-3-Clause
"""Driving by hand: whatever goes wrong, the answer is rest and a dead-man that is let go."""

import math
import os
import pty
import termios
from collections import namedtuple
from errno import ENODEV

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.settings import Section
from kurumaisu.teleop import ALLOW, REST
from kurumaisu.teleop.device import Joystick, JoystickAxis
from kurumaisu.teleop.keys import DIRECTIONS, HELP, Keys, KeySettings, read_keys
from kurumaisu.teleop.reader import JoystickReader, open_device
from kurumaisu.teleop.stick import Stick, StickSettings, read_stick
from kurumaisu.teleop.terminal import Terminal

STICK = StickSettings(axis_v=1, axis_w=0, dead_man=4, v=0.4, w=0.6, fast=5, fast_factor=2.0, allow=2, timeout=0.3)
KEYS = KeySettings(v=0.3, w=0.4, v_max=0.5, w_max=1.0, step=0.1, timeout=0.5)
HELD, LET_GO = (0, 0, 0, 0, 1, 0), (0,) * 6


def test_the_stick_drives_while_the_dead_man_is_held():
    stick = Stick(STICK)
    assert stick.command(10.0) == REST
    assert stick.hear((0.5, -1.0), HELD, 10.0)
    command = stick.command(10.1)
    assert (command.v, command.w, command.held) == (-0.4, 0.3, True)
    stick.hear((0.5, 1.0), (0, 0, 0, 0, 1, 1), 10.1)
    assert stick.command(10.1).v == 0.8
    stick.hear((0.5, 1.0), LET_GO, 10.2)
    assert stick.command(10.2) == REST
    stick.hear((0.5, 1.0), (0, 0, 0, 0, 0, 1), 10.3)  # fast alone is no dead-man
    assert stick.command(10.3) == REST


def test_under_supervision_others_drive():
    stick = Stick(STICK)
    stick.hear((0.5, 1.0), (0, 0, 1, 0, 0, 0), 10.0)
    assert stick.command(10.0) == ALLOW
    assert stick.command(10.4) == REST
    stick.hear((0.5, 1.0), (0, 0, 1, 0, 1, 0), 10.5)
    assert stick.command(10.5).drives  # who holds both drives himself


def test_a_silent_joystick_is_a_dead_man_let_go_for_good():
    stick = Stick(STICK)
    stick.hear((0.5, 1.0), HELD, 10.0)
    assert stick.command(10.29).held
    assert stick.command(10.31) == REST
    assert stick.command(10.2) == REST  # not again, whatever the clock does


def test_a_clock_that_runs_backwards_is_silence():
    stick, keys = Stick(STICK), Keys(KEYS)
    stick.hear((0.5, 1.0), HELD, 10.0)
    keys.press("i", 10.0)
    assert stick.command(9.0) == REST
    assert keys.command(9.0) == REST


@pytest.mark.parametrize(
    ("axes", "buttons"),
    [
        ((math.nan, 0.5), HELD),
        ((0.5, math.inf), HELD),
        ((0.5, 1.5), HELD),
        ((0.5,), HELD),
        ((), ()),
        ((0.5, 0.5), (1, 1, 1, 1, 1)),
    ],
)
def test_a_joy_that_makes_no_sense_is_rest_and_counted(axes, buttons):
    stick = Stick(STICK)
    stick.hear((0.5, 1.0), HELD, 10.0)
    assert not stick.hear(axes, buttons, 10.1)
    assert stick.command(10.1) == REST
    assert stick.refused == 1


@given(st.lists(st.floats(width=32), max_size=4), st.lists(st.integers(0, 1), max_size=8))
def test_no_joy_drives_faster_than_the_settings(axes, buttons):
    stick = Stick(STICK)
    stick.hear(axes, buttons, 1.0)
    command = stick.command(1.0)
    assert abs(command.v) <= 0.8
    assert abs(command.w) <= 0.6
    assert command.held or command == REST


def test_keys_go_where_teleop_twist_keyboard_goes():
    signs = {
        "u": (1, 1),
        "i": (1, 0),
        "o": (1, -1),
        "j": (0, 1),
        "l": (0, -1),
        "m": (-1, -1),
        ",": (-1, 0),
        ".": (-1, 1),
    }
    for key, (v, w) in signs.items():
        keys = Keys(KEYS)
        keys.press(key, 5.0)
        command = keys.command(5.4)
        assert (command.v, command.w, command.held) == (0.3 * v, 0.4 * w, True), key


def test_keys_that_fall_silent_stop_the_chair():
    keys = Keys(KEYS)
    for i in range(10):
        keys.press("i", 5.0 + 0.3 * i)
        assert keys.command(5.0 + 0.3 * i + 0.29).held
    assert keys.command(7.7 + 0.5).held
    assert keys.command(7.7 + 0.51) == REST
    assert keys.command(7.7) == REST


@given(st.text(max_size=3))
def test_any_other_key_stops_at_once(text):
    keys = Keys(KEYS)
    keys.press("i", 5.0)
    for key in text:
        keys.press(key, 5.1)
    if text and text[-1] not in "uiojlm,.qzwxeck":
        assert keys.command(5.1) == REST


def test_speed_keys_change_the_speed_within_bounds_and_hold_nothing():
    keys = Keys(KEYS)
    keys.press("w", 1.0)
    assert (keys.v, keys.w) == (pytest.approx(0.33), 0.4)
    assert keys.command(1.0) == REST
    for _ in range(50):
        keys.press("q", 1.0)
    assert (keys.v, keys.w) == (0.5, 1.0)
    keys.press("i", 1.0)
    keys.press("z", 1.4)
    assert keys.command(1.6) == REST  # the speed key was no sign of life of the direction


def test_help_names_every_key():
    text = HELP.format(timeout=0.5, percent=10)
    assert all(key in text for key in [*DIRECTIONS, "q/z", "w/x", "e/c"])


def test_what_ships_is_read():
    for name, read in (("teleop_joy", read_stick), ("teleop_keyboard", read_keys)):
        section = settings.load(shipped(f"launch/{name}.yaml"))
        section.number("rate", above=0)
        read(section)
        section.end()


@pytest.mark.parametrize(
    ("key", "value"), [("axis_v", -1), ("dead_man", 1.5), ("v", 0), ("timeout", "0.3"), ("w", math.nan)]
)
def test_settings_that_make_no_sense_are_refused(key, value):
    with pytest.raises(Error, match=key):
        read_stick(Section({**vars(STICK), key: value}, "test"))


def test_a_terminal_gives_single_keys_and_is_restored():
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with Terminal(slave) as terminal:
        assert terminal.keys(0.0) == ""
        os.write(master, b"i")
        assert terminal.keys(5.0) == "i"
        os.write(master, b"\x1b[A")
        assert terminal.keys(5.0) == "\x1b"  # an arrow: A alone would be a key
        os.write(master, b"\xff")
        assert terminal.keys(5.0) not in DIRECTIONS
        assert not termios.tcgetattr(slave)[3] & termios.ECHO
        os.close(master)
        assert terminal.keys(5.0) is None  # gone
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with Terminal(slave):
        pass
    assert termios.tcgetattr(slave) == before


def test_a_file_is_no_terminal(tmp_path):
    with (tmp_path / "keys").open("w") as file, pytest.raises(Error, match="not a terminal"):
        Terminal(file.fileno())


Event = namedtuple("Event", "type code value")
Info = namedtuple("Info", "value min max flat")


def test_axes_and_buttons_are_as_joy_node_has_them():
    joystick = Joystick([JoystickAxis(1, -128, 127, 0), JoystickAxis(0, 0, 1000, 200)], [0x131, 0x130, 30], 0.1)
    assert (len(joystick.axes), len(joystick.buttons)) == (2, 2)  # key 30 is a letter
    for event, axes, buttons in [
        (Event(3, 0, 0), [1.0, 0.0], [0, 0]),  # left
        (Event(3, 0, 1000), [-1.0, 0.0], [0, 0]),
        (Event(3, 0, 680), [0.0, 0.0], [0, 0]),  # flat: 0.4 of the way counts as the middle
        (Event(3, 1, -128), [0.0, 1.0], [0, 0]),  # forward
        (Event(3, 1, -9999), [0.0, 1.0], [0, 0]),
        (Event(1, 0x131, 1), [0.0, 1.0], [0, 1]),
        (Event(1, 0x131, 2), [0.0, 1.0], [0, 1]),  # repeated
        (Event(1, 0x131, 0), [0.0, 1.0], [0, 0]),
        (Event(1, 30, 1), [0.0, 1.0], [0, 0]),
        (Event(3, 17, 1), [0.0, 1.0], [0, 0]),
    ]:
        joystick.take(event)
        assert (joystick.axes, joystick.buttons) == (pytest.approx(axes), buttons), event


class FakeDevice:
    """An evdev.InputDevice with one axis and one button, whose events are scripted."""

    def __init__(self, *events):
        self.events, self.pressed, self.place = list(events), [], 0

    def capabilities(self):
        return {1: [0x130], 3: [(0, Info(self.place, -100, 100, 0))]}

    def read(self):
        event = self.events.pop(0) if self.events else BlockingIOError()
        if isinstance(event, Exception):
            raise event
        return [event]

    def active_keys(self):
        return self.pressed

    def absinfo(self, axis_num):
        return Info(self.place, -100, 100, 0)

    def close(self):
        pass


def test_a_reader_starts_from_what_is_pressed_and_recovers_lost_events():
    device = FakeDevice(Event(1, 0x130, 1), Event(0, 3, 0))
    reader = JoystickReader(device, 0.0)
    assert reader.joystick.buttons == [0]
    reader.poll()
    assert reader.joystick.buttons == [1]
    device.pressed, device.place = [], 50  # the release was among the events that the kernel dropped
    reader.poll()
    assert (reader.joystick.buttons, reader.joystick.axes) == ([0], [-0.5])
    reader.poll()  # nothing new


def test_a_device_that_is_gone_or_none_is_an_error(tmp_path):
    reader = JoystickReader(FakeDevice(OSError(ENODEV, "No such device")), 0.0)
    with pytest.raises(Error, match="gone: No such device"):
        reader.poll()
    device = FakeDevice()
    device.capabilities = lambda: {1: [30]}  # a keyboard
    with pytest.raises(Error, match="not a joystick"):
        JoystickReader(device, 0.0)
    with pytest.raises(Error, match="missing"):
        open_device(tmp_path / "missing")

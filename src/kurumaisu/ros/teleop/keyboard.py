# SPDX-License-Identifier: BSD-3-Clause
"""teleop_keyboard: keys of a terminal to key_vel and dead_man."""

from __future__ import annotations

import os
import sys
import time

from kurumaisu import program
from kurumaisu.ros import life
from kurumaisu.ros.teleop.common import Hand, overlaid
from kurumaisu.teleop.keys import HELP, Keys, KeySettings, read_keys
from kurumaisu.teleop.terminal import Terminal

_HELP = """
Drive by the keys of this terminal. The keys are shown when it starts.

publishes:
  key_vel   commands for base_node
  dead_man  whether a key is held
parameters:
  launch/teleop_keyboard.yaml, which the node reads itself: speeds, time-out

More: docs/robot.md
"""


def main() -> int:
    """Drive by keys until Ctrl-C or the terminal's end; rest is the last command. Return 1 without a terminal."""
    program.no_arguments("teleop_keyboard", _HELP)
    return life.run("teleop_keyboard", _drive)


def _drive(own: life.Life) -> int:
    rate, key_settings = overlaid("teleop_keyboard.yaml", read_keys)
    with Terminal(sys.stdin.fileno()) as terminal:
        hand = Hand("key_vel")
        try:
            _follow(terminal, hand, key_settings, 1 / rate, own)
        finally:
            hand.rest(1 / rate)
            _show("\n")
    return 0


def _follow(terminal: Terminal, hand: Hand, key_settings: KeySettings, period: float, own: life.Life) -> None:
    _show(HELP.format(timeout=key_settings.timeout, percent=100 * key_settings.step) + "\n")
    keys = Keys(key_settings)
    due = time.monotonic()
    while not own.asked.is_set():
        typed = terminal.keys(max(due - time.monotonic(), 0.0))
        if typed is None:
            return
        now = time.monotonic()
        for key in typed:
            keys.press(key, now)
        command = keys.command(now)
        if now >= due or (typed and not command.held):  # a stop does not wait for its turn
            due = now + period
            hand.say(command)
            what = f"v {command.v:+.2f} m/s  w {command.w:+.2f} rad/s" if command.held else "stop"
            _show(f"\rspeeds {keys.v:.2f} m/s {keys.w:.2f} rad/s   {what:30}")


def _show(text: str) -> None:
    try:
        print(text, end="", flush=True)
    except OSError:  # the terminal is gone: rest is published all the same, and Python's last flush must not fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

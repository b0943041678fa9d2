# SPDX-License-Identifier: BSD-3-Clause
"""teleop_joy: joy to joy_vel and dead_man."""

from __future__ import annotations

import threading
import time

import rospy
from sensor_msgs.msg import Joy

from kurumaisu import program
from kurumaisu.ros import life
from kurumaisu.ros.teleop.common import Hand, overlaid
from kurumaisu.teleop.stick import Stick, read_stick

_HELP = """
Drive by a joystick, with a dead-man button. teleop.launch starts it, and the
node joystick: roslaunch kurumaisu teleop.launch

subscribes to:
  joy       sensor_msgs/Joy
publishes:
  joy_vel   commands for base_node
  dead_man  whether the button is held
parameters:
  launch/teleop_joy.yaml, which the node reads itself: axes, buttons, speeds

More: docs/robot.md
"""
_WARNING_PERIOD = 5.0  # [s]


def main() -> int:
    """Drive by a joystick until shut down; rest is the last command. Return 1 for settings that make no sense."""
    program.no_arguments("teleop_joy", _HELP)
    return life.run("teleop_joy", _drive)


def _drive(own: life.Life) -> int:
    rate, stick_settings = overlaid("teleop_joy.yaml", read_stick)
    stick, lock = Stick(stick_settings), threading.Lock()

    def on_joy(joy: Joy) -> None:
        with lock:
            good = stick.hear(joy.axes, joy.buttons, time.monotonic())
        if not good:
            rospy.logwarn_throttle(
                _WARNING_PERIOD,
                f"TELEOP_BAD_JOY: joy: refused: {len(joy.axes)} axes, {len(joy.buttons)} buttons: {list(joy.axes)}",
            )

    hand = Hand("joy_vel")
    rospy.Subscriber("joy", Joy, on_joy, queue_size=1, tcp_nodelay=True)
    while not own.asked.wait(1 / rate):
        with lock:
            command = stick.command(time.monotonic())
        hand.say(command)
    hand.rest(1 / rate)
    return 0

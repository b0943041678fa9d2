# SPDX-License-Identifier: BSD-3-Clause
"""teleop_joy: joy to joy_vel and dead_man."""

from __future__ import annotations

import threading
import time

import rospy
from sensor_msgs.msg import Joy

from kurumaisu.ros.teleop import Hand, overlaid, run
from kurumaisu.teleop.stick import Stick, read_stick

_WARNING_PERIOD = 5.0  # [s]


def main() -> int:
    """Drive by a joystick until shut down; rest is the last command. Return 1 for settings that make no sense."""
    rospy.init_node("teleop_joy")
    return run(_drive)


def _drive() -> None:
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
    rested = threading.Event()

    def rest() -> None:
        hand.rest(1 / rate)
        rested.set()

    rospy.on_shutdown(rest)  # before the topics are closed
    while not rospy.is_shutdown():
        with lock:
            command = stick.command(time.monotonic())
        hand.say(command)
        time.sleep(1 / rate)
    rested.wait(1.0)  # a node that is told to end by the master rests in another thread

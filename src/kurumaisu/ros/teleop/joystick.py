# SPDX-License-Identifier: BSD-3-Clause
"""joystick: a device of /dev/input to joy, for Debian has no joy_node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import rospy
from sensor_msgs.msg import Joy

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.ros import life
from kurumaisu.ros.teleop.common import overlaid
from kurumaisu.settings import Section
from kurumaisu.teleop.reader import JoystickReader, open_device

_HELP = """
Publish what a joystick at /dev/input does. Debian has no joy_node.

publishes:
  joy     sensor_msgs/Joy
parameters:
  device  of evdev: /dev/input/by-id/...-event-joystick
  others  launch/joystick.yaml, which the node reads itself

More: docs/robot.md
"""


@dataclass(frozen=True)
class _Settings:
    device: Path
    dead_zone: float
    retry: float


def main() -> int:
    """Publish joy until shut down; nothing while the device is away. Return 1 for settings that make no sense."""
    program.no_arguments("joystick", _HELP)
    return life.run("joystick", _serve)


def _read(section: Section) -> _Settings:
    return _Settings(
        device=Path(section.text("device")),
        dead_zone=section.number("dead_zone", at_least=0),
        retry=section.number("retry", above=0),
    )


def _serve(own: life.Life) -> int:
    rate, known = overlaid("joystick.yaml", _read)
    publisher = rospy.Publisher("joy", Joy, queue_size=1, tcp_nodelay=True)
    while not own.asked.is_set():
        try:
            reader = JoystickReader(open_device(known.device), known.dead_zone)
        except Error as error:
            rospy.logwarn_throttle(10.0, f"JOYSTICK_AWAY: {known.device}: {error}")
            own.asked.wait(known.retry)
            continue
        rospy.loginfo("%s: here", known.device)
        _publish_while_here(reader, publisher, known.device, 1 / rate, own)
    return 0


def _publish_while_here(
    reader: JoystickReader, publisher: rospy.Publisher, device: Path, period: float, own: life.Life
) -> None:
    try:
        while not own.asked.is_set():
            reader.poll()
            publisher.publish(_message(reader.joystick.axes, reader.joystick.buttons))
            own.asked.wait(period)
    except Error as error:
        rospy.logwarn("JOYSTICK_LOST: %s: %s", device, error)
        released = _message([0.0] * len(reader.joystick.axes), [0] * len(reader.joystick.buttons))
        publisher.publish(released)  # the dead-man is let go at once, not after the timeout of who listens
    finally:
        reader.close()


def _message(axes: list[float], buttons: list[int]) -> Joy:
    joy = Joy(axes=list(axes), buttons=list(buttons))
    joy.header.stamp = rospy.Time.now()
    return joy

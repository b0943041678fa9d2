# SPDX-License-Identifier: BSD-3-Clause
"""What the nodes for driving by hand have in common: settings, and their two topics."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool

from kurumaisu import settings
from kurumaisu.params import shipped
from kurumaisu.settings import Section
from kurumaisu.teleop import REST, HandCommand

_LAST_WORDS = 10  # of rest, or of a dead-man that was let go, in case one is not heard

T = TypeVar("T")


def overlaid(name: str, read: Callable[[Section], T]) -> tuple[float, T]:
    """Return the rate [Hz], and what `read` takes of launch/NAME with the private parameters laid over it.

    Raise Error naming the key and the value.
    """
    below = settings.load(shipped(f"launch/{name}"))
    tree: dict[str, Any] = {key: below.take(key) for key in below.names()}
    top = Section({**tree, **rospy.get_param("~", {})}, rospy.get_name())
    rate, result = top.number("rate", above=0), read(top)
    top.end()
    return rate, result


class Hand:
    """Publishes what somebody asks for, and on dead_man whether he holds it.

    Both are silent after a while of rest, so that others may drive. The last word on dead_man, and at the start that
    nobody holds it, is latched: it reaches a base that starts later.
    """

    def __init__(self, topic: str) -> None:
        self._commands = rospy.Publisher(topic, Twist, queue_size=1, tcp_nodelay=True)
        self._dead_man = rospy.Publisher("dead_man", Bool, queue_size=1, tcp_nodelay=True, latch=True)
        self._last_words = {"commands": 0, "dead_man": _LAST_WORDS}

    def say(self, command: HandCommand) -> None:
        """Publish one command; to be called at the rate."""
        if self._speaks("dead_man", command.held):
            self._dead_man.publish(Bool(command.held))
        if self._speaks("commands", command.drives):
            twist = Twist()
            twist.linear.x, twist.angular.z = command.v, command.w
            self._commands.publish(twist)

    def rest(self, period: float) -> None:
        """Say for a moment that nobody drives; the last thing that is done."""
        for _ in range(3):
            self.say(REST)
            time.sleep(period)

    def _speaks(self, what: str, active: bool) -> bool:
        left = _LAST_WORDS if active else max(self._last_words[what] - 1, 0)
        self._last_words[what] = left
        return left > 0

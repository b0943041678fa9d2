# SPDX-License-Identifier: BSD-3-Clause
"""How a page drives the chair, or one of several robots: a stick for each, with a dead-man."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

import numpy as np
import rospy
from geometry_msgs.msg import Twist

from kurumaisu.errors import Error
from kurumaisu.ros.viewer.settings import Driving
from kurumaisu.viewer.source import Outcome

_LAST_WORDS = 5  # zeros, in case one is not heard


class Sticks:
    """Sticks by topic, made when they are first used; that of the chair, or of a robot alone, is there at once."""

    def __init__(self, driving: Driving, topics: Callable[[], Mapping[str, str | None]]) -> None:
        """topics: of the commands of each body that can be driven; None: the chair's, which the settings name."""
        self._driving, self._topics = driving, topics
        self._sticks = {driving.topic: Stick(driving.topic, driving)}

    def drive(self, v: float, w: float, body: str | None = None) -> Outcome:
        """Drive a body, None: the chair, v [m/s], w [rad/s]. Raise Error for one that cannot be driven."""
        topic = self._driving.topic if body is None else self._topic(body)
        if topic not in self._sticks:
            self._sticks[topic] = Stick(topic, self._driving)
        return self._sticks[topic].drive(v, w)

    def rest(self) -> None:
        """Let go of all at once."""
        for stick in tuple(self._sticks.values()):
            stick.rest()

    def _topic(self, body: str) -> str:
        topics = self._topics()
        if body not in topics:
            raise Error(f"drive: {body!r} cannot be driven")
        return topics[body] or self._driving.topic


class Stick:
    """Publishes what a page drives, as long as it goes on to say so: a dead-man."""

    def __init__(self, topic: str, driving: Driving) -> None:
        """Advertise; driving: rate, dead-man and limits."""
        self._limits = np.array([driving.v, driving.w])
        self._dead_man = driving.dead_man
        self._publisher = rospy.Publisher(topic, Twist, queue_size=1, tcp_nodelay=True)
        self._command = np.zeros(2)
        self._heard = -np.inf  # [s]
        self._words = 0
        self._news = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(1 / driving.rate,), daemon=True)
        self._thread.start()

    def drive(self, v: float, w: float) -> Outcome:
        """Drive so until the next word, or the dead-man's end."""
        self._command = np.clip([v, w], -self._limits, self._limits)
        self._heard = time.monotonic()
        self._news.set()
        return Outcome("")

    def rest(self) -> None:
        """Let go at once."""
        self._command, self._heard = np.zeros(2), -np.inf

    def _run(self, period: float) -> None:
        while not rospy.is_shutdown():
            self._news.wait()
            held = time.monotonic() - self._heard <= self._dead_man
            v, w = self._command.tolist() if held else (0.0, 0.0)
            self._words = _LAST_WORDS if held else self._words - 1
            twist = Twist()
            twist.linear.x, twist.angular.z = v, w
            self._publisher.publish(twist)
            if self._words <= 0:
                self._news.clear()  # and silence: others may drive
                if time.monotonic() - self._heard <= self._dead_man:
                    self._news.set()  # it was said in between
            time.sleep(period)

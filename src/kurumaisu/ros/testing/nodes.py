# SPDX-License-Identifier: BSD-3-Clause
"""For tests of nodes: wait for what topics say, drive, run a clock."""

from __future__ import annotations

import math
import re
import subprocess
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import roslib.packages
import rospy
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from kurumaisu.ros.rotation import planar
from kurumaisu.types import FloatArray

PATIENCE = (
    60.0  # [s] of wall time for things that take a moment: a busy machine may take a while, a fault takes for ever
)

_EVERY_NODES = (
    "clock",
    "rosout",
    "get_loggers",
    "set_logger_level",
    "set_parameters",
    "parameter_descriptions",
    "parameter_updates",
)


def wait_for(condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
    """Return the condition's value as soon as it is true. Raise AssertionError after so many seconds."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        if result := condition():
            return result
        time.sleep(0.005)
    raise AssertionError(f"not within {patience} s: {what}")


def unexplained(node: str, program: str) -> set[str]:
    """Return the topics and services that a running node has and its program's --help does not name."""
    (path,) = roslib.packages.find_node("kurumaisu", program)
    said = subprocess.run([path, "--help"], capture_output=True, text=True, timeout=PATIENCE, check=True).stdout
    words = {*re.findall(r"\w+", said), *_EVERY_NODES}
    state = rosgraph.Master("/testing").getSystemState()
    names = {name for kind in state for name, nodes in kind if node in nodes}
    assert names, f"{node} has neither topics nor services"
    return {name for name in names if name.rpartition("/")[2] not in words}


def pose_of(message: Any) -> FloatArray:
    """Return x [m], y [m], yaw [rad] of Odometry, or of a pose with a covariance."""
    return planar(message.pose.pose)


def deviation(message: Any) -> float:
    """Return the standard deviation of a position [m] whose covariance the message gives."""
    return math.sqrt(message.pose.covariance[0] + message.pose.covariance[7])


class Topic:
    """Everything received on a topic, and the latest of it."""

    def __init__(self, name: str, kind: type) -> None:
        self.messages: list[Any] = []
        self._subscriber = rospy.Subscriber(name, kind, self.messages.append, queue_size=None, tcp_nodelay=True)

    @property
    def last(self) -> Any:
        """The latest message, or None."""
        return self.messages[-1] if self.messages else None

    @property
    def is_published(self) -> bool:
        """Whether anything that publishes it is connected: after the last one has gone, nothing is under way."""
        return bool(self._subscriber.get_num_connections())

    def wait(
        self, condition: Callable[[Any], bool], what: str, patience: float = PATIENCE, since: int | None = None
    ) -> Any:
        """Return the first message that meets the condition, from now on or from so many messages on."""
        start = len(self.messages) if since is None else since
        return wait_for(lambda: next((m for m in self.messages[start:] if condition(m)), None), what, patience)

    def wait_last(self, condition: Callable[[Any], bool], what: str, patience: float = PATIENCE) -> Any:
        """Return the latest message as soon as it meets the condition: of what is said only when it changes."""

        def found() -> Any:
            last = self.last
            return last if last is not None and condition(last) else None

        return wait_for(found, what, patience)

    def close(self) -> None:
        """Stop listening."""
        self._subscriber.unregister()


class _Repeater:
    """Calls a function at a fixed wall period [s] in a thread of its own."""

    def __init__(self, period: float, action: Callable[[], None]) -> None:
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(period, action), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self, period: float, action: Callable[[], None]) -> None:
        while not self._stop.wait(period):
            action()


class Commander:
    """Repeats a command at 50 Hz of wall time, until it is silenced."""

    def __init__(self, topic: str) -> None:
        self.publisher = rospy.Publisher(topic, Twist, queue_size=1, tcp_nodelay=True)
        self._lock = threading.Lock()
        self._twist: Twist | None = None
        self._repeater = _Repeater(0.02, self._publish)

    def say(self, v: float, w: float) -> None:
        """From now on command v [m/s], w [rad/s]."""
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.repeat(twist)

    def repeat(self, twist: Twist) -> None:
        """From now on publish this."""
        self._twist = twist

    def release(self) -> None:
        """Command rest until base_node obeys: who commands before it has let go is not heard."""
        self.say(0.0, 0.0)
        active = Topic("active_input", String)
        wait_for(lambda: active.last and active.last.data, "base_node to obey")

    def silence(self) -> None:
        """Command nothing any more: when this returns, the last command has been published."""
        with self._lock:
            self._twist = None

    def close(self) -> None:
        """End the topic."""
        self._repeater.close()
        self.publisher.unregister()

    def _publish(self) -> None:
        with self._lock:
            if self._twist is not None:
                self.publisher.publish(self._twist)


class Repeated:
    """Repeats what a function makes at a fixed period [s] of wall time, until it is silenced."""

    def __init__(self, topic: str, kind: type, period: float, joined: Callable[[], None] = lambda: None) -> None:
        """joined: called whenever somebody begins to hear it."""
        listener = rospy.SubscribeListener()
        listener.peer_subscribe = lambda *_: joined()
        self._publisher = rospy.Publisher(topic, kind, listener, queue_size=10, tcp_nodelay=True)
        self._make: Callable[[], Any] | None = None
        self._repeater = _Repeater(period, self._publish)

    def say(self, make: Callable[[], Any] | None) -> None:
        """From now on publish what `make` returns; None: nothing."""
        self._make = make

    def close(self) -> None:
        """End the topic."""
        self._repeater.close()
        self._publisher.unregister()

    def _publish(self) -> None:
        make = self._make
        if make is not None:
            self._publisher.publish(make())


class SimulatedClock:
    """/clock at so many times the wall's pace, in steps of 20 ms of simulated time."""

    STEP = 0.02  # [s]

    def __init__(self, start: float, factor: float) -> None:
        self._lock = threading.Lock()
        self._now = start
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=1, tcp_nodelay=True)
        self._repeater = _Repeater(self.STEP / factor, self._advance)

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self._now

    def jump(self, to: float) -> None:
        """Set simulated time [s]."""
        with self._lock:
            self._now = to

    def close(self) -> None:
        """End the clock."""
        self._repeater.close()
        self._publisher.unregister()

    def _advance(self) -> None:
        with self._lock:
            self._now += self.STEP
        self._publisher.publish(Clock(rospy.Time.from_sec(self._now)))

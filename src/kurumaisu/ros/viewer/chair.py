# SPDX-License-Identifier: BSD-3-Clause
"""What the base controller says of itself, and how a page stops it."""

from __future__ import annotations

import time
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from std_srvs.srv import Trigger

from kurumaisu.errors import Error
from kurumaisu.msg import Voltages
from kurumaisu.ros.inbox import check_odometry, rates_of
from kurumaisu.ros.messages import command_of
from kurumaisu.ros.rotation import planar
from kurumaisu.ros.viewer.calls import call
from kurumaisu.ros.viewer.topics import Newest
from kurumaisu.types import FloatArray
from kurumaisu.viewer.source import Outcome

_STOPPED = "emergency stop"  # state in base_node's diagnostics
_FRESH = 1.5  # [s] that our own word about the stop is newer than diagnostics'


class Chair:
    """base_node's topics, as far as they are drawn."""

    def __init__(self, node: str) -> None:
        """node: the base controller's name."""
        self._node = node
        self.odom = Newest("odom", Odometry, check_odometry)
        self._volts = Newest("voltages", Voltages, command_of)
        self._asked = Newest("cmd_vel_out", TwistStamped, lambda message: rates_of(message.twist))
        self._input = Newest("active_input", String)
        self._topics = (self.odom, self._volts, self._asked, self._input)
        self._diagnostics: Any = None
        self._stopped: bool | None = None
        self._said = -_FRESH  # [s] when a page stopped or released it

    def open(self) -> None:
        """Listen."""
        for topic in self._topics:
            topic.open()
        self._diagnostics = rospy.Subscriber("diagnostics", DiagnosticArray, self._hear, queue_size=10)

    def close(self) -> None:
        """Listen no longer."""
        for topic in self._topics:
            topic.close()
        self._diagnostics.unregister()
        self._stopped = None

    def estop(self, on: bool) -> Outcome:
        """Stop, or release. Raise Error where base_node refuses or is not there."""
        answer = call(f"{self._node}/{'e_stop' if on else 'reset'}", Trigger)
        if not answer.success:
            raise Error(f"estop: {answer.message}")
        self._stopped, self._said = on, time.monotonic()
        return Outcome(answer.message)

    def pose(self) -> FloatArray | None:
        """Return where odometry has it (3,) in its own frame."""
        self.odom.take()
        return None if self.odom.last is None else planar(self.odom.last.pose.pose)

    def parts(self) -> dict[str, Any]:
        """Return what goes into a State."""
        for topic in self._topics:
            topic.take()
        parts: dict[str, Any] = {"estop": self._stopped}
        if self.odom.last is not None:
            twist = self.odom.last.twist.twist
            parts |= {"v": twist.linear.x, "w": twist.angular.z}
        if self._volts.last is not None:
            parts["volts"] = self._volts.last.translation, self._volts.last.steering
        if self._asked.last is not None:
            twist = self._asked.last.twist
            parts["commanded"] = twist.linear.x, twist.angular.z
        if self._input.last is not None:
            parts["driver"] = self._input.last.data
        return parts

    def _hear(self, message: Any) -> None:
        for status in message.status:
            if status.name.endswith("commands") and time.monotonic() - self._said > _FRESH:
                states = [value.value for value in status.values if value.key == "state"]
                self._stopped = states[0] == _STOPPED if states else self._stopped

# SPDX-License-Identifier: BSD-3-Clause
"""A process beside base_node: commands what it is told to, and tells what it hears; for benchmarks and tests.

Standard input has one order a line, in JSON, standard output one event a line, with its time [s, CLOCK_MONOTONIC]:
see Peer.obey() and the functions that tell. bench/faults/base/peers.py is the other end.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger

from kurumaisu.errors import Error
from kurumaisu.msg import Voltages
from kurumaisu.ros.testing.nodes import Repeated, SimulatedClock

_PERIOD = 0.02  # [s] of what is repeated
_LATE = 0.15  # [s] from one repetition to the next that are worth telling: base_node's inputs wait not much longer
_lock = threading.Lock()


def main() -> None:
    """Obey until the input ends."""
    rospy.init_node("peer", anonymous=True, disable_signals=True)
    peer = PeerProcess()
    rospy.Subscriber("voltages", Voltages, _tell_voltages, queue_size=None, tcp_nodelay=True)
    rospy.Subscriber("odom", Odometry, _tell_odometry, queue_size=None, tcp_nodelay=True)
    rospy.Subscriber("active_input", String, lambda m: _tell("active", name=m.data), queue_size=None)
    rospy.Subscriber("/diagnostics", DiagnosticArray, _tell_diagnostics, queue_size=None)
    _tell("ready")
    for line in sys.stdin:
        peer.obey(json.loads(line))


def _tell(what: str, **values: Any) -> None:
    event = {"t": time.monotonic(), "what": what, **values}
    with _lock:
        print(json.dumps(event), flush=True)


def _tell_voltages(m: Voltages) -> None:
    volts = [m.translation, m.steering, m.reference]
    _tell("voltages", stamp=m.header.stamp.to_sec(), volts=volts, v=m.v, w=m.w)


def _tell_odometry(m: Odometry) -> None:
    here, rates = m.pose.pose.position, m.twist.twist
    _tell("odom", stamp=m.header.stamp.to_sec(), x=here.x, y=here.y, v=rates.linear.x, w=rates.angular.z)


def _tell_diagnostics(array: DiagnosticArray) -> None:
    for status in array.status:
        values = {pair.key: pair.value for pair in status.values}
        _tell("diagnostics", name=status.name, level=status.level, message=status.message, values=values)


class PeerProcess:
    """Who obeys the orders."""

    def __init__(self) -> None:
        self._topics: dict[str, Repeated] = {}
        self._clock: SimulatedClock | None = None

    def obey(self, order: dict[str, Any]) -> None:
        """Do {"do": "repeat", "topic": ..., "value": ...}, "burst", "clock", "call" or "limits": see the methods."""
        what = order.pop("do")
        if what not in ("repeat", "burst", "clock", "call", "limits"):
            raise Error(f"{what}: is no order")
        getattr(self, what)(**order)

    def repeat(self, topic: str, value: Any) -> None:
        """Repeat [v, w], a truth value or a number on a topic from now on; None: nothing any more."""
        if topic not in self._topics:
            self._topics[topic] = Repeated(topic, _kind(value), _PERIOD, lambda: _tell("joined", topic=topic))
        self._topics[topic].say(None if value is None else _timed(topic, _maker(value)))

    def burst(self, topic: str, values: list[Any]) -> None:
        """Publish values at once, on a topic that something is repeated on."""
        publisher = rospy.Publisher(topic, _kind(values[0]), queue_size=len(values))
        for value in values:
            publisher.publish(_maker(value)())

    def clock(self, now: float | None) -> None:
        """Let simulated time pass from `now` [s] on; None: let it stand still."""
        if self._clock and now is not None:
            self._clock.jump(now)
        elif now is not None:
            self._clock = SimulatedClock(start=now, factor=1.0)
        elif self._clock:
            self._clock.close()
            self._clock = None

    def call(self, name: str) -> None:
        """Call a service of std_srvs/Trigger, and tell its answer."""
        answer = rospy.ServiceProxy(name, Trigger)()
        _tell("answer", name=name, success=bool(answer.success), message=answer.message)

    def limits(self, name: str, values: dict[str, float]) -> None:
        """Ask dynamic_reconfigure for limits, and tell what it answers that holds."""
        config = Config(doubles=[DoubleParameter(key, value) for key, value in values.items()])
        answer = rospy.ServiceProxy(f"{name}/set_parameters", Reconfigure)(config)
        _tell("limits", name=name, values={p.name: p.value for p in answer.config.doubles})


def _timed(topic: str, make: Callable[[], Any]) -> Callable[[], Any]:
    """Return a maker that tells when it is called late."""
    last = time.monotonic()

    def timed() -> Any:
        nonlocal last
        now = time.monotonic()
        if now - last > _LATE:
            _tell("late", topic=topic, gap=now - last)
        last = now
        return make()

    return timed


def _kind(value: Any) -> type:
    kinds: dict[type, type] = {list: Twist, bool: Bool, float: Float64}
    if type(value) not in kinds:
        raise Error(f"{value!r}: is nothing that a topic of base_node has")
    return kinds[type(value)]


def _maker(value: Any) -> Callable[[], Any]:
    if not isinstance(value, list):
        return lambda: _kind(value)(value)
    twist = Twist()
    twist.linear.x, twist.angular.z = value
    return lambda: twist


if __name__ == "__main__":
    main()

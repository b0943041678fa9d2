# SPDX-License-Identifier: BSD-3-Clause
"""Publishes a script's commands, or its steering voltages, for as long as its supervisor lets it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool, String

from kurumaisu.errors import Error
from kurumaisu.experiments import Script, base_limits
from kurumaisu.experiments.supervisor import Care, Progress, Supervisor
from kurumaisu.msg import Voltages
from kurumaisu.params import Model
from kurumaisu.ros.experiment.surroundings import ExperimentSpace
from kurumaisu.ros.graph import hearers, publishers
from kurumaisu.ros.inbox import subscribe
from kurumaisu.ros.recorder import Recorder
from kurumaisu.ros.rotation import planar

VOLTAGE, ACTIVE = "voltages", "active_input"
RECORDED = (VOLTAGE, "odom", "scan", "ground_truth")
INPUT = "experiments"  # as base_node.yaml calls the input that scripts have
_GLANCE = 0.002  # [s] of wall time between looks at the clock
_LEAVE = 0.2  # [s] of wall time for a message to leave
_LATE = 3.0  # [s] of wall time after Ctrl-C for zero to be published; time may stand


def run_drive(
    script: Script, care: Care, model: Model, ground: ExperimentSpace, stop: Callable[[], bool], bag: Path | None
) -> str:
    """Return why it was stopped, '' when it is done. Raise Error when it is refused."""
    topic = care.command_topic if script.kind == "drive" else VOLTAGE
    _check_limits(script)
    others = publishers(topic)
    if others:
        raise Error(f"{topic} is published already, by {', '.join(others)}")
    if not hearers(topic, care.patience):
        raise Error(f"no node subscribes to {topic}")
    recorder = Recorder(bag, tuple(dict.fromkeys((topic, *RECORDED)))) if bag is not None else None
    try:
        return _Driver(script, care, model, ground, topic).run(stop)
    finally:
        if recorder is not None:
            recorder.close()


def _check_limits(script: Script) -> None:
    limits = base_limits()
    for phase in script.phases if script.limits is not None else ():
        if limits.exceeded(phase.target[0], phase.target[1]):
            v, w = phase.target
            raise Error(f"base_node would cut v {v:g}, w {w:g}: its limits are {limits}")


class _Driver:
    """Between a supervisor and the topics."""

    def __init__(self, script: Script, care: Care, model: Model, ground: ExperimentSpace, topic: str) -> None:
        self._supervisor = Supervisor(script, care, ground.sources(), ground.refusal)
        self._lock = threading.Lock()  # over the supervisor, whom ROS's threads tell what they hear
        self._reference = model.reference_voltage
        kind = Voltages if topic == VOLTAGE else Twist
        self._publisher = rospy.Publisher(topic, kind, queue_size=1, tcp_nodelay=True)
        self._heard = False  # by base_node, which obeys nobody who commands before it has seen him at rest
        self._message: Callable[[tuple[float, ...]], Twist | Voltages] = _twist if kind is Twist else self._voltages
        for source in ground.sources():
            subscribe(
                source, Odometry, partial(self._see, source), "EXPERIMENT_BAD_POSE", queue_size=10, tcp_nodelay=True
            )
        rospy.Subscriber("collision", Bool, self._touch, queue_size=10)
        rospy.Subscriber(topic, kind, self._overhear, queue_size=10)
        rospy.Subscriber(ACTIVE, String, self._yield, queue_size=10)

    def run(self, stop: Callable[[], bool]) -> str:
        """Publish until the supervisor has ended; return its outcome."""
        obeys = self._message is _twist and bool(publishers(ACTIVE))
        deadline = np.inf
        while self._supervisor.stage is not Progress.ENDED and time.monotonic() < deadline:
            if stop() and deadline == np.inf:
                deadline = time.monotonic() + _LATE
                self._stop("interrupted")
            with self._lock:
                said = self._supervisor.tick(rospy.get_time(), heard=self._heard or not obeys)
            if said is not None:
                self._publish(said)
            time.sleep(_GLANCE)
        if self._supervisor.stage is not Progress.ENDED:  # time stands: zero for when it goes on
            self._publish(self._supervisor.rest)
            time.sleep(_LEAVE)
        return self._supervisor.outcome

    def _publish(self, values: tuple[float, ...]) -> None:
        self._publisher.publish(self._message(values))

    def _see(self, source: str, message: Odometry) -> None:
        pose = planar(message.pose.pose)
        with self._lock:
            self._supervisor.see(source, rospy.get_time(), pose)

    def _touch(self, message: Bool) -> None:
        if message.data:
            self._stop("the chair touches something")

    def _overhear(self, message: Twist | Voltages) -> None:
        caller = message._connection_header["callerid"]  # rospy says nowhere else who it was
        if caller != rospy.get_name():
            self._stop(f"{caller} also commands the chair")

    def _yield(self, message: String) -> None:
        self._heard |= message.data == INPUT
        if message.data not in ("", INPUT):
            self._stop(f"{message.data} also commands the chair")

    def _stop(self, why: str) -> None:
        with self._lock:
            self._supervisor.stop(why)

    def _voltages(self, values: tuple[float, ...]) -> Voltages:
        message = Voltages(translation=0.0, steering=values[0], reference=self._reference, v=np.nan, w=np.nan)
        message.header.stamp = rospy.Time.now()
        return message


def _twist(values: tuple[float, ...]) -> Twist:
    twist = Twist()
    twist.linear.x, twist.angular.z = values
    return twist

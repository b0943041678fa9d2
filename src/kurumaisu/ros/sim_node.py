# SPDX-License-Identifier: BSD-3-Clause
"""sim_node: the simulator behind the chair's topics, and the clock of everything else."""

from __future__ import annotations

import sys
import threading
import time

import rospy
import tf2_ros
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from kurumaisu.errors import Error, one_line
from kurumaisu.msg import Voltages
from kurumaisu.ros import messages
from kurumaisu.ros.pacing import Pacer
from kurumaisu.ros.sim_settings import SimSettings, read_settings
from kurumaisu.sim.chair import ChairSimulator, Observation
from kurumaisu.sim.holder import VoltageHolder

_NS = 1_000_000_000


class SimNode:
    """Steps the simulator and publishes what it observes."""

    def __init__(self, settings: SimSettings) -> None:
        """Advertise everything; the node must have been initialised."""
        self._settings = settings
        self._simulator = ChairSimulator(settings.model, settings.world, settings.physics)
        self._epoch = round(settings.start_time * _NS)  # /clock at the simulator's time 0; reset moves it on
        self._now = self._epoch
        self._steps = 0
        self._lock = threading.Condition()  # over the holder and the wish to reset
        self._holder = VoltageHolder()
        self._reset_wanted = False
        self._given_up: int | None = None  # stamp of the voltages after which no more came in time
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._scan = rospy.Publisher("scan", LaserScan, queue_size=10)
        self._truth = rospy.Publisher("ground_truth", Odometry, queue_size=10)
        self._static = tf2_ros.StaticTransformBroadcaster()
        laser = settings.model.laser
        self._static.sendTransform(messages.laser_transform(messages.stamp_of(self._now), laser, settings.base_frame))
        self._voltages = rospy.Subscriber("voltages", Voltages, self._hear, queue_size=100)
        self._service = rospy.Service("reset", Empty, self._serve_reset)

    def run(self) -> None:
        """Simulate until ROS shuts down."""
        pacer = Pacer(self._settings.speed)
        self._restart()
        while not rospy.is_shutdown():
            self._wait_for_voltages()
            with self._lock:
                reset_wanted = self._reset_wanted
                command = self._holder.at(self._now)
            if reset_wanted:
                self._restart()
                continue
            observation = self._simulator.step(command)
            self._steps += 1
            self._publish(observation)
            self._warn()
            pacer.wait(self._settings.physics.step)

    def _hear(self, message: Voltages) -> None:
        with self._lock:
            try:
                stamp = message.header.stamp.to_nsec()
                if stamp > self._now + self._settings.voltage_horizon * _NS:
                    raise Error(f"voltages: stamp {stamp / _NS:.3f} s is of another clock")
                self._holder.put(stamp, messages.command_of(message))
            except Error as error:
                rospy.logwarn_throttle(5.0, f"SIM_VOLTAGES_DROPPED {error}")
            self._lock.notify_all()

    def _serve_reset(self, _request: EmptyRequest) -> EmptyResponse:
        with self._lock:
            self._reset_wanted = True
            self._lock.notify_all()
            while self._reset_wanted and not rospy.is_shutdown():
                self._lock.wait(0.1)
        return EmptyResponse()

    def _restart(self) -> None:
        """Put the chair back to its start with the same seed; /clock runs on, as time must not jump back."""
        with self._lock:
            self._holder.clear()
            self._epoch = self._now
            self._steps = 0
            observation = self._simulator.reset(self._settings.seed)
            self._reset_wanted = False
            self._lock.notify_all()
        self._publish(observation)

    def _wait_for_voltages(self) -> None:
        """Let a controller keep up: wait until its voltages are at most voltage_lead old, within patience."""
        lead = round(self._settings.voltage_lead * _NS)
        if self._voltages.get_num_connections() == 0:
            return
        with self._lock:
            deadline = time.monotonic() + self._settings.voltage_patience
            while self._behind(lead) and not self._reset_wanted:
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    self._given_up = self._holder.newest
                    return
                self._lock.wait(remaining)

    def _behind(self, lead: int) -> bool:
        newest = self._holder.newest
        return newest is not None and newest != self._given_up and self._now - newest >= lead

    def _publish(self, observation: Observation) -> None:
        """Publish the step's data, then the clock: who hears a time has been sent all before it."""
        settings = self._settings
        self._now = self._epoch + round(observation.time * _NS)
        stamp = messages.stamp_of(self._now)
        if observation.scan is not None:
            first_beam = messages.stamp_of(self._epoch + round(observation.scan.time * _NS))
            self._scan.publish(messages.laser_scan(first_beam, settings.model.laser, observation.scan.ranges))
        if self._steps % settings.ground_truth_every == 0:
            seen = observation.reference
            measured = messages.stamp_of(self._epoch + round(float(seen.times) * _NS))
            self._truth.publish(
                messages.odometry(measured, settings.map_frame, settings.base_frame, seen.poses, seen.rates)
            )
        if self._steps % settings.clock_every == 0:
            self._clock.publish(Clock(stamp))

    def _warn(self) -> None:
        newest = self._holder.newest
        if newest is not None and self._now - newest > self._settings.voltage_timeout * _NS:
            silent = (self._now - newest) / _NS
            rospy.logwarn_throttle(
                10.0, f"SIM_VOLTAGES_SILENT for {silent:.2f} s: the D/A converter holds its last voltages"
            )


def main() -> None:
    """Run the node; exit with 1 and one line for bad configuration."""
    rospy.init_node("sim_node")
    try:
        settings = read_settings(rospy.get_param("~", {}), rospy.get_name())
        node = SimNode(settings)
    except Error as error:
        rospy.logfatal(one_line(error))
        sys.exit(1)
    for warning in settings.world.warnings:
        rospy.logwarn(f"SIM_WORLD_IGNORED {warning}")
    node.run()

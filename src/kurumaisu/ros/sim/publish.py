# SPDX-License-Identifier: BSD-3-Clause
"""Everything that sim_node publishes of a step."""

from __future__ import annotations

import rospy
import tf2_ros
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock

from kurumaisu.ros import messages
from kurumaisu.ros.sim.laser import LaserOutput
from kurumaisu.ros.sim.sensors import SensorTopics
from kurumaisu.ros.sim.settings import SimSettings
from kurumaisu.ros.stageros.robot import CollisionTopic
from kurumaisu.sim.chair.simulator import Observation

_NS = 1_000_000_000


class SimTopics:
    """The topics, and the frames of laser and further sensors."""

    def __init__(self, settings: SimSettings, laser: LaserOutput, robot: int, now: int) -> None:
        """Advertise at a time [ns]; laser: where scans go; robot: the chair's number among the robots."""
        self._settings = settings
        self._laser = laser
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._truth = rospy.Publisher("ground_truth", Odometry, queue_size=10)
        self._collision = CollisionTopic("collision")
        self._sensors = SensorTopics(settings.sensors, robot, settings.base_frame)
        self._static = tf2_ros.StaticTransformBroadcaster()
        stamp = messages.stamp_of(now)
        mount = messages.laser_transform(stamp, settings.model.laser, settings.base_frame)
        self._static.sendTransform([mount, *self._sensors.transforms(stamp)])
        self._touched = False

    def publish(self, observation: Observation, epoch: int, steps: int) -> None:
        """Publish a step's data, then the clock: who hears a time has been sent all before it.

        But for a scan that a driver makes: the clock goes before what the driver is to stamp by it.
        epoch [ns]: what the clock said at the simulation's time 0; steps since then.
        """
        settings = self._settings
        now = epoch + round(observation.time * _NS)
        stamp = messages.stamp_of(now)
        if observation.scan is not None:
            self._laser.publish(observation.scan, epoch)
        self._sensors.publish(observation.readings, stamp)
        self._touched |= observation.contact
        if steps % settings.ground_truth_every == 0:
            seen = observation.reference
            measured = messages.stamp_of(epoch + round(float(seen.times) * _NS))
            self._truth.publish(
                messages.odometry(measured, settings.map_frame, settings.base_frame, seen.poses, seen.rates)
            )
            self._collision.publish(self._touched)
            self._touched = False
        if steps % settings.clock_every == 0:
            self._clock.publish(Clock(stamp))
        self._laser.advance(now, observation.scan, epoch)

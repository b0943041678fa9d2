# SPDX-License-Identifier: BSD-3-Clause
"""Everything that stageros publishes of a step of the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from kurumaisu.ros.outlet import DEPTH, Outlet
from kurumaisu.ros.stageros.camera import Cameras
from kurumaisu.ros.stageros.names import Names
from kurumaisu.ros.stageros.plan import RobotPlan
from kurumaisu.ros.stageros.rates import Pace
from kurumaisu.ros.stageros.robot import CommandListener, RobotTopics, Timing, transform_of
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.ros.stageros.truth import GroundTruth
from kurumaisu.ros.wire import ClockWire, Stamp, TransformsWire, odometry_fields
from kurumaisu.sim.robots.observation import Observation
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Model

_NS = 1_000_000_000
_TF_DEPTH = 100  # as of tf2_ros


class TransformTopic:
    """odom -> base_footprint -> base_link -> sensors of all robots, in one message on /tf."""

    def __init__(self, settings: StagerosSettings) -> None:
        self.outlet = Outlet("/tf", TFMessage, _TF_DEPTH)
        self._frames = settings.frames
        self._wire = TransformsWire([])
        self._fields = self._wire.fields([])

    def change(self, plans: Sequence[RobotPlan]) -> None:
        """Take other robots from now on."""
        pairs: list[tuple[str, str]] = []
        mounts: list[tuple[int, list[float]]] = []
        odometry: list[int] = []
        frames = self._frames
        for plan in plans:
            odom, foot, base = map(plan.names.frame, (frames.odom, frames.base_footprint, frames.base_link))
            for scan in plan.scans:
                mounts.append((len(pairs), transform_of(scan.mount)))
                pairs.append((base, scan.frame))
            pairs.append((foot, base))
            odometry.append(len(pairs))
            pairs.append((odom, foot))
        self._wire = TransformsWire(pairs)
        for index, mount in mounts:
            self._wire.fill(index, mount)
        self._fields = self._wire.fields(odometry)

    def publish(self, odometry: FloatArray, now: int) -> None:
        """Send the transforms with the robots' odometry (n, 3) at a time [ns]."""
        if self.outlet.wanted and len(odometry):
            self._fields.fill(now, odometry)
            self.outlet.send(self._wire.data)


class Publisher:
    """The topics of a world."""

    def __init__(self, settings: StagerosSettings, interval: float, ears: Callable[[Names], CommandListener]) -> None:
        """Advertise; interval [s]: of the steps; ears: what listens to the commands for a robot of these names."""
        self._settings = settings
        self._pace = Pace(settings.rates, interval)
        self._interval = interval
        self._ears = ears
        self._odometry = self._truths = odometry_fields([])
        self._transforms = TransformTopic(settings) if settings.publish_tf else None
        self._cameras = Cameras(settings, self._pace, self._transforms.outlet if self._transforms else None)
        self._robots: list[RobotTopics] = []
        self._clock, self._clock_wire = Outlet("/clock", Clock, DEPTH), ClockWire()
        self._truth = GroundTruth(interval)
        kinds = ("tf", "odom", "base_pose_ground_truth", "clock")
        periods = map(self._pace.every, kinds)
        self._every_transform, self._every_odometry, self._every_truth, self._every_clock = periods

    def change(self, models: Sequence[Model], plans: Sequence[RobotPlan]) -> None:
        """Publish these models' robots from now on; those that stay, by their names, keep their topics."""
        there = {robot.plan.likeness: robot for robot in self._robots}
        stay = {plan.likeness for plan in plans}
        for likeness in [likeness for likeness in there if likeness not in stay]:
            there.pop(likeness).close()  # first, as another one may have the name
        self._robots = []
        for plan in plans:
            robot = there.get(plan.likeness)
            if robot is None:
                robot = RobotTopics(plan, self._settings, self._pace, self._timing, self._ears(plan.names))
            robot.plan = plan
            self._robots.append(robot)
        self._odometry = odometry_fields([robot.odometry.wire for robot in self._robots])
        self._truths = odometry_fields([robot.truth.wire for robot in self._robots])
        if self._transforms:
            self._transforms.change(plans)
        self._cameras.change(models, plans)
        self._truth.forget()

    def publish(self, observation: Observation, poses: Callable[[], FloatArray], number: int, stamp: Stamp) -> None:
        """Publish a step, the number-th; poses: tells the poses (m, 4) of all models."""
        self._truth.take(observation)
        if self._cameras.wanted:
            self._cameras.publish(poses, number, stamp)
        now = stamp[0] * _NS + stamp[1]
        if self._transforms and number % self._every_transform == 0:
            self._transforms.publish(observation.odometry, now)
        self._publish_sensors(observation, number, stamp)
        if number % self._every_odometry == 0:
            self._odometry.fill(now, observation.odometry, observation.velocities)
            for robot in self._robots:
                robot.odometry.publish()
        if number % self._every_truth == 0:
            self._truths.fill_change(*self._truth.change(now))
            for robot in self._robots:
                robot.truth.publish()
        if self._settings.publish_collision and number % self._pace.every("collision") == 0:
            self._publish_collisions(observation)
        if number % self._every_clock == 0 and self._clock.wanted:
            self._clock_wire.stamp(stamp)
            self._clock.send(self._clock_wire.data)  # last: who hears a time has been sent all before it

    def check_rates(self) -> None:
        """Raise Error for a rate of a sensor that there is not."""
        self._pace.check(topic for robot in self._robots for topic in robot.sensors)

    def _timing(self, every: int) -> Timing:
        said = self._settings.scan_timing
        return Timing(every * self._interval, self._settings.options.scan_sweep) if said else Timing(0.0, 0.0)

    def _publish_sensors(self, observation: Observation, number: int, stamp: Stamp) -> None:
        scans = observation.scans
        for robot in self._robots:
            for index, topic, every in robot.scans:
                if number % every == 0 and scans.sweep(index).count:  # as in 1.8.0, nothing before the first look
                    topic.publish(scans, index, stamp)
            for device in robot.devices:
                device.take(observation.devices)
                if number % device.every == 0:
                    device.publish(stamp)

    def _publish_collisions(self, observation: Observation) -> None:
        for robot, stalled in zip(self._robots, observation.stalled.tolist(), strict=True):
            if robot.collision is not None:
                robot.collision.publish(stalled)

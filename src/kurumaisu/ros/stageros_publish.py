# SPDX-License-Identifier: BSD-3-Clause
"""Everything that stageros publishes of a step of the world."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from kurumaisu.errors import Error
from kurumaisu.ros.outlet import Outlet
from kurumaisu.ros.stageros_camera import Cameras
from kurumaisu.ros.stageros_names import Names
from kurumaisu.ros.stageros_plan import RobotPlan
from kurumaisu.ros.stageros_robot import DEPTH, Ears, RobotTopics, Timing, transform_of
from kurumaisu.ros.stageros_settings import StagerosSettings
from kurumaisu.ros.wire import ClockWire, Stamp, TransformsWire, planar
from kurumaisu.sim.observation import Observation
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Model

_TF_DEPTH = 100  # as of tf2_ros
_ROUNDING = 1e-6  # steps; of a division


class Transforms:
    """odom -> base_footprint -> base_link -> sensors of all robots, in one message on /tf."""

    def __init__(self, settings: StagerosSettings) -> None:
        self.outlet = Outlet("/tf", TFMessage, _TF_DEPTH)
        self._frames = settings.frames
        self._odom: list[int] = []
        self._wire = TransformsWire([])

    def change(self, plans: Sequence[RobotPlan]) -> None:
        """Take other robots from now on."""
        pairs: list[tuple[str, str]] = []
        mounts: list[tuple[int, list[float]]] = []
        self._odom = []
        frames = self._frames
        for plan in plans:
            odom, foot, base = map(plan.names.frame, (frames.odom, frames.base_footprint, frames.base_link))
            for scan in plan.scans:
                mounts.append((len(pairs), transform_of(scan.mount)))
                pairs.append((base, scan.frame))
            pairs.append((foot, base))
            self._odom.append(len(pairs))
            pairs.append((odom, foot))
        self._wire = TransformsWire(pairs)
        for index, mount in mounts:
            self._wire.fill(index, mount)

    def publish(self, odometry: Sequence[Sequence[float]], stamp: Stamp) -> None:
        """Send the transforms with each robot's odometry (7,)."""
        if self.outlet.wanted and self._odom:
            self._wire.stamp(stamp)
            for index, pose in zip(self._odom, odometry, strict=True):
                self._wire.fill(index, pose)
            self.outlet.send(self._wire.data)


class Publisher:
    """The topics of a world."""

    def __init__(self, settings: StagerosSettings, interval: float, ears: Callable[[Names], Ears]) -> None:
        """Advertise; interval [s]: of the steps; ears: what listens to the commands for a robot of these names."""
        self._settings = settings
        self._every = steps_between(settings, interval)
        self._interval = interval
        self._ears = ears
        self._timing = Timing(0.0, 0.0)
        if settings.scan_timing:
            self._timing = Timing(self._every["scan"] * interval, settings.options.scan_sweep)
        self._transforms = Transforms(settings) if settings.publish_tf else None
        self._cameras = Cameras(settings, self._transforms.outlet if self._transforms else None)
        self._robots: list[RobotTopics] = []
        self._clock, self._clock_wire = Outlet("/clock", Clock, DEPTH), ClockWire()
        self._poses: list[list[float]] = []  # the true ones of this step
        self._before = self._poses  # and of the step before
        self._kinds: dict[str, Callable[[Observation, Stamp], None]] = {
            "tf": self._publish_transforms,
            "scan": self._publish_scans,
            "odom": self._publish_odometry,
            "ground_truth": self._publish_truth,
            "collision": self._publish_collisions,
            "clock": self._publish_clock,  # last: who hears a time has been sent all before it
        }

    def change(self, models: Sequence[Model], plans: Sequence[RobotPlan]) -> None:
        """Publish these models' robots from now on; those that stay, by their names, keep their topics."""
        there = {robot.plan.names: robot for robot in self._robots}
        self._robots = []
        for plan in plans:
            robot = there.pop(plan.names, None)
            if robot is None:
                robot = RobotTopics(plan, self._settings, self._timing, self._ears(plan.names))
            robot.plan = plan
            self._robots.append(robot)
        for gone in there.values():
            gone.close()
        if self._transforms:
            self._transforms.change(plans)
        self._cameras.change(models, plans)
        self._poses = []

    def publish(self, observation: Observation, poses: Callable[[], FloatArray], number: int, stamp: Stamp) -> None:
        """Publish a step, the number-th; poses: tells the poses (m, 4) of all models."""
        self._before, self._poses = self._poses, observation.poses.tolist()
        if not self._before:
            self._before = self._poses  # the first message says zero, as in 1.8.0
        if number % self._every["image"] == 0 and self._cameras.wanted:
            self._cameras.publish(poses(), stamp)
        for kind, publish in self._kinds.items():
            if number % self._every[kind] == 0:
                publish(observation, stamp)

    def _publish_transforms(self, observation: Observation, stamp: Stamp) -> None:
        if self._transforms:
            self._transforms.publish(planar(observation.odometry.tolist()), stamp)

    def _publish_scans(self, observation: Observation, stamp: Stamp) -> None:
        for robot in self._robots:
            for index, topic in robot.scans:
                scan = observation.scans[index]
                if scan.count:  # as in 1.8.0, nothing before the ranger has looked
                    topic.publish(scan, stamp)

    def _publish_odometry(self, observation: Observation, stamp: Stamp) -> None:
        poses, velocities = planar(observation.odometry.tolist()), observation.velocities.tolist()
        for robot, pose, (v, sideways, w) in zip(self._robots, poses, velocities, strict=True):
            robot.odometry.publish(pose, (v, sideways, 0.0, 0.0, 0.0, w), stamp)

    def _publish_truth(self, observation: Observation, stamp: Stamp) -> None:
        poses = planar([(x, y, heading) for x, y, _, heading in self._poses])
        for robot, pose, rates in zip(self._robots, poses, self._rates(), strict=True):
            robot.truth.publish(pose, rates, stamp)

    def _publish_collisions(self, observation: Observation, _stamp: Stamp) -> None:
        for robot, stalled in zip(self._robots, observation.stalled.tolist(), strict=True):
            if robot.collision is not None:
                robot.collision.publish(stalled)

    def _publish_clock(self, _observation: Observation, stamp: Stamp) -> None:
        if self._clock.wanted:
            self._clock_wire.stamp(stamp)
            self._clock.send(self._clock_wire.data)

    def _rates(self) -> list[tuple[float, ...]]:
        """Return the change of the true poses since the step before, in the world's axes, as twists (6,)."""
        dt = self._interval
        return [
            ((x - x0) / dt, (y - y0) / dt, (z - z0) / dt, 0.0, 0.0, math.remainder(heading - heading0, math.tau) / dt)
            for (x, y, z, heading), (x0, y0, z0, heading0) in zip(self._poses, self._before, strict=True)
        ]


def steps_between(settings: StagerosSettings, interval: float) -> dict[str, int]:
    """Return how many steps lie between two messages of a kind. Raise Error if that is no integer."""
    result = {}
    for kind, rate in dataclasses.asdict(settings.rates).items():
        steps = 1.0 if rate == 0 else 1 / (rate * interval)
        if round(steps) < 1 or abs(steps - round(steps)) > _ROUNDING:
            raise Error(f"rates: {kind}: must divide the world's {1 / interval:g} Hz: {rate:g}")
        result[kind] = round(steps)
    return result

# SPDX-License-Identifier: BSD-3-Clause
"""Everything that stageros publishes of a step of the world."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.ros.outlet import Outlet
from kurumaisu.ros.stageros_plan import RobotPlan
from kurumaisu.ros.stageros_robot import DEPTH, RobotTopics, transform_of
from kurumaisu.ros.stageros_settings import StagerosSettings
from kurumaisu.ros.wire import ClockWire, Stamp, TransformsWire, planar
from kurumaisu.sim import Observation
from kurumaisu.types import FloatArray

_TF_DEPTH = 100  # as of tf2_ros
_ROUNDING = 1e-6  # steps; of a division


class Transforms:
    """odom -> base_footprint -> base_link -> sensors of all robots, in one message on /tf."""

    def __init__(self, plans: Sequence[RobotPlan], settings: StagerosSettings) -> None:
        self._outlet = Outlet("/tf", TFMessage, _TF_DEPTH)
        frames = settings.frames
        pairs: list[tuple[str, str]] = []
        mounts: list[tuple[int, list[float]]] = []
        self._odom: list[int] = []
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
        if self._outlet.wanted and len(self._wire):
            self._wire.stamp(stamp)
            for index, pose in zip(self._odom, odometry, strict=True):
                self._wire.fill(index, pose)
            self._outlet.send(self._wire.data)

    def close(self) -> None:
        """End the topic."""
        self._outlet.close()


class Publisher:
    """The topics of a world; its robots are those of the plans."""

    def __init__(
        self,
        plans: Sequence[RobotPlan],
        settings: StagerosSettings,
        interval: float,
        command: Callable[[int, Twist], None],
    ) -> None:
        """Advertise everything; interval [s]: of the steps; command: called with a robot's row and its cmd_vel."""
        self._every = _every(settings, interval)
        self._interval = interval
        self._transforms = Transforms(plans, settings) if settings.publish_tf else None
        scan_interval = self._every["scan"] * interval
        self._robots = [RobotTopics(plan, settings, scan_interval, _for_row(command, plan.row)) for plan in plans]
        self._clock, self._clock_wire = Outlet("/clock", Clock, DEPTH), ClockWire()
        self._before: FloatArray | None = None  # the true poses of the step before
        self._kinds: dict[str, Callable[[Observation, Stamp], None]] = {
            "tf": self._publish_transforms,
            "scan": self._publish_scans,
            "odom": self._publish_odometry,
            "ground_truth": self._publish_truth,
            "collision": self._publish_collisions,
            "clock": self._publish_clock,  # last: who hears a time has been sent all before it
        }
        self._rates: list[list[float]] = []

    def publish(self, observation: Observation, number: int, stamp: Stamp) -> None:
        """Publish a step, the number-th."""
        self._rates = self._true_rates(observation.poses)
        for kind, publish in self._kinds.items():
            if number % self._every[kind] == 0:
                publish(observation, stamp)

    def close(self) -> None:
        """End all topics."""
        for robot in self._robots:
            robot.close()
        if self._transforms:
            self._transforms.close()
        self._clock.close()

    def _publish_transforms(self, observation: Observation, stamp: Stamp) -> None:
        if self._transforms:
            self._transforms.publish(planar(observation.odometry), stamp)

    def _publish_scans(self, observation: Observation, stamp: Stamp) -> None:
        for robot in self._robots:
            for index, topic in robot.scans:
                topic.publish(observation.scans[index], stamp)

    def _publish_odometry(self, observation: Observation, stamp: Stamp) -> None:
        poses, velocities = planar(observation.odometry), observation.velocities.tolist()
        for robot, pose, (v, sideways, w) in zip(self._robots, poses, velocities, strict=True):
            robot.odometry.publish(pose, (v, sideways, 0.0, 0.0, 0.0, w), stamp)

    def _publish_truth(self, observation: Observation, stamp: Stamp) -> None:
        poses = planar(observation.poses[:, [0, 1, 3]])
        for robot, pose, rates in zip(self._robots, poses, self._rates, strict=True):
            robot.truth.publish(pose, rates, stamp)

    def _publish_collisions(self, observation: Observation, _stamp: Stamp) -> None:
        for robot, stalled in zip(self._robots, observation.stalled.tolist(), strict=True):
            if robot.collision is not None:
                robot.collision.publish(stalled)

    def _publish_clock(self, _observation: Observation, stamp: Stamp) -> None:
        if self._clock.wanted:
            self._clock_wire.stamp(stamp)
            self._clock.send(self._clock_wire.data)

    def _true_rates(self, poses: FloatArray) -> list[list[float]]:
        """Return the change of the true poses since the step before, in the world's axes, as twists (6,)."""
        twists = np.zeros((len(poses), 6))
        if self._before is not None:
            change = poses - self._before
            twists[:, :3] = change[:, :3] / self._interval
            twists[:, 5] = wrap(change[:, 3]) / self._interval
        self._before = poses.copy()
        result: list[list[float]] = twists.tolist()
        return result


def _every(settings: StagerosSettings, interval: float) -> dict[str, int]:
    """Return how many steps lie between two messages of a kind. Raise Error if that is no integer."""
    result = {}
    for kind, rate in dataclasses.asdict(settings.rates).items():
        steps = 1.0 if rate == 0 else 1 / (rate * interval)
        if round(steps) < 1 or abs(steps - round(steps)) > _ROUNDING:
            raise Error(f"rates: {kind}: must divide the world's {1 / interval:g} Hz: {rate:g}")
        result[kind] = round(steps)
    return result


def _for_row(command: Callable[[int, Twist], None], row: int) -> Callable[[Twist], None]:
    return lambda message: command(row, message)

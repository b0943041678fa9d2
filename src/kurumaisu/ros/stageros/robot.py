# SPDX-License-Identifier: BSD-3-Clause
"""The topics of one robot of stageros."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, Range
from std_msgs.msg import Bool

from kurumaisu.ros.inbox import subscribe
from kurumaisu.ros.outlet import OutletTopic
from kurumaisu.ros.stageros.devices import DeviceTopic
from kurumaisu.ros.stageros.plan import RobotPlan, ScanPlan
from kurumaisu.ros.stageros.rates import Pace
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.ros.wire import BoolWire, LaserScanWire, OdometryWire, RangeWire, Stamp
from kurumaisu.sim.rangers.scans import Scans, Sweep
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Fan

_BAD_POSE = "STAGEROS_POSE_BAD"


@dataclass(frozen=True)
class Timing:
    """Seconds from scan to scan, and from a scan's first to its last beam; 0: not said."""

    scan: float
    sweep: float


@dataclass(frozen=True)
class CommandListener:
    """What is called with a robot's cmd_vel and its cmd_pose."""

    twist: Callable[[Twist], None]
    pose: Callable[[Pose], None]


class ScanTopic(OutletTopic):
    """A sensor as sensor_msgs/LaserScan."""

    def __init__(self, plan: ScanPlan, fan: Fan, timing: Timing) -> None:
        super().__init__(plan.topic, LaserScan)
        self._wire = LaserScanWire(_fan_message(plan, fan, timing), fan.samples)
        self._miss = fan.range_max
        self._is_noisy = bool(fan.noise.any())
        self._written: Sweep | None = None

    def publish(self, scans: Scans, index: int, stamp: Stamp) -> None:
        """Send a fan's newest reading, which may be the one before: most worlds step more often than they look."""
        seq = self._outlet.next_number()
        if self._outlet.wanted:
            self._wire.stamp(seq, stamp)
            if (sweep := scans.sweep(index)) is not self._written:
                reading, self._written = scans[index], sweep
                self._write(reading.ranges)
                self._wire.intensities[:] = reading.returns
            self._outlet.send(self._wire.data)

    def _write(self, ranges: FloatArray) -> None:
        """Write ranges, a miss as range_max; noise may lift others above it, as in Stage."""
        if self._is_noisy:
            self._wire.ranges[:] = np.where(np.isinf(ranges), self._miss, ranges)
        else:
            np.minimum(ranges, self._miss, out=self._wire.ranges, casting="same_kind")


class RangeTopic(OutletTopic):
    """A sensor of one beam as sensor_msgs/Range."""

    def __init__(self, plan: ScanPlan, fan: Fan) -> None:
        super().__init__(plan.topic, Range)
        message = Range(radiation_type=Range.ULTRASOUND, field_of_view=fan.fov)
        message.min_range, message.max_range = fan.range_min, fan.range_max
        message.header.frame_id = plan.frame
        self._wire = RangeWire(message)
        self._miss = fan.range_max

    def publish(self, scans: Scans, index: int, stamp: Stamp) -> None:
        """Send a fan's newest reading."""
        seq = self._outlet.next_number()
        if self._outlet.wanted:
            self._wire.stamp(seq, stamp)
            self._wire.fill(min(float(scans[index].ranges[0]), self._miss))
            self._outlet.send(self._wire.data)


class OdometryTopic(OutletTopic):
    """Poses and rates as nav_msgs/Odometry; the wire is filled by those who fill all robots' at once."""

    def __init__(self, topic: str, wire: OdometryWire) -> None:
        super().__init__(topic, Odometry)
        self.wire = wire

    def publish(self) -> None:
        """Send what the wire has."""
        if self._outlet.wanted:
            self._outlet.send(self.wire.data)


class CollisionTopic(OutletTopic):
    """Whether the robot pushes against something, as std_msgs/Bool."""

    def __init__(self, topic: str) -> None:
        super().__init__(topic, Bool)
        self._wire = BoolWire()

    def publish(self, stalled: bool) -> None:
        """Send it."""
        if self._outlet.wanted:
            self._wire.fill(stalled)
            self._outlet.send(self._wire.data)


class RobotTopics:
    """Everything of one robot but cameras."""

    def __init__(
        self,
        plan: RobotPlan,
        settings: StagerosSettings,
        pace: Pace,
        timing: Callable[[int], Timing],
        hear: CommandListener,
    ) -> None:
        """timing: of a scan that is published every so many steps."""
        names, frames = plan.names, settings.frames
        child = names.frame(frames.base_footprint) if settings.set_child_frame_id else ""
        odom, truth = names.frame(frames.odom), names.frame(frames.ground_truth)
        variances = settings.pose_variances, settings.twist_variances
        self.odometry = OdometryTopic(names.topic("odom"), OdometryWire(odom, child, *variances))
        zeros = (0.0,) * 6  # the truth has no error
        self.truth = OdometryTopic(names.topic("base_pose_ground_truth"), OdometryWire(truth, child, zeros, zeros))
        self.collision = CollisionTopic(names.topic("collision")) if settings.publish_collision else None
        self._scans: list[tuple[ScanTopic | RangeTopic, int]] = []
        for scan in plan.scans:
            if scan.fan is not None:
                every = pace.sensor("base_scan", scan.topic)
                topic = RangeTopic(scan, scan.fan) if scan.is_range else ScanTopic(scan, scan.fan, timing(every))
                self._scans.append((topic, every))
        kinds = {"bumper": "bumper", "fiducial": "fiducials"}
        base = names.frame(frames.base_link)
        self.devices = [
            DeviceTopic(device, base, pace.sensor(kinds[device.kind], device.topic)) for device in plan.devices
        ]
        self.plan = plan
        twist, pose, stamped = (names.topic(name) for name in ("cmd_vel", "cmd_pose", "cmd_pose_stamped"))
        self._commands = [
            subscribe(twist, Twist, hear.twist, "STAGEROS_COMMAND_BAD", queue_size=10),
            subscribe(pose, Pose, hear.pose, _BAD_POSE, queue_size=10),
            subscribe(stamped, PoseStamped, lambda m: hear.pose(m.pose), _BAD_POSE, queue_size=10),
        ]

    @property
    def plan(self) -> RobotPlan:
        """Where the robot is in the observation; it changes when another one goes."""
        return self._plan

    @plan.setter
    def plan(self, plan: RobotPlan) -> None:
        self._plan = plan
        indices = [scan.index for scan in plan.scans if scan.fan is not None]
        self.scans = [(index, *scan) for index, scan in zip(indices, self._scans, strict=True)]
        for topic, device in zip(self.devices, plan.devices, strict=True):
            topic.plan = device

    @property
    def sensors(self) -> list[str]:
        """Topics that can have rates of their own."""
        cameras = [camera.names.topic("image", camera.number) for camera in self._plan.cameras]
        scans, devices = (plan.topic for plan in self._plan.scans), (plan.topic for plan in self._plan.devices)
        return [*scans, *devices, *cameras]

    def close(self) -> None:
        """End all topics."""
        for subscriber in self._commands:
            subscriber.unregister()
        for topic in (self.odometry, self.truth, self.collision, *(t for t, _ in self._scans), *self.devices):
            if topic is not None:
                topic.close()


def _fan_message(plan: ScanPlan, fan: Fan, timing: Timing) -> LaserScan:
    message = LaserScan()
    message.header.frame_id = plan.frame
    message.angle_min, message.angle_max = -fan.fov / 2, fan.fov / 2
    # 1.8.0 divides by zero for a single beam
    message.angle_increment = fan.fov / (fan.samples - 1) if fan.samples > 1 else 0.0
    message.scan_time = timing.scan
    message.time_increment = timing.sweep / (fan.samples - 1) if fan.samples > 1 else 0.0
    message.range_min, message.range_max = fan.range_min, fan.range_max
    return message


def transform_of(mount: FloatArray) -> list[float]:
    """Return x, y, z [m], heading [rad] as translation and quaternion (7,)."""
    half = float(mount[3]) / 2
    return [float(mount[0]), float(mount[1]), float(mount[2]), 0.0, 0.0, float(np.sin(half)), float(np.cos(half))]

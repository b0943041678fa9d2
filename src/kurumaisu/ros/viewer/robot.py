# SPDX-License-Identifier: BSD-3-Clause
"""A robot of which only its topics are known: where tf has it, and what its laser sees."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from sensor_msgs.msg import LaserScan

from kurumaisu.geometry import compose, interpolate
from kurumaisu.params import Model
from kurumaisu.ros.inbox import check_scan
from kurumaisu.ros.viewer.topics import Newest, Now, PlanarTransforms
from kurumaisu.types import FloatArray
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.protocol import Body, Fan, Ranger, World

_ID = "chair"
_COLOR = "#334d99"
_REMEMBERED = 90  # poses: 3 s at 30 Hz


class Robot:
    """Puts the footprint into the hub, and tells of the moment."""

    def __init__(self, hub: Hub, model: Model, transforms: PlanarTransforms, frames: tuple[str, str, str]) -> None:
        """frames: map, odom and base; without a map the world is odom's."""
        self._hub = hub
        self._transforms = transforms
        self._map, self._odom, self._base = frames
        self._scan = Newest("scan", LaserScan, check_scan)
        self._now = Now()
        self._past: deque[tuple[float, FloatArray]] = deque(maxlen=_REMEMBERED)
        mount = model.laser.mount
        self._mount = np.array([mount.x, mount.y, mount.yaw])
        self._footprint = _footprint(model)
        self.run = 0
        self.odometry = None  # none but a base controller's

    def open(self) -> None:
        """Listen."""
        body = Body(_ID, _ID, "robot", _COLOR, movable=False, polygons=(self._footprint,), drivable=True)
        self._hub.world(World((body,), None))
        self._scan.open()
        self._now.open()

    def close(self) -> None:
        """Listen no longer."""
        self._scan.close()
        self._now.close()
        self._past.clear()

    def drives(self) -> dict[str, str | None]:
        """Return the one that can be driven: by the topic that the settings name."""
        return {_ID: None}

    def moment(self) -> tuple[dict[str, Any], dict[Ranger, Fan]] | None:
        """Return what goes into a State, and the scan if it is new."""
        now = self._now.time()
        pose = self._transforms.lookup(self._map, self._base)
        if pose is None:
            pose = self._transforms.lookup(self._odom, self._base)
        parts: dict[str, Any] = {"t": now}
        if pose is None:
            return parts, {}
        self._remember(now, pose)
        return parts | {"poses": {_ID: tuple(pose.tolist())}}, self._scans()

    def _remember(self, now: float, pose: FloatArray) -> None:
        if self._past and now < self._past[-1][0]:  # the clock was set back
            self._past.clear()
        if self._past:
            turns = np.rint((self._past[-1][1][2] - pose[2]) / (2 * np.pi))
            pose = pose + np.array([0.0, 0.0, 2 * np.pi * turns])
        if not self._past or now > self._past[-1][0]:
            self._past.append((now, pose))

    def _scans(self) -> dict[Ranger, Fan]:
        scan = self._scan.take()
        if scan is None:
            return {}
        times = np.array([time for time, _ in self._past])
        poses = np.array([pose for _, pose in self._past])
        then = interpolate(times, poses, np.array([scan.header.stamp.to_sec()]))[0]
        x, y, yaw = compose(then, self._mount).tolist()
        return {
            (0, 0): Fan(
                pose=(x, y, yaw),
                angle_min=scan.angle_min,
                angle_increment=scan.angle_increment,
                range_min=scan.range_min,
                range_max=scan.range_max,
                ranges=scan.ranges,
                intensities=scan.intensities if len(scan.intensities) == len(scan.ranges) else None,
            )
        }


def _footprint(model: Model) -> tuple[tuple[float, float], ...]:
    chassis = model.chassis
    front, rear, half = chassis.axle_to_front, chassis.axle_to_front - chassis.length, chassis.width / 2
    return ((front, half), (rear, half), (rear, -half), (front, -half))

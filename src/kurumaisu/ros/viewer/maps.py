# SPDX-License-Identifier: BSD-3-Clause
"""Map, particles and estimate of whoever maps or localises, laid on the world that is shown."""

from __future__ import annotations

import io
import struct
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from PIL import Image

from kurumaisu.geometry import between, compose
from kurumaisu.map_file import FREE_BELOW, OCCUPIED_ABOVE
from kurumaisu.ros.inbox import check_covariance
from kurumaisu.ros.maps.messages import map_of
from kurumaisu.ros.rotation import planar
from kurumaisu.ros.viewer.topics import Alignment, Newest, PlanarTransforms
from kurumaisu.types import FloatArray
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.protocol import Estimate

_PAUSE = 1.0  # [s] between pictures of a map at least
_WALL, _FREE, _UNKNOWN = 0, 254, 205  # shades, as map_saver's
_POSE = 7  # float64 of a geometry_msgs/Pose


class Maps:
    """Shows a map and where a robot believes to be in it."""

    def __init__(self, hub: Hub, transforms: PlanarTransforms, map_frame: str, base_frame: str) -> None:
        self._hub = hub
        self._transforms = transforms
        self._frames = map_frame, base_frame
        self._map = Newest("map", OccupancyGrid, map_of)
        self._cloud = Newest("particlecloud", PoseArray)
        self._pose = Newest("amcl_pose", PoseWithCovarianceStamped, lambda m: check_covariance(m.pose.covariance))
        self._topics = (self._map, self._cloud, self._pose)
        self._alignment = Alignment()
        self._drawn = 0.0  # [s] when the last picture was
        self._offset = np.zeros(3)  # of the map in the world that is shown

    def open(self) -> None:
        """Listen."""
        self._alignment.begin()
        self._offset = np.zeros(3)
        for topic in self._topics:
            topic.open()

    def close(self) -> None:
        """Listen no longer."""
        for topic in self._topics:
            topic.close()

    @property
    def there(self) -> bool:
        """Whether anybody maps or localises: nobody else's transforms are of use here."""
        return any(topic.there for topic in self._topics)

    def estimate(self, truth: FloatArray | None) -> Estimate | None:
        """Return where it believes to be in the world shown; show map and particles, if they are new.

        truth: where it is, if that is known. Who maps from nothing begins where he is: his map is laid there. Who
        localises has the map of the world.
        """
        pose = self._transforms.lookup(*self._frames)
        if pose is None:
            return None
        self._pose.take()
        known = self._pose.last is not None
        if truth is not None and not known:
            laid = self._alignment.laid(pose, truth)
            assert laid is not None
            offset = self._alignment.laid(np.zeros(3), None)
        else:
            laid, offset = pose, np.zeros(3)
        assert offset is not None
        self._offset = offset
        self._show(offset)
        x, y, yaw = laid.tolist()
        if not known:
            return Estimate((x, y, yaw), None)
        c = self._pose.last.pose.covariance
        return Estimate((x, y, yaw), (float(c[0]), float(c[1]), float(c[7]), float(c[35])))

    def in_map(self, pose: FloatArray) -> FloatArray:
        """Return a pose (3,) of the world that is shown in the frame of the map."""
        return between(self._offset, pose)

    def _show(self, offset: FloatArray) -> None:
        if (raw := self._cloud.take_raw()) is not None:
            self._hub.particles(compose(offset, _planar_poses(raw)))
        if time.monotonic() - self._drawn < _PAUSE:
            return
        if (grid := self._map.take()) is not None:
            self._drawn = time.monotonic()
            x, y, yaw = compose(offset, planar(grid.info.origin)).tolist()
            size = grid.info.width, grid.info.height
            self._hub.map(_picture(grid), *size, grid.info.resolution, (x, y, yaw))


def _picture(grid: Any) -> bytes:
    cells = np.asarray(grid.data, dtype=np.int8).reshape(grid.info.height, grid.info.width)
    shades = np.full(cells.shape, _UNKNOWN, dtype=np.uint8)
    shades[cells > OCCUPIED_ABOVE] = _WALL
    shades[(cells >= 0) & (cells < FREE_BELOW)] = _FREE
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(shades[::-1])).save(file, "PNG", compress_level=1)
    return file.getvalue()


def _planar_poses(raw: bytes) -> FloatArray:
    """Return x, y [m], yaw [rad] (n, 3) of a PoseArray's bytes: as objects, thousands would take too long."""
    (frame,) = struct.unpack_from("<I", raw, 12)
    start = 16 + frame
    (count,) = struct.unpack_from("<I", raw, start)
    rows = np.frombuffer(raw, "<f8", count * _POSE, start + 4).reshape(-1, _POSE)
    return np.stack([rows[:, 0], rows[:, 1], 2 * np.arctan2(rows[:, 5], rows[:, 6])], axis=-1)

# SPDX-License-Identifier: BSD-3-Clause
"""Maps as messages. genpy packs cells one by one, which takes a minute for 10^8; here they stay arrays."""

from __future__ import annotations

import math

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from rospy.numpy_msg import numpy_msg

from kurumaisu.errors import Error
from kurumaisu.map_file import MapFile
from kurumaisu.plausible import require
from kurumaisu.ros.rotation import planar
from kurumaisu.types import FloatArray

GridMessage = numpy_msg(OccupancyGrid)  # an OccupancyGrid whose data are a numpy array


def message_of(served: MapFile, frame: str, stamp: rospy.Time) -> OccupancyGrid:
    """Return the message of a map."""
    message = GridMessage()
    message.header.frame_id = frame
    message.header.stamp = message.info.map_load_time = stamp
    message.info.resolution = served.resolution
    message.info.height, message.info.width = served.cells.shape
    x, y, yaw = served.origin
    message.info.origin.position.x, message.info.origin.position.y = x, y
    message.info.origin.orientation.z, message.info.origin.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    message.data = served.cells.ravel()
    return message


def map_of(message: OccupancyGrid) -> MapFile:
    """Return the map of a message. Raise Error naming what makes no sense, or where its size and its cells disagree."""
    info = message.info
    cells = np.asarray(message.data, dtype=np.int8)
    if info.width * info.height != cells.size or cells.size == 0:
        raise Error(f"a map of {info.width} x {info.height} cells with {cells.size} values")
    x, y, yaw = corner_of(message).tolist()
    resolution = round(float(info.resolution), 9)  # a float32: 0.05 comes as 0.0500000007
    return MapFile(cells.reshape(info.height, info.width), resolution, (x, y, yaw))


def corner_of(message: OccupancyGrid) -> FloatArray:
    """Return x, y, yaw of a map's corner. Raise Error unless they and its resolution make sense."""
    require("resolution", "info.resolution", message.info.resolution)
    try:
        return planar(message.info.origin)
    except Error as error:
        raise Error(f"info.origin.{error}") from error

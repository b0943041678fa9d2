# SPDX-License-Identifier: BSD-3-Clause
"""map_server: serves a map from its YAML file, with map_server's topics and services."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from urllib.parse import unquote, urlparse

import roslib.packages
import rospkg
import rospy
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap, GetMapResponse, LoadMap, LoadMapRequest, LoadMapResponse

from kurumaisu import program, settings
from kurumaisu._core import frame_of
from kurumaisu.errors import Error, one_line
from kurumaisu.map_file import read_map
from kurumaisu.params import shipped
from kurumaisu.ros import life
from kurumaisu.ros.maps.messages import message_of

_HELP = """
Serve a map from its YAML file, with map_server's topics and services.

publishes:
  map, map_metadata  latched
services:
  static_map         the map
  change_map         serve another one: a file, file:// or package://
parameters:
  frame_id           of the map (default: launch/map_server.yaml)
"""


class MapServer:
    """Publishes map and map_metadata, latched; serves static_map, and change_map, which loads another."""

    def __init__(self, path: Path, frame: str) -> None:
        self._frame = frame
        self._message: OccupancyGrid = _read(path, frame)
        self._map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        self._metadata = rospy.Publisher("map_metadata", MapMetaData, queue_size=1, latch=True)
        self._publish()
        self._services = [
            rospy.Service("static_map", GetMap, lambda _: GetMapResponse(self._message)),
            rospy.Service("change_map", LoadMap, self._on_change),
        ]

    def _publish(self) -> None:
        info = self._message.info
        rospy.loginfo("map: %d x %d cells of %.3f m", info.width, info.height, info.resolution)
        self._map.publish(self._message)
        self._metadata.publish(info)

    def _on_change(self, request: LoadMapRequest) -> LoadMapResponse:
        """Serve another map; keep the one there is when the other cannot be read."""
        response = LoadMapResponse()
        try:
            path = _path_of(request.map_url)
            if not path.is_file():
                response.result = LoadMapResponse.RESULT_MAP_DOES_NOT_EXIST
                raise Error(f"{path}: there is no such file")
            response.result = LoadMapResponse.RESULT_INVALID_MAP_DATA
            self._message = _read(path, self._frame)
        except Error as error:
            rospy.logerr("MAP_SERVER_BAD_MAP: %s", one_line(error))
            return response
        self._publish()
        response.map = self._message
        response.result = LoadMapResponse.RESULT_SUCCESS
        return response


def _read(path: Path, frame: str) -> OccupancyGrid:
    """Return the message of a map's files, and warn of what is odd about them. Raise Error as read_map does."""
    served = read_map(path)
    for words in served.odd:
        rospy.logwarn("MAP_SERVER_ODD_MAP: %s", words)
    return message_of(served, frame, rospy.Time.now())


def _path_of(url: str) -> Path:
    """Return the file of a name, a file:// or a package:// address. Raise Error for another, or no such package."""
    parts = urlparse(url)
    if parts.scheme == "package":
        try:
            return Path(roslib.packages.get_pkg_dir(parts.netloc)) / unquote(parts.path).lstrip("/")
        except (roslib.packages.InvalidROSPkgException, rospkg.ResourceNotFound) as error:
            raise Error(f"{url}: there is no package {parts.netloc}") from error
    if parts.scheme not in ("", "file"):
        raise Error(f"{url}: must be a file, file:// or package://")
    return Path(unquote(parts.path))


def read_settings(given: dict[str, object], where: str) -> str:
    """Return the map's frame of the private parameters; those not given are those of launch/map_server.yaml.

    Raise Error naming the key that is unknown or senseless.
    """
    frame_id = settings.load(shipped("launch/map_server.yaml")).text("frame_id")
    top = settings.Section({"frame_id": frame_id, **given}, where)
    frame = frame_of(top.text("frame_id"))
    top.end()
    return frame


def main() -> int:
    """Serve the map that the first argument names; return 1 when it cannot be read."""
    parser = program.node_parser("map_server", _HELP)
    parser.add_argument("map", type=Path, metavar="FILE.yaml", help="the map")
    options = parser.parse_args(program.words())
    return life.run("map_server", partial(_serve, options.map))


def _serve(path: Path, node: life.Life) -> int:
    server = MapServer(path, read_settings(rospy.get_param("~", {}), rospy.get_name()))
    node.asked.wait()
    del server
    return 0

# SPDX-License-Identifier: BSD-3-Clause
"""map_saver: writes the next map that comes as an image and its YAML file, for map_server."""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import rospy

from kurumaisu import program
from kurumaisu.errors import Error, failed
from kurumaisu.map_file import FREE_BELOW, OCCUPIED_ABOVE, map_pair
from kurumaisu.ros import life
from kurumaisu.ros.maps.messages import GridMessage, map_of
from kurumaisu.whole_files import write_whole

_HELP = """
Save the next map as an image and its YAML file, and end.

subscribes to:
  map  nav_msgs/OccupancyGrid
"""
_GLANCE = 0.02  # [s]


def main() -> int:
    """Save one map; return 1 when none comes, or it cannot be written."""
    parser = program.node_parser("map_saver", _HELP)
    parser.add_argument(
        "-f", dest="name", type=Path, default=Path("map"), metavar="NAME", help="name of the files (map)"
    )
    parser.add_argument(
        "--occ", type=float, default=OCCUPIED_ABOVE, metavar="PERCENT", help="cells above this are walls (65)"
    )
    parser.add_argument(
        "--free", type=float, default=FREE_BELOW, metavar="PERCENT", help="cells below this are free (19.6)"
    )
    parser.add_argument("--png", action="store_true", help="write a .png instead of a .pgm")
    parser.add_argument("--wait", type=float, default=30.0, metavar="SECONDS", help="wait for a map at most (30)")
    options = parser.parse_args(program.words())
    if not 0 <= options.free < options.occ <= 100:
        parser.error(f"--free must be from 0 and below --occ, which is at most 100: {options.free:g}, {options.occ:g}")
    return life.run("map_saver", partial(_save, options), anonymous=True)


def _save(options: argparse.Namespace, node: life.Life) -> int:
    heard: list[Any] = []
    subscriber = rospy.Subscriber("map", GridMessage, heard.append, queue_size=1)
    deadline = time.monotonic() + options.wait
    while not heard and time.monotonic() < deadline:
        if node.asked.wait(_GLANCE):
            return node.code
    subscriber.unregister()
    if not heard:
        print(f"map_saver: {rospy.resolve_name('map')}: no map came within {options.wait:g} s", file=sys.stderr)
        return 1
    try:
        suffix = ".png" if options.png else ".pgm"
        pair = map_pair(map_of(heard[0]), options.name, suffix, options.occ, options.free)
        write_whole(pair)
    except Error as error:
        return failed("map_saver", error)
    print(f"written: {', '.join(map(str, pair))}")
    return 0

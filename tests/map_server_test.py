#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""map_server and map_saver as a launch file and rosrun start them; the map's file is read here by PIL and PyYAML."""

import resource
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import roslib.packages
import rospy
import yaml
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap, LoadMap, LoadMapResponse
from PIL import Image

from kurumaisu.map_file import MapFile, map_pair
from kurumaisu.params import shipped
from kurumaisu.ros.rotation import yaw_of
from kurumaisu.ros.testing.nodes import Topic, wait_for
from kurumaisu.whole_files import write_whole

DEADLINE = 60.0  # [s]
BUILDING = shipped("worlds/maps/building.yaml")


def cells_of(message):
    return np.array(message.data, dtype=np.int8).reshape(message.info.height, message.info.width)


def expected(path):
    """Cells of a trinary map, not by the code under test."""
    said = yaml.safe_load(path.read_text())
    shades = np.asarray(Image.open(path.parent / said["image"]).convert("L")) / 255.0
    occupied = 1 - shades[::-1]
    return np.select([occupied > said["occupied_thresh"], occupied < said["free_thresh"]], [100, 0], -1)


def program(name):
    return roslib.packages.find_node("kurumaisu", name)[0]


def run(*arguments):
    done = subprocess.run([*map(str, arguments)], capture_output=True, text=True, timeout=DEADLINE, check=False)
    return done.returncode, done.stdout + done.stderr


class MapServerTest(unittest.TestCase):
    def test_1_serves_the_map(self):
        message = rospy.wait_for_message("map", OccupancyGrid, DEADLINE)
        assert message.header.frame_id == "map"
        assert np.array_equal(cells_of(message), expected(BUILDING))
        assert message.info.resolution == np.float32(0.05)
        assert (message.info.origin.position.x, message.info.origin.position.y) == (-0.2, -0.2)
        assert rospy.wait_for_message("map_metadata", MapMetaData, DEADLINE) == message.info
        rospy.wait_for_service("static_map", DEADLINE)
        assert rospy.ServiceProxy("static_map", GetMap)().map.data == message.data

    def test_2_saves_and_loads(self):
        maps = Topic("map", OccupancyGrid)
        wait_for(lambda: maps.last, "the first map")
        change = rospy.ServiceProxy("change_map", LoadMap)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            code, said = run(program("map_saver"), "-f", folder / "saved")
            assert code == 0, said
            assert np.array_equal(expected(folder / "saved.yaml"), expected(BUILDING))
            drawn = np.array([[0, 100, -1], [100, 100, 0]], dtype=np.int8)
            pair = map_pair(MapFile(drawn, 0.1, (1.5, -2.5, 0.6)), folder / "turned", ".png", 65, 19.6)
            write_whole(pair)
            _, turned = pair
            answer = change(f"file://{turned}")
            assert answer.result == LoadMapResponse.RESULT_SUCCESS
            new = maps.wait_last(lambda m: m.info.width == 3, "the other map")
            assert cells_of(new).tolist() == drawn.tolist()
            assert abs(yaw_of(new.info.origin.orientation) - 0.6) < 1e-9
            code, said = run(program("map_saver"), "-f", folder / "again", "--png")
            assert code == 0, said
            again = yaml.safe_load((folder / "again.yaml").read_text())
            np.testing.assert_allclose(again["origin"], [1.5, -2.5, 0.6], atol=1e-6)
            assert again["resolution"] == 0.1
            assert expected(folder / "again.yaml").tolist() == drawn.tolist()
            assert change(str(folder / "none.yaml")).result == LoadMapResponse.RESULT_MAP_DOES_NOT_EXIST
            turned.write_text(turned.read_text().replace("negate: 0", "negate: 7"))
            assert change(str(turned)).result == LoadMapResponse.RESULT_INVALID_MAP_DATA
        served = rospy.ServiceProxy("static_map", GetMap)().map
        assert cells_of(served).tolist() == drawn.tolist()  # the one there was
        assert change(f"package://kurumaisu/worlds/maps/{BUILDING.name}").result == LoadMapResponse.RESULT_SUCCESS

    def test_2_a_full_disk_leaves_the_old_pair(self):
        with tempfile.TemporaryDirectory() as name:
            pair = Path(name, "map.pgm"), Path(name, "map.yaml")
            for path in pair:
                path.write_text("old")
            room = 20_000  # [bytes] that a file may have: a disk that is full after so many looks the same
            saver = subprocess.run(
                [program("map_saver"), "-f", str(pair[0].with_suffix(""))],
                capture_output=True,
                text=True,
                timeout=DEADLINE,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
            )
            assert saver.returncode == 1
            assert "map.pgm: cannot be written: File too large" in saver.stderr
            assert [path.read_text() for path in pair] == ["old", "old"]
            assert len(list(Path(name).iterdir())) == 2

    def test_3_what_cannot_be_served_stops_it(self):
        code, said = run(program("map_server"), "/none.yaml", "__name:=bad_server")
        assert code == 1
        assert "/none.yaml: No such file" in said
        rospy.set_param("/bad_server/frame", "map")
        code, said = run(program("map_server"), BUILDING, "__name:=bad_server")
        rospy.delete_param("/bad_server")
        assert code == 1
        assert "/bad_server: frame: is not a known key" in said

    def test_4_a_saver_that_waits_in_vain_says_so(self):
        code, said = run(program("map_saver"), "--wait", "0.5", "map:=no_map")
        assert code == 1
        assert "no_map" in said


if __name__ == "__main__":
    import rostest

    rospy.init_node("map_server_test")
    rostest.rosrun("kurumaisu", "map_server_test", MapServerTest, sys.argv)

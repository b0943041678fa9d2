# SPDX-License-Identifier: BSD-3-Clause
"""How stageros starts, keeps time and ends: bad worlds, two masters at once."""

from __future__ import annotations

import subprocess
import time
import unittest
import xmlrpc.client

import pytest
import roslib.packages
import rosmaster.master
from sensor_msgs.msg import LaserScan
from stageros_rig import ONE, Stageros

from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for


class RealTime(unittest.TestCase):
    def test_ten_hertz_without_g(self):
        """As stage_ros' hztest: 10 +- 2 Hz by the wall's clock."""
        node = Stageros(ONE)
        scan = Topic("base_scan", LaserScan)
        wait_for(lambda: scan.messages, "a scan")

        def rate():
            before, start = len(scan.messages), time.monotonic()
            wait_for(lambda: len(scan.messages) >= before + 20, "20 scans")
            return 20 / (time.monotonic() - start)

        wait_for(lambda: rate() == pytest.approx(10, abs=2), "10 scans a second, when the machine lets it")
        scan.close()
        code, said = node.stop()
        assert code == 0, said
        assert said.count("STAGEROS_NO_WINDOW") == 1
        assert "for a page: roslaunch kurumaisu viewer.launch" in said

    def test_quit_time_ends_the_node(self):
        code, said = Stageros(ONE + "quit_time 3\n", "-g").wait()
        assert code == 0, said
        assert "quit_time 3 s" in said


class BadStarts(unittest.TestCase):
    def refused(self, message, text, *arguments):
        node = Stageros(text, "-g", *arguments)
        code, said = node.wait()
        assert code == 1, said
        assert message.format(node.world) in said
        assert "Traceback" not in said

    def test_bad_world(self):
        self.refused("{}:2:9: ", "model (\n size [1, 1] )\n")

    def test_unknown_value(self):
        self.refused("robot_prefix: must be one of stage, always, never: 'both'", ONE, "_robot_prefix:=both")

    def test_rate_that_does_not_divide(self):
        self.refused("rates: odom: must divide the world's 10 Hz: 3", ONE, "_rates:={odom: 3.0}")

    def test_rate_of_no_sensor(self):
        self.refused(
            "there is no sensor of this name; did you mean base_scan?", ONE, "_rates:={sensors: {base_scam: 5.0}}"
        )

    def test_no_world(self):
        (program,) = roslib.packages.find_node("kurumaisu", "stageros")
        done = subprocess.run([program], capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert (done.returncode, done.stdout) == (255, "usage: stageros [-g] [-u] FILE.world\n")
        missing = subprocess.run([program, "none.world"], capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert missing.returncode == 1
        assert "none.world" in missing.stderr


class TwoMasters(unittest.TestCase):
    def test_each_has_its_own(self):
        masters = [rosmaster.master.Master(port=0) for _ in range(2)]
        nodes = []
        for master in masters:
            master.start()
            nodes.append(Stageros(ONE, "-g", environment={"ROS_MASTER_URI": master.uri}))
        try:
            for master in masters:
                proxy = xmlrpc.client.ServerProxy(master.uri)
                wait_for(lambda proxy=proxy: ["/clock", "rosgraph_msgs/Clock"] in proxy.getTopicTypes("/t")[2], "clock")
        finally:
            outcomes = [node.stop() for node in nodes]
            for master in masters:
                master.stop()
        assert [code for code, _ in outcomes] == [0, 0], outcomes

# SPDX-License-Identifier: BSD-3-Clause
"""replay.launch with viewer:=true: a recording on its own clock, seen as a robot that nobody can command."""

import math
import time

import aiohttp
import numpy as np
import pytest
import rosbag
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from kurumaisu.bench.processes import free_port, master, running
from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.params import load_model, shipped

PATIENCE = 60.0  # [s] of wall time for nodes to come up
START, LONG = 1000.0, 60.0  # [s]
SPEED, RATE = 0.2, 0.1  # [m/s], [rad/s]
BEAMS = 682


def on_circle(t: float) -> tuple[float, float, float]:
    """Return the pose after t [s]."""
    radius, turn = SPEED / RATE, RATE * t
    return radius * math.sin(turn), radius * (1 - math.cos(turn)), turn


def ranges_at(number: int) -> np.ndarray:
    """Return ranges by which a scan tells its number."""
    return (1.0 + 0.001 * number + 0.5 * np.arange(BEAMS) / BEAMS).astype(np.float32)


def write(path) -> None:
    """Write odometry at 20 Hz and scans at 10 Hz."""
    laser = load_model(shipped("launch/md100.yaml")).laser
    with rosbag.Bag(path, "w") as bag:
        for i in range(int(20 * LONG)):
            stamp = rospy.Time.from_sec(START + i / 20)
            odom = Odometry()
            odom.header.stamp, odom.header.frame_id, odom.child_frame_id = stamp, "odom", "base_link"
            x, y, turn = on_circle(i / 20)
            odom.pose.pose.position.x, odom.pose.pose.position.y = x, y
            odom.pose.pose.orientation.z, odom.pose.pose.orientation.w = math.sin(turn / 2), math.cos(turn / 2)
            odom.twist.twist.linear.x, odom.twist.twist.angular.z = SPEED, RATE
            bag.write("odom", odom, stamp)
            if i % 2 == 0:
                scan = LaserScan(angle_min=laser.angle_min, angle_increment=laser.angle_increment)
                scan.range_min, scan.range_max = laser.range_min, laser.range_max
                scan.header.stamp, scan.header.frame_id = stamp, "laser"
                scan.ranges = ranges_at(i // 2)
                bag.write("scan", scan, stamp)


def connected(address: str) -> Page:
    """Return a page as soon as somebody serves one."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return Page(address)
        except (aiohttp.ClientError, OSError):
            assert time.monotonic() < deadline, f"nobody serves {address}"
            time.sleep(0.1)


def test_a_replay_is_seen_where_and_as_it_was_recorded(tmp_path):
    bag, port = tmp_path / "drive.bag", free_port()
    write(bag)
    arguments = [f"bag:={bag}", "base:=recorded", "viewer:=true", f"viewer_port:={port}"]
    with master() as environment, running(["roslaunch", "kurumaisu", "replay.launch", *arguments], None, environment):
        page = connected(f"http://127.0.0.1:{port}/")
        page.wait(lambda: "hello" in page.newest, "a greeting")
        hello = page.newest["hello"]
        assert (hello["mode"], hello["control"], hello["abilities"]) == ("robot", False, [])
        page.wait(lambda: page.newest.get("state", {}).get("poses"), "the chair")
        seen = page.counts["state"]
        page.wait(lambda: page.counts["state"] > seen + 30 and page.counts["scan"] > 5, "that it goes on")
        state, scan = page.newest["state"], next(iter(page.scans.values()))
        page.close()
    t = state["t"] - START
    assert 0 < t < LONG
    x, y, turn = state["poses"]["chair"]
    late = t - turn / RATE  # odometry is as old as the last message, and as a busy computer lets it be
    assert -0.1 < late < 5.0
    assert (x, y) == pytest.approx(on_circle(turn / RATE)[:2], abs=1e-6)
    assert (state["v"], state["w"]) == pytest.approx((SPEED, RATE))
    assert state["truth"] is None
    assert state["estimate"] is None  # nobody localises
    values = np.frombuffer(scan, "<f4", offset=8)
    ranges = values[7 : 7 + BEAMS]
    number = round((float(ranges[0]) - 1.0) / 0.001)
    np.testing.assert_array_equal(ranges, ranges_at(number))
    mount = load_model(shipped("launch/md100.yaml")).laser.mount
    px, py, heading = on_circle(0.1 * number)
    c, s = math.cos(heading), math.sin(heading)
    laser = px + c * mount.x - s * mount.y, py + s * mount.x + c * mount.y
    assert math.dist(values[:2], laser) < SPEED * 5.0  # laid by the poses that were known when it came

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""mapping_node as slam.launch starts it: slam_gmapping's contract, and what may go wrong, in a room made here."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
import unittest
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import roslib.packages
import rospy
import rostest
import tf2_msgs.msg
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from kurumaisu.msg import Trajectory
from kurumaisu.srv import StateFile
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from nav_msgs.srv import GetMap
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from kurumaisu.geometry import between, compose, wrap
from kurumaisu.map_file import read_map
from kurumaisu.ros.maps.messages import map_of
from kurumaisu.ros.rotation import yaw_of
from kurumaisu.ros.testing.nodes import Topic, unexplained, wait_for
from kurumaisu.ros.testing.room import BEAMS, SPEED_ERROR, STEP, WALLS, Room, ranges_at, truth
from kurumaisu.slam_score import distance_to_walls

DEADLINE = 40.0  # [s] of the wall clock, for any one thing to happen
NODE = "/mapping_node/"


def pose_of(transform):
    t, q = transform.transform.translation, transform.transform.rotation
    return np.array([t.x, t.y, 2 * np.arctan2(q.z, q.w)])


class MappingNode(unittest.TestCase):
    """What slam.launch has started; every test begins anew by setting the clock back."""

    @classmethod
    def setUpClass(cls):
        cls.room = Room(20000.0)
        cls.diagnostics = Topic("/diagnostics", DiagnosticArray)
        cls.maps = Topic("map", OccupancyGrid)
        cls.room.wait_for_subscribers(2)  # this node and the one beside it
        cls.transforms = Topic("/tf", tf2_msgs.msg.TFMessage)  # last: it would count as one of them

    def setUp(self):
        self.room.begin_anew()
        wait_for(lambda: not self.mapped(), "a new beginning", DEADLINE)
        self.origin = compose(self.room.odom, between(truth(0), np.zeros(3)))  # map_from_room

    @staticmethod
    def mapped():
        try:
            return rospy.ServiceProxy("dynamic_map", GetMap)().map
        except rospy.ServiceException:
            return None

    def own_maps(self):
        return self.room.of_this_test(self.maps.messages)

    def map_from_odom(self):
        sent = [t for m in list(self.transforms.messages) for t in m.transforms if t.header.frame_id == "map"]
        return self.room.of_this_test(sent)

    def status(self, node="mapping_node"):
        for array in reversed(self.diagnostics.messages):
            for status in array.status:
                if status.name == f"{node}: mapping":
                    return status
        return None

    def says(self, words):
        status = self.status()
        return status and words in status.message

    def wait_for_status(self, level, words):
        said = set()

        def matches():
            status = self.status()
            if status:
                said.add(f"{status.level} {status.message}")
            return status and status.level == level and words in status.message

        try:
            wait_for(matches, "", DEADLINE)
        except AssertionError as error:
            raise AssertionError(f"no diagnostics of level {level} with {words!r} but {said}") from error

    def values(self, node="mapping_node"):
        return {item.key: item.value for item in self.status(node).values}

    def odom_at(self, t):
        """Odometry at the last scan, whose time is t."""
        return compose(self.room.odom, between(truth(t + STEP), truth(t)) * SPEED_ERROR)

    def wait_for_pose(self, t, distance=0.05, turn=0.02):
        expected, odom = compose(self.origin, truth(t)), self.odom_at(t)

        def close():
            sent = self.map_from_odom()
            if not sent:
                return False
            error = between(expected, compose(pose_of(sent[-1]), odom))
            return bool(np.hypot(*error[:2]) < distance and abs(wrap(error[2])) < turn)

        wait_for(close, f"map -> odom that puts the chair at {expected}", DEADLINE)

    def check_map(self, grid):
        """Assert that the walls of a map are the room's."""
        cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
        assert set(np.unique(cells)) <= {-1, 0, 100}
        rows, columns = np.nonzero(cells == 100)
        corner = np.array([grid.info.origin.position.x, grid.info.origin.position.y])
        points = corner + (np.stack([columns, rows], axis=-1) + 0.5) * grid.info.resolution
        room_from_map = between(self.origin, np.zeros(3))
        off = distance_to_walls(compose(room_from_map, np.column_stack([points, np.zeros(len(points))]))[:, :2], WALLS)
        assert len(off) > 300
        assert (off < 0.1).mean() > 0.98, np.sort(off)[-20:]

    @contextmanager
    def second_node(self, mapper=None, **parameters):
        """Start another one on the same scans, without tf; yield the process."""
        rospy.set_param(
            "/second/mapping_node", {"node": {"transform_period": 0.0, **parameters}, "mapper": mapper or {}}
        )
        program = roslib.packages.find_node("kurumaisu", "mapping_node")[0]
        arguments = ["__ns:=/second", "scan:=/scan", "static_map:=/dynamic_map", "/diagnostics:=/second/diagnostics"]
        before = self.room.connections()
        process = subprocess.Popen([program, *arguments])
        try:
            self.room.wait_for_another(before)
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(DEADLINE) == 0
            rospy.delete_param("/second")

    def test_help_names_all_that_the_node_has(self):
        assert unexplained("/mapping_node", "mapping_node") == set()

    def test_1_map_and_pose(self):
        last = self.room.drive(20.0)
        self.wait_for_pose(last)
        drift = between(compose(self.origin, truth(last)), self.odom_at(last))
        assert np.hypot(*drift[:2]) > 0.1  # odometry alone would not do
        self.room.at(last + 0.5)
        wait_for(
            lambda: abs(self.room.time_of(self.map_from_odom()[-1]) - last - 0.6) < 1e-3,
            "map -> odom stamped transform_tolerance ahead",
            DEADLINE,
        )
        served = self.mapped()
        assert served.header.frame_id == "map"
        assert abs(served.info.resolution - 0.05) < 1e-6
        self.check_map(served)
        wait_for(lambda: self.own_maps() and self.own_maps()[-1].info.width == served.info.width, "/map", DEADLINE)
        assert rospy.wait_for_message("map_metadata", MapMetaData, DEADLINE).width == served.info.width
        self.check_path(last)
        self.wait_for_status(0, "mapping; deviation")
        assert float(self.values()["processor time per scan [ms]"]) < 50
        self.check_stock()
        self.check_saved()

    def check_path(self, last):
        paths = Topic("trajectory", PathMessage)
        wait_for(lambda: paths.last and len(paths.last.poses) > 20, "the whole trajectory", DEADLINE)
        path = paths.last
        assert path.header.frame_id == "map"
        assert last - self.room.time_of(path.poses[-1]) < 1.5
        for point in path.poses:
            expected = compose(self.origin, truth(self.room.time_of(point)))
            assert np.hypot(point.pose.position.x - expected[0], point.pose.position.y - expected[1]) < 0.06
        sure = rospy.wait_for_message(NODE + "trajectory_with_covariance", Trajectory, DEADLINE)
        assert len(sure.poses) == len(path.poses)
        assert all(0 <= point.pose.covariance[0] < 0.01 for point in sure.poses)
        pose = rospy.wait_for_message(NODE + "pose", PoseWithCovarianceStamped, DEADLINE)
        assert pose.pose.covariance[0] > 0
        assert self.room.time_of(pose) > last - 1.5
        cloud = rospy.wait_for_message("particlecloud", PoseArray, DEADLINE)
        assert len(cloud.poses) == 30
        assert 0 < rospy.wait_for_message(NODE + "entropy", Float64, DEADLINE).data <= np.log(30) + 1e-9

    def check_stock(self):
        """A launch file of slam_gmapping of which only package and type were changed."""
        grid = rospy.wait_for_message("stock/map", OccupancyGrid, DEADLINE)
        assert abs(grid.info.resolution - 0.1) < 1e-6
        assert grid.info.width > 50
        assert len(rospy.wait_for_message("stock/particlecloud", PoseArray, DEADLINE).poses) == 5
        unused = [item.value for item in self.status("stock/slam_gmapping").values if item.key == "not used"]
        assert sorted(unused) == ["sigma", "xmin"]
        assert rospy.get_param("/stock/slam_gmapping/mapper/localise_time") == 0

    def check_saved(self):
        save = rospy.ServiceProxy(NODE + "save_map", StateFile)
        with tempfile.TemporaryDirectory() as folder:
            answer = save(f"{folder}/room")
            assert answer.success, answer.message
            served = map_of(self.mapped())
            pair = read_map(Path(folder) / "room.yaml")
            np.testing.assert_array_equal(pair.cells, served.cells)
            np.testing.assert_allclose(pair.origin, served.origin, atol=1e-9)
            assert pair.resolution == 0.05
            assert (Path(folder) / "room.simplemap").stat().st_size > 1000
            assert sorted(p.name for p in Path(folder).iterdir()) == ["room.pgm", "room.simplemap", "room.yaml"]
            self.go_on_from(f"{folder}/room.simplemap", Path(folder) / "again")
            self.go_on_from("static_map", Path(folder) / "once_more")
        for path, words in (("/proc/none/map", "/proc/none/map.pgm: cannot be written: No such file"), ("", "file: ")):
            answer = save(path)
            assert not answer.success
            assert words in answer.message, answer.message

    def go_on_from(self, start_map, saved):
        """Start a second node where the chair is now, a bit wrong, and let it drive on; stop it: it saves its map."""
        served = self.mapped()
        at = compose(compose(self.origin, truth(20.0)), np.array([0.15, -0.1, 0.05]))
        start = {"x": float(at[0]), "y": float(at[1]), "theta": float(at[2])}
        with self.second_node(start_map=start_map, start=start, save_on_shutdown=str(saved)):
            poses = Topic("/second/mapping_node/pose", PoseWithCovarianceStamped)
            first = wait_for(self.second_map, "its map", DEADLINE)
            assert first.info.width >= served.info.width - 1
            wait_for(lambda: poses.is_published, "its poses", DEADLINE)
            last = self.room.drive(3.0, first=20.0)
            late = wait_for(
                lambda: next((m for m in poses.messages if self.room.time_of(m) > last - 1.0), None), "pose", DEADLINE
            )
            expected = compose(self.origin, truth(self.room.time_of(late)))
            found = late.pose.pose
            assert np.hypot(found.position.x - expected[0], found.position.y - expected[1]) < 0.08
            assert abs(wrap(yaw_of(found.orientation) - expected[2])) < 0.03
            poses.close()
        assert read_map(saved.with_suffix(".yaml")).cells.shape[1] >= served.info.width - 1
        assert saved.with_suffix(".simplemap").exists()

    @staticmethod
    def second_map():
        try:
            return rospy.wait_for_message("/second/map", OccupancyGrid, 1.0)
        except rospy.ROSException:
            return None

    def test_2_starts_afresh_when_the_clock_is_set_back(self):
        self.room.drive(1.0)
        self.room.at(1.0)
        wait_for(self.own_maps, "a map of the new time", DEADLINE)
        wait_for(self.map_from_odom, "map -> odom of the new time", DEADLINE)
        # This second's drift, not that of the 20 s before.
        x, y, theta = pose_of(self.map_from_odom()[-1])
        np.testing.assert_allclose([x, y, wrap(theta)], np.zeros(3), atol=0.05)

    def test_3_scans_without_transforms_are_counted_and_said(self):
        def counted():  # a scan waits for its transform before it is dropped
            return self.says("scans come, but") and int(self.values()["dropped without transform"]) > 0

        self.room.step_until(counted, "scans without tf said and counted", DEADLINE, with_tf=False)
        # "tf has no odom -> base_link", unless a transform of the time before came late
        self.wait_for_status(2, "MAPPING_NO_TRANSFORM: scans come, but no odometry")
        self.wait_for_status(2, "MAPPING_NO_SCAN")

    def test_4_a_laser_that_nobody_has_placed_is_said(self):
        self.room.step_until(
            lambda: self.says("the mounting of the laser is unknown"),
            "a laser without a place said",
            DEADLINE,
            frame="nowhere",
        )
        self.wait_for_status(2, "MAPPING_NO_TRANSFORM: scans come, but the mounting of the laser is unknown")

    def test_4_a_clock_that_stands_while_scans_come_is_said(self):
        last = self.room.drive(1.0)

        def said():
            self.room.scan.publish(self.room.sweep(last, rospy.Time.from_sec(self.room.begin + last)))
            time.sleep(0.05)
            return self.says("MAPPING_NO_CLOCK: /use_sim_time is true, and scans come, but nothing on /clock")

        wait_for(said, "a clock that stands said", DEADLINE)

    def test_5_scans_without_transforms_do_not_stop_the_others(self):
        self.room.step(0.0, with_tf=False)
        self.room.odom = np.array([1.0, 2.0, 0.5])
        self.room.drive(1.0, first=STEP)  # tf's own listener may notice the jump back late, and forget the first ones
        wait_for(self.own_maps, "a map from the scans that have transforms", DEADLINE)
        assert self.room.time_of(self.own_maps()[0]) > STEP / 2

    def test_6_nonsense_is_dropped_and_the_rest_used(self):
        t = self.room.drive(1.0)
        for i, bad in enumerate(
            ([], [1.0], [float("nan")] * BEAMS, [float("inf")] * BEAMS, [-1.0] * BEAMS, [0.0] * BEAMS)
        ):
            self.room.step(t + (i + 1) * STEP, ranges=bad)
        self.wait_for_status(1, "MAPPING_")
        self.wait_for_pose(self.room.drive(3.0, first=t + 7 * STEP), 0.08, 0.03)

    def test_6_stamps_of_another_time_are_counted_and_the_map_stays(self):
        t = self.room.drive(3.0)
        for i in range(3):
            self.room.of_another_time(t)
            t = self.room.drive(1.0, first=t + STEP, frame="/laser" if i else "laser")
        self.wait_for_pose(t)
        for key, least in (("dropped as too old", 3), ("refused transforms", 9), ("dropped as senseless", 6)):
            wait_for(lambda key=key, least=least: int(self.values()[key]) >= least, f"{least} {key}", DEADLINE)
        paths = Topic("trajectory", PathMessage)
        wait_for(lambda: paths.last and self.room.time_of(paths.last.poses[0]) < 1.0, "the whole trajectory", DEADLINE)
        paths.close()

    def test_6_a_second_laser_whose_clock_is_behind_changes_nothing(self):
        old = int(self.values()["dropped as too old"])
        unset = int(self.values()["dropped as senseless"])
        t = self.room.drive(1.0)
        for _ in range(30):
            t += STEP
            self.room.step(t)
            for behind in (1.5, 1.45, 1.4, 0.05):
                self.room.scan.publish(self.room.sweep(t, rospy.Time.from_sec(self.room.begin + t - behind)))
            self.room.scan.publish(self.room.sweep(t, rospy.Time(0)))
            time.sleep(0.1)  # all of it takes longer than old scans alone may
        self.wait_for_pose(t)
        wait_for(lambda: int(self.values()["dropped as too old"]) >= old + 120, "all of them counted", DEADLINE)
        assert int(self.values()["dropped as senseless"]) >= unset + 30
        paths = Topic("trajectory", PathMessage)
        wait_for(lambda: paths.last and self.room.time_of(paths.last.poses[0]) < 1.0, "the whole trajectory", DEADLINE)
        paths.close()

    def test_6_old_scans_alone_begin_anew(self):
        self.room.drive(2.0)
        wait_for(self.mapped, "a map", DEADLINE)

        def gone():
            self.room.scan.publish(self.room.sweep(0.0, rospy.Time.from_sec(self.room.begin - 5.0)))
            time.sleep(0.1)
            return not self.mapped()

        wait_for(gone, "a new beginning", DEADLINE)

    def test_7_a_laser_upside_down_and_yawed(self):
        mount = np.array([-0.1, 0.2, 2.0])
        self.room.place_laser("under_the_seat", mount, upside_down=True)
        times = np.arange(0, 6.0, STEP)
        for t in times:
            self.room.step(float(t), frame="under_the_seat", ranges=ranges_at(truth(t), mount, turn=-1))
            time.sleep(0.02)
        self.wait_for_pose(float(times[-1]))

    def test_8_an_odometry_jump_is_said_and_not_believed(self):
        self.room.drive(3.0)
        self.room.odom = compose(np.array([5.0, -3.0, 1.0]), self.room.odom)
        last = self.room.drive(2.0, first=3.0)
        self.wait_for_pose(last)
        self.wait_for_status(1, "MAPPING_ODOMETRY_JUMP")
        assert int(self.values()["jumps of odometry"]) > 0

    def test_9_pause_resume_and_reset(self):
        def call(name):
            return rospy.ServiceProxy(NODE + name, Trigger)().success

        self.room.drive(2.0)
        wait_for(self.own_maps, "a map", DEADLINE)
        assert call("pause")
        self.room.drive(2.0, first=2.0)
        self.wait_for_status(1, "MAPPING_PAUSED")
        used = self.values()["scans"]
        assert call("resume")
        last = self.room.drive(2.0, first=4.0)
        self.wait_for_pose(last)
        wait_for(lambda: int(self.values()["scans"]) > int(used), "scans in use", DEADLINE)
        assert call("reset")
        assert not self.mapped()
        self.origin = compose(self.room.odom, between(truth(last + STEP), np.zeros(3)))
        self.wait_for_pose(self.room.drive(2.0, first=last + STEP))

    def test_a_when_too_slow_it_skips_scans_and_says_so(self):
        diagnostics = Topic("/second/diagnostics", DiagnosticArray)

        def said():
            return [
                s.message for m in diagnostics.messages for s in m.status if s.name == "second/mapping_node: mapping"
            ]

        with self.second_node(mapper={"particles": 1000, "insert_distance": 0.2}):
            wait_for(said, "its diagnostics", DEADLINE)
            for i in range(80):  # a burst
                self.room.step(i * STEP)
            try:
                wait_for(lambda: any("MAPPING_TOO_SLOW" in each for each in said()), "skipped scans", DEADLINE)
            except AssertionError as error:
                raise AssertionError(f"not too slow: {set(said())}") from error
            poses = Topic("/second/mapping_node/pose", PoseWithCovarianceStamped)
            wait_for(lambda: poses.is_published, "its poses", DEADLINE)
            last = self.room.drive(1.0, first=80 * STEP)
            wait_for(lambda: poses.last and self.room.time_of(poses.last) > last - 1.5, "its pose", DEADLINE)
            pose = poses.last.pose.pose.position
            expected = compose(self.origin, truth(self.room.time_of(poses.last)))
            assert np.hypot(pose.x - expected[0], pose.y - expected[1]) < 0.15
            poses.close()
        diagnostics.close()

    def test_b_bad_configuration_stops_it(self):
        good = rospy.get_param("/mapping_node")
        node = roslib.packages.find_node("kurumaisu", "mapping_node")[0]
        for section, key, value, message in (
            ("mapper", "particles", 0, "/bad_mapping/mapper: particles: must be 1 to 10000: 0"),
            ("mapper", "partciles", 30, "/bad_mapping/mapper/partciles: is not a known key"),
            ("node", "map_frame", 3, "/bad_mapping/node/map_frame: must be a string"),
            ("node", "start_map", "/none.simplemap", "/none.simplemap: cannot be read"),
            (None, "partciles", 30, "/bad_mapping/partciles: is not a known key"),
            (None, "delta", "fine", "/bad_mapping/mapper/resolution: must be a number"),
        ):
            bad = {name: dict(values) for name, values in good.items()}
            (bad[section] if section else bad)[key] = value
            rospy.set_param("/bad_mapping", bad)
            done = subprocess.run(
                [node, "__name:=bad_mapping"], capture_output=True, text=True, timeout=DEADLINE, check=False
            )
            rospy.delete_param("/bad_mapping")
            assert done.returncode == 1
            assert "[FATAL]" in done.stderr
            assert message in done.stderr, done.stderr


if __name__ == "__main__":
    rospy.init_node("mapping_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "mapping_node_test", MappingNode, sys.argv)

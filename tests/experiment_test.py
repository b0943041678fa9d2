#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""critic experiment on the simulated chair: what it publishes, records, refuses, and how it stops."""

import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rosgraph
import rospy
import yaml
from geometry_msgs.msg import Point, Pose, Twist
from kurumaisu.srv import SetPose
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.experiments import samples, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.testing.nodes import PATIENCE, Commander, Topic, wait_for

SLOW = {
    "kind": "drive",
    "good_for": "a test",
    "world": "hall.world",
    "box": {"ahead": 4.0, "behind": 1.0, "left": 1.0, "right": 1.0},
    "limits": {"v_forward": 0.3, "v_reverse": 0.1, "w": 0.1},
    "repeat": 1,
    "phases": [
        {"seconds": 10.0, "v": 0.2, "w": 0.0, "ramp": 0.0},
        {"seconds": 0.5, "v": 0.0, "w": 0.0, "ramp": 0.0},
    ],
}
PLACES = {
    "kind": "places",
    "good_for": "a test",
    "world": "hall.world",
    "box": {"ahead": 2.0, "behind": 2.0, "left": 2.0, "right": 2.0},
    "places": [{"x": 0.0, "y": 0.0, "yaw": 0.0, "seconds": 1.0}, {"x": 1.0, "y": -0.5, "yaw": 2.0, "seconds": 1.0}],
}


class Experiment(unittest.TestCase):
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.truth, self.commands = Topic("ground_truth", Odometry), Topic("experiment_vel", Twist)
        self.addCleanup(self.truth.close)
        self.addCleanup(self.commands.close)
        self.put(0.0, 0.0, 0.0)

    def put(self, x, y, heading):
        rospy.wait_for_service("set_pose", PATIENCE)
        self.truth.wait(lambda m: m.twist.twist.linear.x == 0 and m.twist.twist.angular.z == 0, "rest")
        pose = Pose(position=Point(x, y, 0.0), orientation=quaternion_of(heading))
        assert rospy.ServiceProxy("set_pose", SetPose)(name="chair", pose=pose).success

    def start(self, name, *options, script=None):
        if script is not None:
            path = self.folder / f"{name}.yaml"
            path.write_text(yaml.safe_dump(script))
            options = (*options, "--file", str(path))
        program = "import sys; from kurumaisu.ros.experiment.command import main; sys.exit(main())"
        command = [sys.executable, "-c", program, name, *options]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(lambda: process.poll() is None and process.kill())
        return process

    def end(self, process, code):
        said, _ = process.communicate(timeout=2 * PATIENCE)
        assert process.returncode == code, said
        assert "Traceback" not in said
        return said

    def driving(self, process):
        since = len(self.commands.messages)

        def has_begun():
            assert process.poll() is None, process.communicate()[0]
            return any(m.linear.x > 0 for m in self.commands.messages[since:])

        wait_for(has_begun, "driving")

    def stopped_properly(self):
        """Zero is the last thing said, for a second of simulated time; then nothing; the chair rests."""
        wait_for(lambda: not self.commands.is_published, "the last word")
        assert all(m.linear.x == 0 and m.angular.z == 0 for m in self.commands.messages[-30:])
        self.truth.wait(lambda m: m.twist.twist.linear.x == 0, "rest")

    def test_two_experiments_are_recorded_as_the_critic_wants_them(self):
        for name in ("spin_both_ways", "forward_reverse_turns"):
            said = self.end(self.start(name, "--bag", str(self.folder / "bags" / f"{name}.bag")), 0)
            assert "done" in said
        recording = read_recording(self.folder / "bags")
        assert not recording.invalid
        for run in recording.runs:
            asked = samples(shipped_script(run.name).phases, PERIOD)
            wanted = {tuple(np.round(row, 6)) for row in asked[:, 1:]}
            heard = {tuple(np.round(row, 6)) for row in run.command.values}
            assert heard <= wanted
            assert len(heard) > 0.8 * len(wanted)
            assert np.median(np.diff(run.command.t)) < 0.03
            seconds = run.command.t[-1] - run.command.t[0]
            assert abs(seconds - asked[-1, 0] - 1.0) < 0.3  # and a second of zero
            assert len(run.voltage.t) > 40 * seconds
            assert len(run.pose.t) > 15 * seconds
        spin = recording.runs[1].pose.values[:, 2]
        assert 4.0 < np.ptp(spin) < 5.2

    def test_ctrl_c_and_kill_stop_the_chair(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            process = self.start("slow", script=SLOW)
            self.driving(process)
            process.send_signal(number)
            assert "slow: interrupted" in self.end(process, 1)
            self.stopped_properly()

    def test_rosnode_kill_stops_the_chair(self):
        process = self.start("slow", "__name:=victim", script=SLOW)
        self.driving(process)
        subprocess.run(["rosnode", "kill", "/victim"], check=True, capture_output=True, timeout=30)
        assert "slow: interrupted" in self.end(process, 1)
        self.stopped_properly()
        assert "/victim" not in str(rosgraph.Master("/experiment_test").getSystemState())

    def silent_for(self, seconds):
        """Wait until nothing has been heard for so long."""
        count, since = len(self.commands.messages), time.monotonic()

        def is_silent():
            nonlocal count, since
            if len(self.commands.messages) > count:
                count, since = len(self.commands.messages), time.monotonic()
            return time.monotonic() - since > seconds

        wait_for(is_silent, "silence")

    def test_nothing_is_published_while_time_stands(self):
        pause = rospy.ServiceProxy("pause", SetBool)
        process = self.start("slow", script=SLOW)
        self.driving(process)
        assert pause(True).success
        self.silent_for(1.0)  # what was under way arrives
        count = len(self.commands.messages)
        rospy.rostime.wallsleep(2.0)
        assert len(self.commands.messages) == count
        assert process.poll() is None
        assert pause(False).success
        self.driving(process)
        process.send_signal(signal.SIGINT)
        self.end(process, 1)

    def test_who_commands_too_stops_it_and_keeps_it_from_starting(self):
        process = self.start("slow", script=SLOW)
        self.driving(process)
        other = Commander("experiment_vel")
        self.addCleanup(other.close)
        other.say(0.0, 0.0)
        assert "also commands the chair" in self.end(process, 1)
        other.silence()
        assert "experiment_vel is published already" in self.end(self.start("slow", script=SLOW), 1)

    def test_a_chair_that_drives_is_left_alone(self):
        program = (
            "from kurumaisu.ros.testing.nodes import *; rospy.init_node('pusher'); Commander('cmd_vel').say(0.1, 0.2)"
        )
        with subprocess.Popen([sys.executable, "-c", f"{program}; rospy.spin()"]) as pusher:
            try:
                self.truth.wait(lambda m: m.twist.twist.linear.x > 0, "the chair to move")
                assert "navigation also commands the chair" in self.end(self.start("slow", script=SLOW), 1)
            finally:
                pusher.terminate()  # a killed one would stay on the books of the master

    def test_the_joystick_takes_over(self):
        process = self.start("slow", script=SLOW)
        self.driving(process)
        hand = Commander("joy_vel")
        self.addCleanup(hand.close)
        hand.say(0.0, 0.1)
        assert "joystick also commands the chair" in self.end(process, 1)
        hand.silence()
        self.stopped_properly()

    def test_a_wall_in_the_way_is_seen_beforehand(self):
        self.put(27.0, 0.0, 0.0)
        count = len(self.commands.messages)
        assert "not enough space here" in self.end(self.start("slow", script=SLOW), 1)
        assert len(self.commands.messages) == count

    def test_a_wall_that_the_world_file_does_not_have_stops_it(self):
        self.put(28.5, 0.0, 0.0)
        assert "the chair touches something" in self.end(self.start("slow", "--world", "none", script=SLOW), 1)
        self.stopped_properly()

    def test_a_chair_that_is_carried_away_stops_it(self):
        process = self.start("slow", script=SLOW)
        self.driving(process)
        pose = Pose(position=Point(0.0, 5.0, 0.0), orientation=quaternion_of(0.0))
        assert rospy.ServiceProxy("set_pose", SetPose)(name="chair", pose=pose).success
        assert "left the box" in self.end(process, 1)
        self.stopped_properly()

    def test_voltages_are_left_to_the_base_where_there_is_one(self):
        assert "voltages is published already, by /base_node" in self.end(self.start("steering_sweep"), 1)

    def test_places_are_visited_one_bag_each(self):
        count = len(self.commands.messages)
        self.end(self.start("places", "--bag", str(self.folder / "bags"), script=PLACES), 0)
        assert len(self.commands.messages) == count
        runs = read_recording(self.folder / "bags").runs
        assert [run.name for run in runs] == ["place_1", "place_2"]
        for run, pose in zip(runs, ((0.0, 0.0, 0.0), (1.0, -0.5, 2.0)), strict=True):
            assert np.allclose(run.pose.values, pose, atol=1e-6)
            assert run.command is None
            assert run.scan.t[-1] - run.scan.t[0] > 0.7

    def test_a_bad_script_is_named(self):
        said = self.end(self.start("slow", script={**SLOW, "spede": 1}), 1)
        assert "slow.yaml: spede: is not a known key" in said
        assert "'waltz' is not an experiment" in self.end(self.start("waltz"), 1)


if __name__ == "__main__":
    import rostest

    rospy.init_node("experiment_test")
    wait_for(lambda: rospy.get_time() > 0, "the clock")
    rostest.rosrun("kurumaisu", "experiment_test", Experiment, sys.argv)

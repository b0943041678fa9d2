# SPDX-License-Identifier: BSD-3-Clause
"""robot.launch against a virtual laser and a virtual D/A board at pseudo-terminals, with nothing else changed."""

import subprocess
import sys

import pytest
import yaml

from kurumaisu.bench.guard_rig import Rig
from kurumaisu.bench.processes import master, program, running
from kurumaisu.ros.testing.nodes import wait_for

PATIENCE = 60.0  # [s] of wall time for anything to come about


def heard(topic, environment, *options):
    """Return the next message on a topic as YAML has it."""
    command = ["rostopic", "echo", "-n", "1", *options, topic]
    text = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=True).stdout
    return yaml.safe_load(text.split("---")[0])


def statuses(environment):
    return {status["name"]: status["message"] for status in heard("/diagnostics_agg", environment)["status"]}


def volts(rig):
    """Return V_f and V_s as the board last put them out, or None before it did [V]."""
    lines = [
        line.split() for line in (rig.folder / "board.log").read_text().splitlines(keepends=True) if line[-1] == "\n"
    ]
    found = [words for words in lines if len(words) == 5 and words[1] == "volts"]
    return (float(found[-1][2]), float(found[-1][3])) if found else None


@pytest.fixture
def chair(tmp_path):
    """Start all of it; yield the board and the environment of those who are to find the master."""
    rig = Rig(tmp_path)
    laser = [sys.executable, program("virtual_urg"), "--pty", str(tmp_path / "urg"), "--wall", "1.5"]
    arguments = ["dac:=guard", f"device:={rig.device}", f"guard:={rig.settings}", f"laser_port:={tmp_path / 'urg'}"]
    with rig.board(), running(laser, tmp_path / "urg.log"), master() as environment:
        environment = environment | {"ROS_LOG_DIR": str(tmp_path / "ros_log")}
        command = ["roslaunch", "kurumaisu", "robot.launch", *arguments]
        with running(command, tmp_path / "robot.log", environment):
            yield rig, environment
        assert rig.neutral(5.0) is not None  # the last word, after everything was stopped while it drove


def twist(v, w):
    return f"{{linear: {{x: {v}}}, angular: {{z: {w}}}}}"


def test_a_command_becomes_volts_at_the_board(chair, tmp_path):
    rig, environment = chair
    wait_for(lambda: volts(rig) is not None, "the board is spoken to", PATIENCE)
    assert heard("/scan", environment, "--noarr")["header"]["frame_id"] == "laser"
    publish = ["rostopic", "pub", "-r", "20", "/cmd_vel", "geometry_msgs/Twist"]
    with running([*publish, twist(0.0, 0.0)], tmp_path / "zero.log", environment):
        wait_for(
            lambda: "armed" in statuses(environment).get("/chair/guard/base_node: guard", ""),
            "the guard is armed",
            PATIENCE,
        )
        assert volts(rig) == pytest.approx((0.0, 0.0), abs=0.002)
    with running([*publish, twist(0.5, 0.3)], tmp_path / "drive.log", environment):
        asked = pytest.approx((0.789916, -0.045582), abs=0.002)
        wait_for(lambda: volts(rig) == asked, "(1) and (2) at the board", PATIENCE)
        odom = heard("/odom", environment)
        assert odom["twist"]["twist"]["linear"]["x"] == pytest.approx(0.5, abs=0.01)
        said = statuses(environment)
        assert {"/chair/base", "/chair/laser", "/chair/guard"} <= set(said)
        assert {said[name] for name in ("/chair/laser", "/chair/guard")} <= {"OK", "Warning"}  # not stale
        frames = heard("/tf_static", environment)["transforms"]
        assert {frame["child_frame_id"] for frame in frames} == {"laser", "imu_link"}
        # and now everything is stopped in the middle of it

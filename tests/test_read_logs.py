# SPDX-License-Identifier: BSD-3-Clause
"""Logs of CARMEN, and trajectories as tables: what their formats' descriptions say, and faults by line."""

import numpy as np
import pytest
from recordings import series
from scipy.spatial.transform import Rotation

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error

OLD = """\
# CARMEN Logfile
PARAM robot_frontlaser_offset 0.1
ODOM 1.0 2.0 0.5 0.3 0.1 0.0 976052857.1 robot 0.1
FLASER 4 1.5 2.5 81.91 0.0 1.1 2.0 0.5 1.0 2.0 0.5 976052857.15 robot 0.15
ODOM 1.03 2.0 0.51 0.3 0.1 0.0 976052857.2 robot 0.2
FLASER 4 1.4 2.4 3.0 0.5 1.1 2.0 0.5 1.03 2.0 0.51 976052857.25 robot 0.25
"""
NEW = """\
ROBOTLASER1 0 -2.0 4.0 2.0 30.0 0.01 0 3 1.5 30.0 2.5 1 9 0.7 2.0 1.5 0.5 2.0 1.5 0 0 0 0 0 5.0 robot 0
TRUEPOS 0.6 2.1 0.1 0.5 2.0 0.1 5.0 robot 0.0
ROBOTLASER1 0 -2.0 4.0 2.0 30.0 0.01 0 3 1.6 30.0 2.5 0 0.7 2.1 1.57 0.5 2.1 1.57 0 0 0 0 0 5.1 robot 0
TRUEPOS 0.6 2.2 0.1 0.5 2.1 0.1 5.1 robot 0.0
ROBOTLASER1 0 -2.0 4.0 1.0 30.0 0.01 0 2 1.6 30.0 0 0.7 2.1 1.57 0.5 2.1 1.57 0 0 0 0 0 5.2 robot 0
"""


def test_an_old_log_of_carmen_is_odometry_and_scans(tmp_path):
    (tmp_path / "drive.log").write_text(OLD)
    recording = read_recording(tmp_path / "drive.log")
    (run,) = recording.runs
    assert run.odom.t.tolist() == [976052857.1, 976052857.2]
    assert run.odom.values.tolist() == [[1.0, 2.0, 0.5, 0.3, 0.1], [1.03, 2.0, 0.51, 0.3, 0.1]]
    np.testing.assert_array_equal(run.scan.values, [[1.5, 2.5, np.inf, np.nan], [1.4, 2.4, 3.0, 0.5]])
    assert (run.fan.angle_min, run.fan.angle_increment, run.fan.beams) == (-np.pi / 2, np.pi / 4, 4)


def test_a_new_log_of_carmen_has_its_laser_s_fan_and_mounting_and_a_true_pose(tmp_path):
    (tmp_path / "drive.clf").write_text(NEW)
    recording = read_recording(tmp_path)
    (run,) = recording.runs
    assert run.pose.values.tolist() == [[0.6, 2.1, 0.1], [0.6, 2.2, 0.1]]
    assert run.odom.column("x").tolist() == [0.5, 0.5, 0.5]
    np.testing.assert_array_equal(run.scan.values, [[1.5, np.inf, 2.5], [1.6, np.inf, 2.5]])
    mount = recording.laser
    np.testing.assert_allclose((mount.x, mount.y, mount.yaw), (0.2 * np.cos(1.5), -0.2 * np.sin(1.5), 0), atol=1e-9)
    assert (mount.angle_min, mount.angle_increment, mount.beams) == (-2.0, 2.0, 3)
    assert "drive.clf: 1 scans dropped: they have other beams than the first" in recording.problems


@pytest.mark.parametrize(
    "line",
    [
        "ODOM 1 2 3",
        "ODOM 1 2 3 4 5 x 1.0 robot 1.0",
        "FLASER 9 1 2 3 1.0 robot 1.0",
        "FLASER 1000000000 1 1.0 robot 1.0",
    ],
)
def test_a_line_that_is_cut_or_no_number_is_named(tmp_path, line):
    (tmp_path / "drive.log").write_text(f"{OLD}{line}\n")
    with pytest.raises(Error, match=rf"drive\.log:7: is not a line of {line.split()[0]}"):
        read_recording(tmp_path / "drive.log")


def test_another_log_is_no_recording(tmp_path):
    (tmp_path / "drive.log").write_text("12:00 started\n")
    with pytest.raises(Error, match=r"drive\.log: is not a recording: give a folder, a bag"):
        read_recording(tmp_path / "drive.log")


def test_a_trajectory_is_a_table(tmp_path):
    t = 0.1 * np.arange(30)
    theta = 0.2 * t
    write_csv_run(tmp_path / "drive", Run("drive", command=series(t, "vw", 0.3 * np.ones(30), 0.2 * np.ones(30))))
    quaternions = 2.0 * Rotation.from_euler("ZYX", np.stack([theta, 0.1 + 0 * t, 0.05 + 0 * t], axis=1)).as_quat()
    rows = np.column_stack([t, 0.3 * t, 0.1 * t, 0.0 * t, quaternions])
    np.savetxt(tmp_path / "drive" / "pose.tum", rows, header="timestamp tx ty tz qx qy qz qw")
    pose = read_recording(tmp_path).runs[0].pose
    np.testing.assert_allclose(pose.values, np.stack([0.3 * t, 0.1 * t, theta], axis=1), atol=1e-12)
    (tmp_path / "drive" / "pose.csv").write_text("t,x,y,theta\n")
    with pytest.raises(Error, match=r"pose\.tum: there is a pose\.csv, too"):
        read_recording(tmp_path)
    (tmp_path / "drive" / "pose.csv").unlink()
    for text, words in {
        "1 2 3\n": ":1: has 3 numbers",
        "# t\n1 2 3 4 5 6 7 x\n": ":2: is not a row of numbers",
    }.items():
        (tmp_path / "drive" / "pose.tum").write_text(text)
        with pytest.raises(Error, match=rf"pose\.tum{words}"):
            read_recording(tmp_path)

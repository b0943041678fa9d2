# SPDX-License-Identifier: BSD-3-Clause
"""MRPT's own programs: rbpf-slam and pf-localization on our rawlog and simplemap, rosbag2rawlog on our bag."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy
from sensor_msgs.msg import LaserScan

from kurumaisu import slam
from kurumaisu.bench.slam.models import without_mean_error
from kurumaisu.bench.slam.random_drives import random_drive
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.map_file import read_map
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.tools import map_command

CONFIGS = Path("/usr/share/mrpt/config_files")
PATIENCE = 120.0  # [s] of wall time
RAWLOG, SIMPLEMAP = "drive.rawlog", "map.simplemap"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A drive of 40 s, as it was driven and as written for MRPT, and our map of it: log, path, folder."""
    folder = tmp_path_factory.mktemp("stock")
    raw, _ = random_drive(read_map(shipped("worlds/maps/building.yaml")), folder, 7, 40.0)
    log = without_mean_error(raw, load_model(shipped("launch/md100.yaml")).laser.error)
    slam.write_rawlog(log, folder / RAWLOG)
    settings = slam.load_mapping_settings(shipped("launch/mapping_node.yaml"))
    result = slam.map_scans(settings, log, 1, simplemap=folder / SIMPLEMAP)
    return log, result.trajectory, folder


def run(folder: Path, *command: str) -> str:
    """Return what one of MRPT's programs says."""
    if shutil.which(command[0]) is None:
        pytest.skip(f"needs {command[0]}, of Debian's mrpt-apps")
    done = subprocess.run(
        command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    said = done.stdout + done.stderr
    assert done.returncode == 0, said[-2000:]
    assert "exception" not in said, said[-2000:]
    return said


def configure(shipped_config: str, path: Path, **values: object) -> None:
    """Write one of MRPT's configurations with other values for some keys, all of which it has."""
    text = (CONFIGS / shipped_config).read_text(encoding="utf-8", errors="replace")
    for key, value in values.items():
        text, count = re.subn(rf"(?m)^{key}\s*=.*$", f"{key}={value}", text)
        assert count >= 1, key
    path.write_text(text, encoding="utf-8")


def test_a_rawlog_is_read_as_it_was_written(made):
    log, _, folder = made
    again = slam.read_rawlog(folder / RAWLOG)
    np.testing.assert_allclose(again.times, log.times, atol=1e-6)
    steps = [np.diff(each.odom, axis=0) for each in (again, log)]
    np.testing.assert_allclose(np.hypot(*steps[0].T[:2]), np.hypot(*steps[1].T[:2]), atol=1e-6)
    np.testing.assert_allclose(wrap(steps[0][:, 2]), wrap(steps[1][:, 2]), atol=1e-6)
    assert again.ranges.shape == log.ranges.shape
    at_rest = np.flatnonzero(np.all(log.odom == log.odom_end, axis=1))
    assert len(at_rest) > 0  # where nothing moves during a scan, nothing is taken out
    for i in at_rest[:5]:
        np.testing.assert_array_equal(np.isfinite(again.ranges[i]), np.isfinite(log.ranges[i]))
        np.testing.assert_allclose(again.ranges[i], log.ranges[i], atol=1e-5)
    first = [each.fan.base_from_laser[2] + each.fan.angle_min for each in (again, log)]
    assert abs(first[0] - first[1]) < 1e-5  # MRPT's fans are symmetric: the rest is in the yaw


def test_the_command_writes_a_rawlog(made, tmp_path):
    _, _, folder = made
    arguments = [str(folder / RAWLOG), "-o", str(tmp_path), "--rawlog", str(tmp_path / "copy.rawlog")]
    assert map_command.main(arguments) == 0
    one, other = slam.read_rawlog(folder / RAWLOG), slam.read_rawlog(tmp_path / "copy.rawlog")
    np.testing.assert_allclose(one.ranges, other.ranges, atol=1e-5)


def test_a_rawlog_that_cannot_be_written_is_named(made):
    log, _, _ = made
    with pytest.raises(Error, match=r"/proc/none/a\.rawlog: cannot be written"):
        slam.write_rawlog(log, Path("/proc/none/a.rawlog"))


def test_pf_localization_finds_the_chair_in_our_map_with_our_rawlog(made):
    _, path, folder = made
    configure(
        "pf-localization/localization_demo.ini",
        folder / "pf.ini",
        map_file=SIMPLEMAP,
        SHOW_PROGRESS_3D_REAL_TIME="false",
        particles_count=2000,
        init_PDF_mode=1,
        init_PDF_min_x=-1,
        init_PDF_max_x=1,
        init_PDF_min_y=-1,
        init_PDF_max_y=1,
    )
    said = run(folder, "pf-localization", "pf.ini", RAWLOG)
    x, y, degrees = map(float, re.findall(r"PDF estimation: \(([-\d.]+),([-\d.]+),([-\d.]+)deg\)", said)[-1])
    assert np.hypot(x - path[-1, 1], y - path[-1, 2]) < 0.15
    assert abs(wrap(np.radians(degrees) - path[-1, 3])) < 0.05


def test_rbpf_slam_maps_our_rawlog(made):
    log, path, folder = made
    configure(
        "rbpf-slam/gridmapping_optimal_sampling.ini",
        folder / "rbpf.ini",
        SHOW_PROGRESS_IN_WINDOW=0,
        SAVE_3D_SCENE=0,
        SAVE_MAP_IMAGES=0,
        LOG_FREQUENCY=100000,
        logOutput_dir="rbpf",
    )
    run(folder, "rbpf-slam", "rbpf.ini", RAWLOG)
    theirs = np.loadtxt(folder / "rbpf" / "log_estimated_path.txt")
    assert len(theirs) >= len(log.times) - 1
    assert (folder / "rbpf" / "_finalmap_.simplemap").stat().st_size > 1000
    assert np.hypot(*np.diff(theirs[:, 1:3], axis=0).T).sum() > 5  # it went along
    assert np.hypot(*(theirs[-1, 1:3] - path[-1, 1:3])) < 1.0  # with its tutorial's settings


def test_rosbag2rawlog_leaves_scans_out(made, tmp_path):
    """MRPT 2.5.8 has no conversion of LaserScan: hence --rawlog. Where this fails, it has learnt it."""
    log, _, _ = made
    with rosbag.Bag(tmp_path / "drive.bag", "w") as bag:
        for t, ranges in zip(log.times[:5], log.ranges[:5], strict=True):
            message = LaserScan(ranges=ranges.tolist(), angle_increment=0.006, range_max=5.6)
            message.header.stamp = rospy.Time.from_sec(1 + t)
            bag.write("/scan", message, message.header.stamp)
    config = "sensors:\n  laser:\n    type: CObservation2DRangeScan\n    topic: /scan\n"
    (tmp_path / "config.yml").write_text(config, encoding="utf-8")
    command = ["rosbag2rawlog", "-f", "odom", "-w", "-c", "config.yml", "-o", "drive.rawlog", "drive.bag"]
    assert "unhandled topic '/scan'" in run(tmp_path, *command)
    with pytest.raises(Error, match=r"drive\.rawlog"):
        slam.read_rawlog(tmp_path / "drive.rawlog")

# SPDX-License-Identifier: BSD-3-Clause
"""Mapping of real recordings (from Debian's mrpt-common), its settings, files and command."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from recordings import full_run, write_bag

from kurumaisu import _slam, maps, slam
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.params import shipped
from kurumaisu.ros.tools import map_command
from kurumaisu.whole_files import write_whole

DATASETS = Path("/usr/share/mrpt/datasets")
SENA = DATASETS / "2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"
SETTINGS = shipped("launch/mapping_node.yaml")


@pytest.fixture(scope="module")
def sena() -> slam.ScanLog:
    return slam.read_rawlog(SENA)


@pytest.fixture(scope="module")
def mapped(sena: slam.ScanLog) -> slam.MappingResult:
    return slam.map_scans(slam.load_mapping_settings(SETTINGS), sena, seed=1)


def squares_hit(log: slam.ScanLog, poses: np.ndarray, edge: float, reach: float) -> int:
    """Count squares that readings fall into: few where scans of one wall agree. Not the mapper's code."""
    bearings = log.fan.angle_min + log.fan.angle_increment * np.arange(log.ranges.shape[1])
    x, y, yaw = log.fan.base_from_laser
    hits = set()
    for pose, ranges in zip(poses, log.ranges, strict=True):
        near = ranges < reach
        laser = compose(pose, np.array([x, y, yaw]))
        angle = laser[2] + bearings[near]
        points = laser[:2] + ranges[near, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        hits.update(map(tuple, np.floor(points / edge).astype(int)))
    return len(hits)


def test_sena_is_read_as_recorded(sena: slam.ScanLog) -> None:
    assert sena.ranges.shape == (225, 361)
    assert sena.times[-1] - sena.times[0] == pytest.approx(59.1, abs=0.1)
    way = np.hypot(*np.diff(sena.odom[:, :2], axis=0).T).sum()
    assert way == pytest.approx(76.4, abs=0.5)
    assert np.degrees(sena.fan.angle_min) == pytest.approx(-90)
    assert np.degrees(sena.fan.angle_increment) == pytest.approx(0.5)
    assert sena.fan.base_from_laser == pytest.approx([0.78, 0, 0])
    assert (np.diff(sena.times) > 0).all()
    finite = sena.ranges[np.isfinite(sena.ranges)]
    assert finite.min() > 0.5
    assert finite.max() < sena.fan.range_max


def test_the_other_recording_is_read() -> None:
    assert slam.read_rawlog(DATASETS / "localization_demo.rawlog").ranges.shape == (37, 361)


def test_scans_agree_along_the_mapped_path(sena: slam.ScanLog, mapped: slam.MappingResult) -> None:
    by_odometry = squares_hit(sena, sena.odom, 0.1, 15.0)
    by_mapping = squares_hit(sena, mapped.trajectory[:, 1:], 0.1, 15.0)
    assert by_mapping < 0.4 * by_odometry


def test_the_loop_closes(sena: slam.ScanLog, mapped: slam.MappingResult) -> None:
    """The end of the drive passes what the beginning saw, so both must hit the same squares."""
    begin, end = slice(0, 40), slice(185, 225)

    def hit(poses: np.ndarray, *parts: slice) -> int:
        keep = np.r_[parts]
        return squares_hit(replace(sena, ranges=sena.ranges[keep]), poses[keep], 0.5, 10.0)

    def shared(poses: np.ndarray) -> float:
        together = hit(poses, begin, end)
        return (hit(poses, begin) + hit(poses, end) - together) / together

    assert shared(mapped.trajectory[:, 1:]) > 0.25
    assert shared(mapped.trajectory[:, 1:]) > 10 * shared(sena.odom)


def test_every_scan_has_a_pose(sena: slam.ScanLog, mapped: slam.MappingResult) -> None:
    np.testing.assert_array_equal(mapped.trajectory[:, 0], sena.times)
    np.testing.assert_allclose(mapped.trajectory[0, 1:], sena.odom[0], atol=1e-12)
    assert np.abs(np.diff(mapped.trajectory[:, 3])).max() < 0.5  # unwrapped, no jumps
    assert np.hypot(*np.diff(mapped.trajectory[:, 1:3], axis=0).T).max() < 1.5


def test_equal_seeds_give_equal_bits(sena: slam.ScanLog) -> None:
    log = slam.ScanLog("part", *(a[:40] for a in (sena.times, sena.ranges, sena.odom, sena.odom_end)), sena.fan)
    settings = slam.load_mapping_settings(SETTINGS)
    calls: list[tuple[int, int]] = []
    first = slam.map_scans(settings, log, 3, lambda done, total: calls.append((done, total)))
    second = slam.map_scans(settings, log, 3)
    np.testing.assert_array_equal(first.trajectory, second.trajectory)
    np.testing.assert_array_equal(first.grid.cells, second.grid.cells)
    assert calls == [(i + 1, 40) for i in range(40)]
    assert not np.array_equal(first.trajectory, slam.map_scans(settings, log, 4).trajectory)


def test_scan_log_interpolates_and_drops_what_odometry_does_not_cover() -> None:
    fan = _slam.Fan(angle_min=-1, angle_increment=0.1, time_increment=0.01, range_max=4, base_from_laser=(0, 0, 0))
    times, ranges = np.array([0.95, 1.0, 1.5, 1.95]), np.ones((4, 11), dtype=np.float32)
    odom = np.array([[0.0, 0, 0], [2.0, 0, 1.0]])
    log = slam.scan_log("a", times, ranges, fan, np.array([1.0, 2.0]), odom)
    np.testing.assert_allclose(log.times, [1.0, 1.5])
    np.testing.assert_allclose(log.odom, [[0, 0, 0], [1, 0, 0.5]])
    np.testing.assert_allclose(log.odom_end, [[0.2, 0, 0.1], [1.2, 0, 0.6]])
    for empty in (np.array([]), np.array([5.0, 6.0])):
        with pytest.raises(Error, match="a: no scan lies within"):
            slam.scan_log("a", times, ranges, fan, empty, odom[: len(empty)])


def test_a_scan_that_makes_no_sense_is_named(sena: slam.ScanLog) -> None:
    times = sena.times.copy()
    times[7] = times[6]
    with pytest.raises(Error, match=r"one_loop_only\.rawlog: scan 7: "):
        slam.map_scans(slam.load_mapping_settings(SETTINGS), replace(sena, times=times), 1)


@pytest.mark.parametrize(
    ("source", "keep", "message"),
    [
        (None, 0, "No such file"),
        ("RO-SLAM_demo.rawlog", None, "has no laser scan"),
        ("README_directory.txt", None, "is not a rawlog"),
        (SENA.name, 100_000, "cut off"),
        (SENA.name, 0, "is empty"),
    ],
)
def test_bad_rawlogs(tmp_path: Path, source: str | None, keep: int | None, message: str) -> None:
    path = tmp_path / "bad.rawlog"
    if source:
        path.write_bytes((DATASETS / source).read_bytes()[:keep])
    with pytest.raises(Error, match=rf"{path}: .*{message}") as raised:
        slam.read_rawlog(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda top: top["mapper"].pop("particles"), "mapper.particles: is missing"),
        (lambda top: top["mapper"].update(partciles=3), "mapper.partciles: is not a known key"),
        (lambda top: top["mapper"].update(resolution=0), "mapper.resolution: must be 0.005 to 1: 0"),
        (lambda top: top["mapper"].update(particles=1.5), "mapper.particles: must be a whole number: 1.5"),
        (lambda top: top["mapper"].update(certainty="high"), "mapper.certainty: must be a number"),
        (lambda top: top.pop("node"), "node: is missing"),
        (lambda top: top.update(extra=1), "extra: is not a known key"),
    ],
)
def test_bad_settings_name_file_and_key(tmp_path: Path, change, message: str) -> None:
    top = yaml.safe_load(SETTINGS.read_text(encoding="utf-8"))
    change(top)
    path = tmp_path / "settings.yaml"
    path.write_text(yaml.safe_dump(top), encoding="utf-8")
    with pytest.raises(Error) as raised:
        slam.load_mapping_settings(path)
    assert str(raised.value).startswith(f"{path}: {message}")


def test_saved_map_is_what_map_server_reads(tmp_path: Path) -> None:
    cells = np.array([[0, 100, -1], [19, 66, 50]], dtype=np.int8)
    pair = maps.grid_pair(maps.Grid(cells, 0.05, -1.5, 2.0), tmp_path / "office.1")
    write_whole(pair)
    image, text = pair
    assert (image.name, text.name) == ("office.1.pgm", "office.1.yaml")
    assert image.read_bytes() == b"P5\n3 2\n255\n" + bytes([254, 0, 205, 254, 0, 205])
    meta = yaml.safe_load(text.read_text(encoding="utf-8"))
    assert meta["image"] == "office.1.pgm"
    assert meta["resolution"] == 0.05
    assert meta["origin"] == [-1.5, 2.0, 0.0]
    assert (meta["negate"], meta["occupied_thresh"], meta["free_thresh"]) == (0, 0.65, 0.196)


def test_command_writes_map_picture_and_path(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "folder"
    log = DATASETS / "localization_demo.rawlog"
    assert map_command.main([str(log), "-o", str(folder), "--seed", "2"]) == 0
    out, err = capsys.readouterr()
    assert "37 scans" in out
    assert err == ""
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")
    path = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)
    assert path.shape == (37, 4)
    sure = np.loadtxt(folder / "uncertainty.csv", delimiter=",", skiprows=1)
    assert sure.shape[1] == 10
    assert (sure[:, [4, 6, 9]] >= 0).all()
    assert np.isin(np.round(sure[:, 0], 3), np.round(path[:, 0], 3)).all()
    meta = yaml.safe_load((folder / "map.yaml").read_text(encoding="utf-8"))
    assert (folder / meta["image"]).exists()


def test_command_maps_a_bag_as_the_critic_reads_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The full run of the readers' tests: a few scans of a wall, with voltages, so of our own laser."""
    write_bag(tmp_path / "drive.bag", full_run())
    assert map_command.main([str(tmp_path / "drive.bag"), "-o", str(tmp_path / "map")]) == 0
    out = capsys.readouterr().out
    assert "drive: " in out
    assert "error: " not in out  # nobody says where its pose is
    write_csv_run(tmp_path / "drives" / "run_1", full_run())
    assert map_command.main([str(tmp_path / "drives"), "-o", str(tmp_path / "map")]) == 0
    assert "error: " in capsys.readouterr().out  # random poses and scans, so of any size
    assert (tmp_path / "map" / "map.pgm").exists()


def test_the_error_is_that_of_the_path_after_the_best_fit() -> None:
    t = np.linspace(0, 10, 50)
    path = np.column_stack([t, np.cos(t), np.sin(t), t])
    moved = compose(np.broadcast_to([3.0, -2.0, 1.0], (50, 3)), path[:, 1:])
    assert "error: 0.000 m, 0.00 degrees (RMS, 50 scans)" in map_command.error_of(path, np.column_stack([t, moved]))
    moved[25] += [0.5, 0, 0]
    assert "error: 0.07" in map_command.error_of(path, np.column_stack([t, moved]))
    assert map_command.error_of(path, None) == ""
    assert "other times" in map_command.error_of(path, np.column_stack([t + 100, moved]))


def test_command_goes_on_from_a_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same drive again, in the map it made: both paths agree in one frame, though the start was told wrong."""
    log = str(DATASETS / "localization_demo.rawlog")
    assert map_command.main([log, "-o", str(tmp_path / "a")]) == 0
    first = np.loadtxt(tmp_path / "a" / "trajectory.csv", delimiter=",", skiprows=1)
    x, y, theta = first[0, 1:] + [0.2, -0.2, 0.05]
    start = ["--start", str(tmp_path / "a" / "map.simplemap"), "--at", f"{x}", f"{y}", f"{theta}"]
    assert map_command.main([log, "-o", str(tmp_path / "b"), *start]) == 0
    second = np.loadtxt(tmp_path / "b" / "trajectory.csv", delimiter=",", skiprows=1)
    assert np.hypot(*(second - first)[:, 1:3].T).max() < 0.15
    capsys.readouterr()
    assert map_command.main([log, "-o", str(tmp_path / "c"), *start[:2], "--at", "500", "0", "0"]) == 1
    assert "scan 0: the map to continue explains 0 %" in capsys.readouterr().err


def test_command_refuses_bad_input(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shutil.copy(DATASETS / "RO-SLAM_demo.rawlog", tmp_path / "a.rawlog")
    blocked = tmp_path / "file"
    blocked.touch()
    demo = str(DATASETS / "localization_demo.rawlog")
    for arguments, message in (
        ([str(tmp_path / "a.rawlog")], "a.rawlog: has no laser scan"),
        ([str(tmp_path / "none")], "none: No such file"),
        ([demo, "--settings", str(tmp_path / "none.yaml")], "none.yaml: No such file"),
        ([demo, "-o", str(blocked / "folder")], "folder: Not a directory"),
        ([demo, "--start", str(tmp_path / "none.simplemap")], "none.simplemap: cannot be read"),
        ([demo, "--start", str(blocked)], "is not a simplemap to continue"),
    ):
        assert map_command.main(arguments) == 1
        out, err = capfd.readouterr()
        assert out == ""
        assert err.count("\n") == 1  # nothing of MRPT's own
        assert message in err
    with pytest.raises(SystemExit, match="2"):
        map_command.main([demo, "--seed", "-1"])
    assert "--seed: must be" in capfd.readouterr().err

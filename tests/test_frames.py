# SPDX-License-Identifier: BSD-3-Clause
"""A frame has its name from one file; where another one says something else, the start is refused with both."""

import contextlib
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import roslaunch.config
import roslaunch.xmlloader

from kurumaisu import frames, urdf
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped

BASE, MODEL = shipped("launch/base_node.yaml"), shipped("launch/md100.yaml")


@pytest.fixture
def printed(monkeypatch, capsys):
    def run(*words):
        monkeypatch.setattr(sys, "argv", ["frame", *map(str, words)])
        code = frames.main()
        return code, *capsys.readouterr()

    return run


def file(folder: Path, text: str) -> Path:
    path = folder / "settings.yaml"
    path.write_text(text)
    return path


def test_it_is_read_where_it_is_written(printed):
    assert printed(BASE, "odometry/child_frame") == (0, "base_link", "")
    assert printed(MODEL, "laser/frame", "--prefix", "chair1/") == (0, "chair1/laser", "")


def test_two_names_are_refused_with_both(printed, tmp_path):
    other = file(tmp_path, "node: {odom_frame: wheels}\n")
    code, said, why = printed(BASE, "odometry/frame", "--same", other, "node/odom_frame")
    assert (code, said) == (1, "")
    assert why == (
        f"frame: {other}: node.odom_frame: is wheels, but odometry.frame of {BASE} is odom: must be the same frame\n"
    )
    assert printed(BASE, "odometry/frame", "--same", other, "node/base_frame")[0] == 0  # it says nothing of it


@pytest.mark.parametrize("name", ["/laser", "'a laser'", "''", "3"])
def test_what_is_no_name_is_refused(printed, tmp_path, name):
    code, said, why = printed(file(tmp_path, f"frame: {name}\n"), "frame")
    assert (code, said) == (1, "")
    assert "settings.yaml: frame: must be a" in why


def test_a_missing_key_is_named(printed, tmp_path):
    assert "settings.yaml: laser.frame: is missing" in printed(file(tmp_path, "a: 1\n"), "laser/frame")[2]


def test_the_description_has_base_node_s_frame_and_the_prefix(tmp_path):
    settings = file(tmp_path, "odometry: {child_frame: seat}\n")
    robot = ElementTree.fromstring(
        urdf.robot_description(load_model(MODEL), frames.base_frame(str(settings)), None, "chair1/")
    )
    assert {link.get("name") for link in robot.findall("link")} == {"chair1/seat", "chair1/laser"}
    with pytest.raises(Error, match="is missing"):
        frames.base_frame(str(file(tmp_path, "odometry: {}\n")))


def launched(launch: str, *arguments: str) -> dict[str, object]:
    loader, config = roslaunch.xmlloader.XmlLoader(), roslaunch.config.ROSLaunchConfig()
    loader.load(str(shipped(f"launch/{launch}")), config, argv=list(arguments), verbose=False)
    return {key: parameter.value for key, parameter in config.params.items()}


NAMED = {
    "robot.launch": {
        "base_node/odometry/frame": "odom",
        "base_node/odometry/child_frame": "base_link",
        "laser_node/frame_id": "laser",
        "viewer_node/odom_frame": "odom",
        "viewer_node/base_frame": "base_link",
    },
    "slam.launch": {"mapping_node/node/odom_frame": "odom", "mapping_node/node/base_frame": "base_link"},
    "localization.launch": {"localization_node/odom_frame_id": "odom", "localization_node/base_frame_id": "base_link"},
}


@pytest.mark.parametrize("launch", NAMED)
@pytest.mark.parametrize("prefix", ["", "chair1/"])
def test_a_prefix_is_before_every_frame(launch, prefix):
    values = launched(launch, f"frame_prefix:={prefix}", "viewer:=true")
    assert {key: values[f"/{key}"] for key in NAMED[launch]} == {
        key: f"{prefix}{name}" for key, name in NAMED[launch].items()
    }
    with contextlib.suppress(KeyError):
        robot = ElementTree.fromstring(values["/robot_description"])
        names = {link.get("name") for link in robot.findall("link")}
        assert names == {f"{prefix}{name}" for name in ("base_link", "laser", "imu_link")}


def test_renamed_frames_are_followed(tmp_path):
    model = tmp_path / "model.yaml"
    model.write_text(MODEL.read_text().replace("\n  frame: laser\n", "\n  frame: eye\n"))
    base = tmp_path / "base.yaml"
    base.write_text(BASE.read_text().replace("child_frame: base_link", "child_frame: seat"))
    values = launched("robot.launch", f"model:={model}", f"base_settings:={base}", "viewer:=true")
    assert values["/laser_node/frame_id"] == "eye"
    assert values["/viewer_node/base_frame"] == "seat"
    robot = ElementTree.fromstring(values["/robot_description"])
    assert {link.get("name") for link in robot.findall("link")} == {"seat", "eye", "imu_link"}


@pytest.mark.parametrize(("launch", "key"), [("slam.launch", "base_frame"), ("localization.launch", "base_frame_id")])
def test_a_node_with_another_name_is_not_started(launch, key, tmp_path, capfd):
    base = tmp_path / "base.yaml"
    base.write_text(BASE.read_text().replace("child_frame: base_link", "child_frame: seat"))
    with pytest.raises(roslaunch.xmlloader.XmlParseException):
        launched(launch, f"base_settings:={base}")
    said = capfd.readouterr().err
    assert "base_link" in said
    assert "seat" in said

# SPDX-License-Identifier: BSD-3-Clause
"""Bags of the robot and of the simulator are the same to everybody: critic, map, paper, calibrate."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import Bag

from kurumaisu.bench.paper import scans
from kurumaisu.critic.app import cli
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.paper.chair import drive
from kurumaisu.paper.options import load_options
from kurumaisu.ros.paper import command
from kurumaisu.ros.tools import calibrate_command, map_command

AS_ITS_MODEL = (1.0, 1.0)
# start of the clock [s]; how late messages are received; how often a Twist; topics' first letter; who measures the pose
SIMULATOR = {"start": 0.0, "late": 0.0, "tick": 0.005, "slash": "", "truth": True}
ROBOT = {"start": 1.7e9, "late": 0.004, "tick": 1e-6, "slash": "/", "truth": False}


def write(path, run, how):
    """Write a run as `record.launch` does: stamps of one clock or the other, Twists without any, scans with a fan."""
    rng = np.random.default_rng(3)
    bag = Bag(path, None)
    rows = []
    fan = scans.load_model(scans.shipped("launch/md100.yaml")).laser

    def add(topic, t, make, values):
        for at, row in zip(t + how["start"], values, strict=True):
            late = how["late"] * rng.exponential()
            received = how["tick"] * np.floor((at + late) / how["tick"] + 1e-6)
            rows.append((received, how["slash"] + topic, make(round(at, 6), row)))

    def scan(t, ranges):
        message = bag.scan(t, ranges)
        fans = {
            "angle_min": fan.angle_min,
            "angle_max": fan.angle_min + fan.angle_increment * (fan.beams - 1),
            "angle_increment": fan.angle_increment,
            "time_increment": fan.time_increment,
        }
        return bag.make(
            "sensor_msgs/msg/LaserScan",
            **{**{n: getattr(message, n) for n in message.__dataclass_fields__ if n != "__msgtype__"}, **fans},
        )

    def voltages(t, row):
        values = dict(zip(("translation", "steering", "v", "w"), row, strict=True))
        return bag.make("kurumaisu/msg/Voltages", header=bag.header(t), reference=2.5, **values)

    add("cmd_vel", run.command.t, lambda _, row: bag.twist(*row), run.command.values)
    add("voltages", run.voltage.t, voltages, run.voltage.values)
    add("odom", run.odom.t, lambda t, row: bag.odometry(t, row[:3], *row[3:]), run.odom.values)
    add("scan", run.scan.t, scan, run.scan.values)
    if how["truth"]:
        add("ground_truth", run.pose.t, lambda t, row: bag.odometry(t, row, 0.0, 0.0), run.pose.values)
    for received, topic, message in sorted(rows, key=lambda row: row[0]):
        bag.write(topic, message, received)
    bag.writer.close()


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """The same drives as bags of the simulator and of the robot: to fit, and held out."""
    folder = tmp_path_factory.mktemp("bags")
    for name, file in (("train", drive.IDENTIFICATION), ("test", drive.HELD_OUT)):
        (run,) = scans.recorded(AS_ITS_MODEL, 11, file).runs
        run = replace(run, name=name)
        for kind, how in (("simulator", SIMULATOR), ("robot", ROBOT)):
            (folder / kind).mkdir(exist_ok=True)
            write(folder / kind / f"{name}.bag", run, how)
    return folder


@pytest.mark.parametrize("kind", ["simulator", "robot"])
def test_nothing_is_wrong_with_it_and_it_has_its_fan(bags, kind):
    recording = read_recording(bags / kind / "test.bag")
    assert recording.invalid == ()
    (run,) = recording.runs
    assert run.fan.beams == 682
    assert run.scan.values.shape[1] == 682
    assert (run.pose is not None) == (kind == "simulator")


@pytest.mark.parametrize("kind", ["simulator", "robot"])
def test_paper_and_calibrate_take_it(bags, kind, tmp_path, capsys):
    train, test = bags / kind / "train.bag", bags / kind / "test.bag"
    assert command.main(["drive", str(train), "--out", str(tmp_path / "paper")]) == 0
    told = capsys.readouterr().out
    source = "reference pose: measured" if kind == "simulator" else "reference pose: particle filter over"
    assert source in told
    law = (tmp_path / "paper/chair.yaml").read_text()
    assert "voltage_law: custom" in law
    code = calibrate_command.main(["drive", str(train), "--test", str(test), "--out", str(tmp_path / "own")])
    assert code == 1  # the chair is as its model says
    assert "NO better: keep the model that you have" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["simulator", "robot"])
def test_the_map_is_made_of_it(bags, kind, tmp_path):
    assert map_command.main([str(bags / kind / "test.bag"), "-o", str(tmp_path)]) == 0
    assert any(tmp_path.glob("*.pgm"))


@pytest.mark.parametrize("kind", ["simulator", "robot"])
def test_the_critic_takes_it_and_finds_nothing_wrong_with_the_data(bags, kind, tmp_path):
    assert cli.main([str(bags / kind / "test.bag"), "-o", str(tmp_path), "--quiet"]) in (
        0,
        3,
        4,
        5,
    )  # a verdict, not an error
    verdict = (tmp_path / "verdict.json").read_text()
    assert '"invalid_data"' not in verdict


def test_without_a_reference_the_chairs_law_is_found_and_not_the_models():
    """The odometry believes the model; a filter drawn to it would find the model's slopes."""
    other = (0.85, 1.10)
    recording = scans.blind(scans.recorded(other, 5))
    options = load_options()
    own, models = (scans.judge(recording, factors, options) for factors in (other, AS_ITS_MODEL))
    assert own.refused == 0
    assert sum(own.held) >= 5  # of eight, each in 9 of 10; fewer than five once in 200
    assert not any(models.held[0::2])  # slopes

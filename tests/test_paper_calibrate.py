# SPDX-License-Identifier: BSD-3-Clause
"""calibrate: what it asks for, what it says of a drive while it lasts, and what a new law is worth on another drive."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from test_paper_wall import DISTANCES, FOUR, recorded, scans

from kurumaisu.bench.paper import drive as bench
from kurumaisu.critic.experiment.rehearse import write
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.experiments import load_script
from kurumaisu.paper.chair import advice, drive, held_out
from kurumaisu.paper.chair.samples import samples_of
from kurumaisu.paper.options import load_options
from kurumaisu.params import load_model, shipped
from kurumaisu.ros.tools.calibrate_command import main

OPTIONS = load_options()
MODEL = shipped("launch/md100.yaml")
# A chair whose slopes and dead zone are not its model's; base_node drives it by the model's corrected law.
OTHER = bench.Case(
    "other",
    translation=((1.6, 0.20), (2.4, -0.16)),
    steering=((-0.60, -0.15), (-0.55, 0.20)),
    base=(bench.TRANSLATION, bench.CORRECTED),
)


def save(folder, *runs):
    write(folder, Recording(folder.name, runs, train=tuple(run.name for run in runs), truth=(0.005, 0.005)))
    return folder


def drives(tmp_path, case):
    rng = np.random.default_rng(2)
    train = save(tmp_path / "train", bench.make(case, rng))
    test = save(tmp_path / "test", bench.make(case, rng, drive.HELD_OUT))
    return [str(train), "--test", str(test), "--out", str(tmp_path / "out")]


@pytest.fixture
def corrected(tmp_path):
    """A model file that uses the corrected law."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL.read_text().replace("voltage_law: published ", "voltage_law: corrected "))
    assert load_model(path).law_name == "corrected"
    return path


def test_a_chair_that_is_not_its_model_is_better_known_afterwards(tmp_path, corrected, capsys):
    assert main(["drive", *drives(tmp_path, OTHER), "--model", str(corrected)]) == 0
    told = capsys.readouterr().out
    assert "the new law is better" in told
    law = load_model(tmp_path / "out/chair.yaml")
    assert law.translation.positive.slope == pytest.approx(1.6, rel=0.05)
    assert law.steering.negative.intercept == pytest.approx(0.20, abs=0.02)
    rows = {line.split(",")[0]: line.split()[-2:] for line in told.splitlines() if ", rms" in line}
    before, after = (float(x) for x in rows["place after 10 s"])
    assert after < 0.3 * before


def test_a_model_that_is_right_is_kept(tmp_path, corrected, capsys):
    case = replace(OTHER, translation=bench.TRANSLATION, steering=bench.CORRECTED, base=None)
    assert main(["drive", *drives(tmp_path, case), "--model", str(corrected)]) == 1
    assert "NO better: keep the model that you have" in capsys.readouterr().out


def test_errors_on_a_drive_are_those_of_the_chair_that_drove_it():
    """By hand: a slope that is 10 % off is 10 % off in speed; without noise and by the right law nothing is left."""
    quiet = replace(bench.CASES[1], sd_v=1e-9, sd_w=1e-9, pose_sd=0.0)
    run = bench.make(quiet, np.random.default_rng(1), drive.HELD_OUT)
    samples = samples_of([run], (1e-6, 1e-6), OPTIONS.drive)
    model = load_model(MODEL)
    right = replace(model, steering=bench_law(bench.CORRECTED), translation=bench_law(bench.TRANSLATION))
    wrong = replace(right, translation=bench_law(((1.1 * 1.32402, 0.127906), (1.1 * 2.07369, -0.108783))))
    none, some = (held_out.errors(m, samples, [run]) for m in (right, wrong))
    assert none.v < 1e-4
    assert none.w < 1e-4
    assert none.place < 1e-3
    v = samples.v[samples.steady]
    assert some.v == pytest.approx(np.sqrt(np.mean(v**2)) * (1 - 1 / 1.1), rel=1e-3)
    assert some.w == none.w
    assert some.place > 0.05
    assert none.better_than(some, 0.9)
    assert not some.better_than(none, 0.9)


def bench_law(law):
    from kurumaisu._core import AxisLaw, Branch

    return AxisLaw(*(Branch(*line) for line in law))


def test_a_test_drive_that_says_nothing_is_refused(tmp_path, corrected, capsys):
    run = bench.make(OTHER, np.random.default_rng(2))
    short = replace(run, pose=replace(run.pose, t=run.pose.t[:20], values=run.pose.values[:20]))
    train, test = save(tmp_path / "train", run), save(tmp_path / "test", short)
    arguments = ["drive", str(train), "--test", str(test), "--out", str(tmp_path / "out"), "--model", str(corrected)]
    assert main(arguments) == 1
    assert "the held-out drive is shorter than 10 s" in capsys.readouterr().err


def test_while_it_lasts_a_drive_is_told_what_it_lacks():
    run = bench.make(bench.CASES[0], np.random.default_rng(1))

    def until(t):
        kept = run.pose.t <= t
        return replace(run, pose=replace(run.pose, t=run.pose.t[kept], values=run.pose.values[kept]))

    said = [advice.missing([until(t)], OPTIONS) for t in (0.5, 30.0, 60.0, 1000.0)]
    assert "no 1 s of voltages and poses together" in said[0][0]
    assert any(words.startswith("turning left: ") and "8 are needed" in words for words in said[1])
    assert len(said[1]) >= 4
    assert said[3] == []


def test_the_plan_names_files_that_are_there(capsys):
    assert main(["plan"]) == 0
    told = capsys.readouterr().out
    for name in (drive.IDENTIFICATION, drive.HELD_OUT):
        assert name in told
        load_script(shipped(name))
    assert "0.2, 0.5, 1, 2, 4" in told


def wall(tmp_path, seed=4, **how):
    rng = np.random.default_rng(seed)
    write(tmp_path / "wall", recorded([scans(d, rng, gate=3.99, **how) for d in DISTANCES[:4]]))
    return ["laser", str(tmp_path / "wall"), "--distances", *map(str, DISTANCES[:4]), "--out", str(tmp_path / "out")]


def test_a_laser_that_is_not_its_model_is_better_known_afterwards(tmp_path, capsys):
    assert main(wall(tmp_path, shift=-FOUR[1], sd=2.0)) == 0
    found = yaml.safe_load((tmp_path / "out/laser.yaml").read_text())["laser"]["error"]
    assert found["datum_offset"] == pytest.approx(0.0, abs=0.001)
    assert found["sigma"][0] == pytest.approx(2 * FOUR[2], rel=0.3)
    assert "the new law is better" in capsys.readouterr().out


@pytest.mark.parametrize("seed", range(4, 9))
def test_a_laser_that_is_its_model_is_kept(tmp_path, capsys, seed):
    """Whatever the new law has by chance on scans of one wall is no gain."""
    assert main(wall(tmp_path, seed)) == 1
    told = capsys.readouterr().out
    assert "NO better: keep the model that you have" in told
    assert "nats a reading (90 %: " in told


def test_a_laser_is_judged_by_a_wall_that_was_put_up_again(tmp_path, capsys):
    """Taped 5 mm off: on the scans between those that were fitted the law is better, on another wall it is not."""
    arguments = wall(tmp_path, shift=0.005)
    assert main(arguments) == 0
    rng = np.random.default_rng(9)
    write(tmp_path / "again", recorded([scans(d, rng, gate=3.99) for d in DISTANCES[:4]]))
    assert main([*arguments, "--test", str(tmp_path / "again")]) == 1
    assert "NO better" in capsys.readouterr().out


def test_errors_on_scans_are_those_of_the_law_by_hand(tmp_path, capsys):
    wrong = tmp_path / "wrong.yaml"
    text = MODEL.read_text().replace("datum_offset: 0.058826 ", "datum_offset: 0.055826 ")
    wrong.write_text(text)
    assert main([*wall(tmp_path), "--model", str(wrong)]) == 0
    rows = {
        line.split(",")[0]: line.split()[-2:] for line in capsys.readouterr().out.splitlines() if "rms [mm]" in line
    }
    before, after = map(float, rows["mean off the law"])
    assert before == pytest.approx(3.0, abs=0.15)
    assert after < 0.15


def test_the_laser_needs_as_many_runs_as_distances(tmp_path, capsys):
    arguments = wall(tmp_path)
    arguments.remove("2.0")
    assert main(arguments) == 1
    assert "3 distances, 4 runs with scans" in capsys.readouterr().err


def test_settings_with_a_misspelt_key_are_refused(tmp_path, capsys):
    path = tmp_path / "paper.yaml"
    path.write_text(shipped("launch/paper.yaml").read_text().replace("steady: ", "stead: "))
    with pytest.raises(Error, match=r"paper\.yaml: drive\.steady: is missing"):
        load_options(path)
    assert main(["--settings", str(path), "plan"]) == 1
    assert "drive.steady: is missing" in capsys.readouterr().err

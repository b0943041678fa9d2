# SPDX-License-Identifier: BSD-3-Clause
"""What the critic does with too little, with nothing, and with what is broken: it says what is missing."""

import resource
import subprocess
import sys

import numpy as np
import pytest
from recordings import Bag

from kurumaisu.critic import pipeline
from kurumaisu.critic.app.arrays import criticise_arrays
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.judge import explain
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped

TRUTH = Meta(truth=(0.003, 0.003))


def drive(seconds, *, v=None, w=None, every=0.1, seed=1000):
    """Return command and pose of a robot that follows to the letter, by the midpoint rule, with noisy poses."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 2.0)
    asked = np.column_stack([np.full(len(t), v) if v is not None else rng.uniform(0.2, 0.8, len(t)), np.zeros(len(t))])
    asked[:, 1] = w if w is not None else rng.uniform(-1.0, 1.0, len(t))
    times = np.arange(0.0, seconds, 0.01)
    rate = asked[np.searchsorted(t, times, side="right") - 1]
    theta = np.cumsum(rate[:, 1]) * 0.01
    middle = theta - 0.005 * rate[:, 1]
    path = [np.cumsum(rate[:, 0] * np.cos(middle)) * 0.01, np.cumsum(rate[:, 0] * np.sin(middle)) * 0.01, theta]
    pose = np.column_stack([times + 0.01, *path])[:: round(every / 0.01)]
    pose[:, 1:] += rng.normal(0.0, 0.003, (len(pose), 3))
    return {"command": np.column_stack([t, asked]), "pose": pose}


def write(folder, tables):
    """Write tables as CSV files, by hand."""
    heads = {"command": "t,v,w", "pose": "t,x,y,theta", "scan": "t,r0,r1"}
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in tables.items():
        lines = [",".join(repr(float(x)) for x in row) for row in rows]
        (folder / f"{name}.csv").write_text("\n".join([heads[name], *lines]) + "\n")
    return folder


def test_a_chair_that_was_never_asked_to_move_shows_nothing_and_is_told_what_to_drive():
    found = criticise_arrays({"rest": drive(40.0, v=0.0, w=0.0)}, TRUTH)
    assert found.verdict.verdict == "none"
    assert "the chair was never commanded to move" in found.story.headline
    assert found.verdict.next_experiment is not None
    assert len(found.verdict.next_experiment.separates) > 10
    assert found.verdict.next_experiment.id in found.story.next_drive
    assert any("be detected in this recording: " in line for line in found.story.unexplained)


def test_three_seconds_are_too_short():
    found = criticise_arrays({"short": drive(3.0)}, TRUTH)
    assert found.verdict.verdict == "none"
    assert not found.verdict.causes
    assert "only 2.9 s" in found.story.headline
    assert found.verdict.next_experiment is not None


def test_a_drive_that_shows_much_is_not_told_that_it_shows_nothing():
    found = criticise_arrays({"good": drive(40.0)}, TRUTH, only=["base.gain_*", "base.lag_*"])
    assert found.verdict.verdict == "none"
    assert "be detected" not in found.story.headline
    assert found.verdict.next_experiment is None


def test_a_rate_that_never_changes_is_no_crash():
    found = criticise_arrays({"circle": drive(20.0, v=0.4, w=0.3)}, TRUTH)
    assert found.verdict.verdict in ("none", "confounded")
    assert not found.verdict.causes


@pytest.mark.parametrize(("rows", "said"), [(1, "has 1 reference poses"), (2, "has 2 reference poses")])
def test_too_few_poses_are_counted(rows, said):
    tables = drive(10.0)
    with pytest.raises(Error, match=said):
        criticise_arrays({"few": {**tables, "pose": tables["pose"][:rows]}}, TRUTH)


@pytest.mark.parametrize("pose", [np.empty((0, 4)), np.full((50, 4), np.nan)])
def test_poses_without_a_number_are_said_to_be_missing_and_why(tmp_path, pose):
    write(tmp_path / "run", {**drive(10.0), "pose": pose})
    with pytest.raises(Error, match=r"only command.*pose\.csv") as caught:
        read_recording(tmp_path / "run")
    assert "run/pose.csv: has no rows" in str(caught.value)


def test_a_bag_that_is_cut_anywhere_is_an_error_that_names_it(tmp_path):
    whole = _bag(tmp_path / "whole.bag")
    content = whole.read_bytes()
    for share in (0.0, 0.001, 0.2, 0.5, 0.9, 0.999):
        cut = tmp_path / "cut.bag"
        cut.write_bytes(content[: int(share * len(content))])
        with pytest.raises(Error, match=r"cut\.bag"):
            read_recording(cut)
    assert read_recording(whole).runs[0].pose is not None


def test_a_bag_without_the_topic_says_which_topics_are_needed(tmp_path):
    bag = Bag(tmp_path / "commands.bag", None)
    for k in range(20):
        bag.write("/cmd_vel", bag.twist(0.3, 0.0), 1000.0 + k)
    bag.writer.close()
    with pytest.raises(Error, match=r"/scan.*/ground_truth"):
        read_recording(tmp_path / "commands.bag")


def test_an_empty_bag_is_an_error_that_names_it(tmp_path):
    Bag(tmp_path / "empty.bag", None).writer.close()
    with pytest.raises(Error, match=r"empty\.bag"):
        read_recording(tmp_path / "empty.bag")


def test_scans_alone_are_judged_for_how_they_repeat_themselves():
    rng = np.random.default_rng(1000)
    noise = rng.normal(0.0, 0.004, (40, 31))
    ranges = 2.0 + (noise[:, 1:] + noise[:, :-1]) / np.sqrt(2)  # neighbours share half of their noise: rho 0.5
    scan = np.column_stack([0.1 * np.arange(40), ranges])
    found = criticise_arrays({"still": {"scan": scan}})
    assert found.verdict.verdict == "none"
    assert found.story.headline.startswith("No effect can be named: there is no map")
    (told,) = [line for line in found.story.details if "neighbours correlate by" in line]
    assert float(told.split("correlate by ")[1].split(",")[0]) == pytest.approx(0.5, abs=0.12)


HOURS = """
import sys, numpy as np
from pathlib import Path
from kurumaisu.critic.data import excerpt
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.judge import explain
from kurumaisu.critic.sanity import examination
from kurumaisu.params import load_model, shipped
folder = Path(sys.argv[1])
folder.mkdir()
t = np.arange(0, 36000, 0.05)
turns = t, 5.0 * np.sin(0.04 * t), 5.0 - 5.0 * np.cos(0.04 * t), 0.04 * t  # a circle of 5 m at 0.2 m/s
lines = [f"{a:.2f},{x:.4f},{y:.4f},{h:.4f}" for a, x, y, h in zip(t.tolist(), *(c.tolist() for c in turns[1:]))]
(folder / "pose.csv").write_text("t,x,y,theta\\n" + "\\n".join(lines) + "\\n")
(folder / "command.csv").write_text("t,v,w\\n" + "".join(f"{k},0.2,0.04\\n" for k in range(36000)))
recording = read_recording(folder)
assert len(recording.runs[0].pose.t) == len(t)
assert not examination.examine(recording, load_model(shipped("launch/md100.yaml"))).invalid
pieces = excerpt.bounded(recording)
assert len(pieces.runs) == len(pieces.train) == 6, pieces.train
assert pieces.runs[0].pose.t[0] == 0 and pieces.runs[-1].pose.t[-1] > t[-1] - 0.06
assert all(len(run.pose.t) <= 12001 and len(run.command.t) <= 602 for run in pieces.runs)
assert "10.0 h" in pieces.problems[-1]
"""


def test_ten_hours_are_read_whole_in_bounded_memory(tmp_path):
    def bounded():
        resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000, 3_000_000_000))

    command = [sys.executable, "-c", HOURS, str(tmp_path / "long")]
    done = subprocess.run(command, preexec_fn=bounded, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def _bag(path):
    bag = Bag(path, None)
    for k in range(100):
        bag.write("/cmd_vel", bag.twist(0.3, 0.1), 1000.0 + 0.1 * k)
        bag.write("/ground_truth", bag.pose_stamped(1000.0 + 0.1 * k, (0.03 * k, 0.0, 0.01 * k)), 1000.0 + 0.1 * k)
    bag.writer.close()
    return path


def test_an_answer_that_cannot_be_written_leaves_the_older_one(tmp_path):
    model_file = shipped("launch/md100.yaml")
    write(tmp_path / "in", drive(20.0))
    data, model = read_recording(tmp_path / "in"), load_model(model_file)
    criticism = explain.invalid(data, model, ["a clock jumps"])
    out = tmp_path / "out"
    pipeline.write(criticism, model_file, out)
    (out / "prediction.csv").write_text("of the older answer")
    older = {path.name: path.read_bytes() for path in out.iterdir()}
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    room = len(older["report.html"]) // 2  # [bytes]: the report is the largest; a disk that is full looks the same
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        with pytest.raises(Error, match=r"report\.html: cannot be written: File too large"):
            pipeline.write(
                explain.invalid(read_recording(tmp_path / "in"), load_model(model_file), ["b"]), model_file, out
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == older
    pipeline.write(criticism, model_file, out)
    assert sorted(path.name for path in out.iterdir()) == ["extended.yaml", "report.html", "verdict.json"]

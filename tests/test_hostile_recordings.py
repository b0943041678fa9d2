# SPDX-License-Identifier: BSD-3-Clause
"""Recordings made to hang, or to fill the memory: refused, or called wrong data, in few words and in little of both."""

import bz2
import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from recordings import full_run, write_bag
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import CompressionMode

from kurumaisu.critic.bags import limits
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error, told

UNIX = 1.79e9  # [s] a stamp of this year
MEMORY = 3_000_000_000  # [bytes] of addresses, most of them those of libraries


def tables(folder: Path, stamp, *, x=lambda k: 0.03 * k) -> None:
    """Write a drive of 300 rows; stamp and x: of a row."""
    folder.mkdir(exist_ok=True)
    commands, poses = ["t,v,w"], ["t,x,y,theta"]
    for k in range(300):
        wobble = [0.003 * f(n * k * k) for f, n in ((math.sin, 1), (math.cos, 3), (math.sin, 7))]
        commands.append(f"{stamp(k)!r},0.3,0.0")
        poses.append(f"{stamp(k)!r},{x(k) + wobble[0]!r},{wobble[1]:.4f},{wobble[2]:.4f}")
    (folder / "command.csv").write_text("\n".join(commands) + "\n")
    (folder / "pose.csv").write_text("\n".join(poses) + "\n")


def critic(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the critic with little memory and a deadline."""
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))  # noqa: E731
    code = "import sys; from kurumaisu.critic.app.cli import main; sys.exit(main(sys.argv[1:]))"
    return subprocess.run(
        [sys.executable, "-c", code, str(folder), "-o", str(folder.parent / "out")],
        capture_output=True,
        text=True,
        timeout=100,
        preexec_fn=limit,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    )


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (lambda k: 0.0 if k == 0 else UNIX + 0.1 * k, "more than a day from the others"),
        (lambda k: 0.0 if k == 150 else UNIX + 0.1 * k, "more than a day from the others"),
        (lambda k: 1e300 if k == 299 else 0.1 * k, "more than a day from the others"),
        (lambda k: UNIX * (k >= 150) + 0.1 * k, "more than a day from the others"),
        (lambda k: 80_000.0 * (k // 2) + 0.1 * (k % 2), "lasts 1.192e+07 s"),
    ],
    ids=["first", "middle", "huge", "half", "sparse"],
)
def test_wild_stamps_are_wrong_data(tmp_path, stamp, words):
    tables(tmp_path / "in", stamp)
    said = critic(tmp_path / "in")
    assert said.returncode == 6, said.stderr
    assert words in said.stdout
    assert len(said.stdout) < 3000
    assert "Traceback" not in said.stderr


@pytest.mark.parametrize("x", [1e308, -1e308, 1e13])
def test_numbers_too_large_to_be_true_are_wrong_data(tmp_path, x):
    tables(tmp_path / "in", lambda k: 0.1 * k, x=lambda k: x if k % 7 == 0 else 0.03 * k)
    said = critic(tmp_path / "in")
    assert said.returncode == 6, said.stderr
    assert "too large to be true" in said.stdout


def test_two_clocks_far_apart_are_wrong_data(tmp_path):
    tables(tmp_path / "in", lambda k: 0.1 * k)
    tables(tmp_path / "other", lambda k: UNIX + 0.1 * k)
    (tmp_path / "other/pose.csv").replace(tmp_path / "in/pose.csv")
    said = critic(tmp_path / "in")
    assert said.returncode == 6, said.stderr
    assert "were not recorded at the same time" in said.stdout


@pytest.fixture
def folder(tmp_path):
    write_csv_run(tmp_path / "run_1", full_run())
    return tmp_path


def refusal(folder: Path) -> str:
    with pytest.raises(Error) as raised:
        read_recording(folder)
    assert len(str(raised.value)) < 1000 + len(str(folder))
    return str(raised.value)


def test_tables_with_too_much_in_a_row_are_refused(folder):
    path = folder / "run_1/covariate.csv"
    path.write_text(",".join(["t", *(f"c{i}" for i in range(200_000))]) + "\n")
    assert "has 200001 columns, and at most 20000 are read" in refusal(folder)
    path.write_text(",".join(["u", *(f"c{i}" for i in range(19_000))]) + "\n")
    assert "column 't' is missing; there are: u, c0, c1," in refusal(folder)
    path.write_text(f"t,{'x' * 5000}\n0,1\n")
    assert "name of more than 200 characters" in refusal(folder)
    path.write_text(f"t,{'x' * 1_000_000}\n0,1\n")
    assert "is not a table: field larger than field limit" in refusal(folder)
    (folder / "run_1/pose.csv").write_text(f"t,x,y,theta\n0,0,0,{'9x' * 50_000}\n")
    path.unlink()
    assert "pose.csv:2: column 'theta': is not a number: '9x9x" in refusal(folder)


def test_only_regular_files_of_bounded_size_are_read(folder):
    path = folder / "run_1/pose.csv"
    path.unlink()
    with path.open("wb") as file:
        file.truncate(2**31)
    assert "pose.csv: has 2147483648 bytes or more, and at most 1073741824 are read" in refusal(folder)
    path.unlink()
    path.symlink_to("/dev/zero")
    assert "pose.csv: must be a regular file, and is a device" in refusal(folder)
    path.unlink()
    os.mkfifo(path)
    assert "pose.csv: must be a regular file, and is a pipe" in refusal(folder)
    path.unlink()
    os.mkfifo(folder / "meta.yaml")
    assert "meta.yaml: must be a regular file, and is a pipe" in refusal(folder)


@pytest.mark.parametrize("name", ["a.bag", "a.rawlog"])
def test_a_pipe_is_no_recording(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(Error, match=name):
        read_recording(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: &a [&a []]\n", "meta.yaml"),
        ("topics: &a {b: *a}\n", "anchors"),
        (f"topics: {'[' * 5000}\n", "too many levels"),
        (f"laser: {'9' * 5000}\n", "meta.yaml: "),
        (
            f"truth: {{position_sd: {'9' * 400}, heading_sd: 0}}\n",
            "position_sd: must be a finite number of at least 0: 99",
        ),
        ("truth: {position_sd: 0, heading_sd: 2026-13-45}\n", "meta.yaml"),
        (f"laser: {'x' * 100_000}\n", "laser: must be a mapping, not str 'xxx"),
        ("x" * 2_000_000, "and at most 1048576 are read"),
        (
            "laser: {x: 0, y: 0, yaw: 0, angle_min: 0, angle_increment: 0.1, beams: 1000000000000}\n",
            "beams: must be an integer of 1 to",
        ),
        ("model: /etc/passwd\n", "must be in the recording's folder, or a file of the package"),
        ("model: ../secret.yaml\n", "must be in the recording's folder, or a file of the package"),
        ("world: ../secret.yaml\n", "must be in the recording's folder"),
        ("model: out/secret.yaml\n", "must be in the recording's folder"),
        ("model: run_1\n", "is not a file"),
    ],
    ids=range(14),
)
def test_hostile_meta_is_refused_in_few_words(tmp_path, text, words):
    folder = tmp_path / "in"
    write_csv_run(folder / "run_1", full_run())
    (tmp_path / "secret.yaml").write_text("name: secret\n")
    (folder / "out").symlink_to(tmp_path)
    (folder / "meta.yaml").write_text(text)
    assert words in refusal(folder)


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("a.bag", {"compression": Writer.CompressionFormat.BZ2}),
        ("a.bag", {"compression": Writer.CompressionFormat.LZ4}),
        ("a.mcap", {"compression": "LZ4"}),
        ("a.mcap", {"compression": "ZSTD"}),
        ("a", {"ros": 2, "compression": CompressionMode.MESSAGE}),
    ],
    ids=["bz2", "lz4", "mcap lz4", "mcap zstd", "messages"],
)
def test_a_bag_is_unpacked_to_a_limit(tmp_path, monkeypatch, name, how):
    write_bag(tmp_path / name, full_run(), **how)
    assert read_recording(tmp_path).runs
    monkeypatch.setattr(limits, "LEAST_UNPACKED", 100)
    monkeypatch.setattr(limits, "TIMES_UNPACKED", 0)
    assert f"{name}: has more than" in refusal(tmp_path)
    monkeypatch.setattr(limits, "MOST_UNPACKED", 50)
    assert f"{name}: a chunk has more than 50 bytes unpacked" in refusal(tmp_path)


def test_a_file_of_a_ros2_bag_is_unpacked_to_a_limit(tmp_path, monkeypatch):
    write_bag(tmp_path / "a", full_run(), ros=2, compression=CompressionMode.FILE)
    monkeypatch.setattr(limits, "LEAST_UNPACKED", 100)
    monkeypatch.setattr(limits, "TIMES_UNPACKED", 1)
    assert "a.db3.zstd: has more than" in refusal(tmp_path)


@pytest.mark.parametrize("kind", ["bz2", "lz4", "zstd"])
def test_a_bomb_is_not_unpacked(kind):
    pack = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress}[kind]
    bomb = pack(bytes(100_000_000))
    assert len(bomb) < 500_000
    assert len(limits.UNPACKERS[kind](bomb, 10_000)) == 10_000


def test_values_are_told_in_few_characters():
    loop: list = []
    loop.append(loop)
    wide = ["x"]
    for _ in range(30):
        wide = [wide] * 9
    for value in (
        wide,
        loop,
        "x" * 10**6,
        10**400,
        -(10**5000),
        {k: k for k in range(1000)},
        b"x" * 1000,
        np.zeros(10**6),
    ):
        assert len(told(value)) <= 100
    assert told("a") == "'a'"
    assert told([1, 2.5, None]) == "[1, 2.5, None]"
    assert len(str(Error("x" * 10**6))) <= 1500

# SPDX-License-Identifier: BSD-3-Clause
"""A recording that was split is read by the name that it was recorded by, as if it had not been."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from recordings import full_run, write_bag

from kurumaisu.critic.bags.parts import numbered, parts_of
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error

PARTS = 12  # the eleventh, NAME_10.bag, sorts before the third by name


def between(series, begin, end):
    kept = (series.t >= begin) & (series.t < end)
    return Series(series.t[kept], series.values[kept], series.columns)


@pytest.fixture
def split(tmp_path):
    """The same run as whole.bag, and as drive_0.bag, drive_1.bag, ..."""
    run = full_run()
    write_bag(tmp_path / "whole.bag", run)
    edges = np.linspace(0.0, run.pose.t[-1] + 1.0, PARTS + 1)
    for n, (begin, end) in enumerate(pairwise(edges)):
        parts = {
            name: between(getattr(run, name), begin, end) for name in ("command", "voltage", "pose", "odom", "scan")
        }
        covariates = {name: between(series, begin, end) for name, series in run.covariates.items()}
        write_bag(tmp_path / f"drive_{n}.bag", replace(run, **parts, covariates=covariates))
    return tmp_path


def test_it_is_one_run_and_the_same_as_unsplit(split):
    whole, parts = read_recording(split / "whole.bag"), read_recording(split / "drive.bag")
    assert (parts.name, parts.runs[0].name, len(parts.runs)) == ("drive", "drive", 1)
    for name in ("command", "voltage", "odom", "scan"):
        one, other = (getattr(recording.runs[0], name) for recording in (whole, parts))
        assert len(one.t) >= 20
        np.testing.assert_array_equal(one.t, other.t)
        np.testing.assert_array_equal(one.values, other.values)
    assert set(parts.runs[0].covariates) == set(whole.runs[0].covariates)


def test_a_part_is_a_recording_of_its_own(split):
    (run,) = read_recording(split / "drive_3.bag").runs
    assert run.name == "drive_3"
    assert 0 < len(run.scan.t) < 20


def test_a_bag_of_that_name_is_meant_rather_than_parts(split):
    (split / "whole_0.bag").write_bytes((split / "drive_0.bag").read_bytes())
    assert parts_of(split / "whole.bag") == [split / "whole.bag"]


def test_a_part_that_is_missing_is_named(split):
    (split / "drive_4.bag").unlink()
    with pytest.raises(Error, match=r"drive_4\.bag: is missing, but drive_5\.bag exists"):
        read_recording(split / "drive.bag")


def test_a_part_that_is_damaged_is_named(split):
    (split / "drive_7.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(Error, match=r"drive_7\.bag: is not a complete ROS 1 bag"):
        read_recording(split / "drive.bag")


def test_other_names_are_no_parts(split):
    for name in ("drive_x.bag", "drive_.bag", "drive_1_2.bag", "drive_2.bag.active", "other_1.bag"):
        (split / name).write_bytes(b"")
    assert numbered(split / "drive.bag") == [split / f"drive_{n}.bag" for n in range(PARTS)]
    assert numbered(split / "drive.bag", ".active") == [split / "drive_2.bag.active"]
    with pytest.raises(Error, match="there is no such file or folder"):
        read_recording(split / "none.bag")

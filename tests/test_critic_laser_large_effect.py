# SPDX-License-Identifier: BSD-3-Clause
"""A clock that runs fast or slow until scans are far from where they were taken: no shifted clock, and found."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.search.large_effect import large_effect
from kurumaisu.critic.sanity.examination import examine
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
IDS = frozenset(f"laser.{name}" for name in ("mount_x", "mount_yaw", "latency", "clock_skew", "offset"))
LATER = 400.0  # [s] at which the second of two drives begins


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two drives alike, one after the other, whose clocks agree."""
    data = recording(tmp_path_factory.mktemp("drives"), None, 0.0, 5, scans=60)
    first = data.runs[0]
    second = replace(
        first,
        name="later",
        pose=replace(first.pose, t=first.pose.t + LATER, values=first.pose.values + 1e-6),  # measured anew
        scan=replace(first.scan, t=first.scan.t + LATER),
    )
    return replace(data, runs=(first, second), train=("drive", "later"))


def stamped(data, by):
    """Return the same with other stamps of the scans."""
    return replace(data, runs=tuple(replace(run, scan=replace(run.scan, t=by(run.scan.t))) for run in data.runs))


def test_a_clock_that_drifts_is_not_shifted(made):
    """The second drive alone looks shifted by 0.9 s."""
    drifting, shifted = stamped(made, lambda t: 1.0022 * t), stamped(made, lambda t: t + 0.9)
    assert examine(replace(drifting, runs=drifting.runs[1:]), MODEL).invalid
    assert examine(drifting, MODEL).invalid == []
    assert len(examine(shifted, MODEL).invalid) == 2


def test_a_clock_that_drifts_far_is_found_by_where_readings_belong(made):
    found = large_effect(gather(stamped(made, lambda t: 1.0022 * t), MODEL), IDS)
    assert found.id == "laser.clock_skew"
    assert found.parameters["skew"] == pytest.approx(0.0022, rel=0.1)
    assert large_effect(gather(made, MODEL), IDS) is None


def test_what_several_effects_would_mend_is_left_to_small_changes(made):
    """In one drive a clock that drifts does what a late one does."""
    one = replace(made, runs=made.runs[1:], train=("later",))
    shots = gather(stamped(one, lambda t: 1.0022 * t), MODEL)
    assert np.isfinite(shots.measured).any()
    assert large_effect(shots, IDS) is None

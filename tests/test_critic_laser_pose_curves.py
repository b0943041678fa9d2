# SPDX-License-Identifier: BSD-3-Clause
"""A laser that is elsewhere than the reference says, where that follows something: no effect, and never nothing."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.judge.merge import headline
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


def turned(data, by):
    """Return a recording whose reference's headings err by what a function of times and poses says [rad]."""
    (run,) = data.runs
    poses = run.pose.values.copy()
    poses[:, 2] += by(run.pose.t, poses)
    return replace(data, runs=(replace(run, pose=replace(run.pose, values=poses)),))


def turning_left(times, poses):
    return np.convolve(np.gradient(poses[:, 2], times), np.ones(9) / 9, mode="same") > 0


@pytest.mark.parametrize(
    ("covariate", "by"),
    [
        ("w", lambda t, poses: 0.01 * turning_left(t, poses)),
        ("heading", lambda _, poses: 0.02 * np.sin(2 * poses[:, 2])),
        (None, lambda _, poses: 0.0 * poses[:, 2]),
    ],
)
def test_a_heading_that_errs_with_something_is_told_over_it(tmp_path, covariate, by):
    found = criticise_scans(turned(sparse(recording(tmp_path, None, 0.0, 12, scans=100)), by), MODEL, lambda _: None)
    told = [(one.channel, one.covariate) for one in found.unknown[:1]]
    assert told == ([] if covariate is None else [("reference.heading", covariate)])
    assert found.causes == ()
    if covariate is not None:
        assert found.unknown[0].p > 0.9
        assert "heading" in headline(found)
        assert found.settings == (), "the reference may err: nothing extends the model"

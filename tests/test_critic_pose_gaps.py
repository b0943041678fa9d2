# SPDX-License-Identifier: BSD-3-Clause
"""In a gap of the reference a robot may turn by more than half a turn, of which its headings say nothing."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.critic.base.drive import prepare, prepare_all
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
TIMES = np.arange(0.0, 20.0, 0.05)
WITHOUT = (TIMES > 6.0) & (TIMES < 11.0)


def run_of(w, asked, keep):
    """A robot that turns on the spot, asked for `asked`; its file has headings within half a turn."""
    theta = np.unwrap((w * TIMES[keep] + np.pi) % (2 * np.pi) - np.pi)
    poses = np.column_stack([0 * theta, 0 * theta, theta])
    command = Series(np.array([0.0]), np.array([[0.0, asked]]), ("v", "w"))
    return Run("drive", command=command, pose=Series(TIMES[keep], poses, ("x", "y", "theta")))


@pytest.mark.parametrize("w", [0.9, -0.7, 1.4])
def test_a_gap_turns_by_what_was_asked_for(w):
    run = run_of(w, 1.1 * w, ~WITHOUT)
    for drive in (prepare(run, MODEL), prepare_all(run, MODEL, 20.0)):
        np.testing.assert_allclose(drive.measured[:, 2], w * np.diff(drive.times), atol=1e-9)


def test_where_no_poses_are_missing_headings_are_what_they_are():
    """Another unit, another sign: that is found later, by how far the robot turns."""
    run = run_of(0.9, -0.9 * 57.3, TIMES >= 0)
    drive = prepare(run, MODEL)
    np.testing.assert_allclose(drive.measured[:, 2], 0.9 * np.diff(drive.times), atol=1e-9)
    seldom = run_of(0.9, -51.0, np.arange(len(TIMES)) % 40 == 0)
    np.testing.assert_allclose(prepare(seldom, MODEL).poses, seldom.pose.values)


def test_no_poses_are_no_gap():
    none = Series(np.empty(0), np.empty((0, 3)), ("x", "y", "theta"))
    assert len(prepare_all(replace(run_of(0.9, 0.9, ~WITHOUT), pose=none), MODEL, 20.0).times) == 0

# SPDX-License-Identifier: BSD-3-Clause
"""A reference that errs once is no reference that goes on from elsewhere, however fast the chair drives meanwhile."""

import numpy as np
import pytest

from kurumaisu.critic import sanity_jumps
from kurumaisu.critic.recording import Series

RATE, SPEED, TURN = 30.0, 0.35, 0.3  # [1/s, m/s, rad/s]


def circle(rng, seconds=60.0):
    """Return times (n,) and poses (n, 3) of a chair on a circle."""
    t = np.arange(0.0, seconds, 1 / RATE)
    radius = SPEED / TURN
    poses = np.column_stack([radius * np.sin(TURN * t), radius * (1 - np.cos(TURN * t)), TURN * t])
    return t, poses + 0.002 * rng.standard_normal(poses.shape)


def said(t, poses):
    return sanity_jumps.words(Series(t, poses, ("x", "y", "theta")))


@pytest.mark.parametrize("seed", range(4))
def test_poses_that_are_off_one_by_one_have_not_jumped(seed):
    rng = np.random.default_rng(seed)
    t, poses = circle(rng)
    off = rng.random(len(t)) < 0.03
    poses[off, :2] += 0.06 * rng.standard_normal((off.sum(), 2))
    assert said(t, poses) == []


@pytest.mark.parametrize("seed", range(4))
def test_a_pose_that_goes_on_from_elsewhere_has_jumped(seed):
    rng = np.random.default_rng(seed)
    t, poses = circle(rng)
    angle = rng.uniform(-np.pi, np.pi)
    poses[900:, :2] += 0.12 * np.array([np.cos(angle), np.sin(angle)])
    (line,) = said(t, poses)
    assert "jumps once (first: 0.1" in line
    assert "at t = 30 s" in line

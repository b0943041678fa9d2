# SPDX-License-Identifier: BSD-3-Clause
"""A reference that errs once is no reference that goes on from elsewhere, however fast the chair drives meanwhile."""

import numpy as np
import pytest

from kurumaisu.critic.sanity import pose_jumps
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
RATE, SPEED, TURN = 30.0, 0.35, 0.3  # [1/s, m/s, rad/s]


def circle(rng, seconds=60.0):
    """Return times (n,) and poses (n, 3) of a chair on a circle."""
    t = np.arange(0.0, seconds, 1 / RATE)
    radius = SPEED / TURN
    poses = np.column_stack([radius * np.sin(TURN * t), radius * (1 - np.cos(TURN * t)), TURN * t])
    return t, poses + 0.002 * rng.standard_normal(poses.shape)


def said(t, poses, command=None):
    return pose_jumps.problems(Series(t, poses, ("x", "y", "theta")), command)


@pytest.mark.parametrize("heard", ["command", "voltage", None])
def test_a_chair_that_is_asked_to_be_fast_for_once_has_not_jumped(heard):
    """Half a second of 0.66 m/s in half a minute of 0.3, seen every 0.3 s: 0.2 m between two poses."""
    t = np.arange(0.0, 30.0, 0.3)
    asked = np.array([[0.0, 0.3, 0.0], [20.1, -0.66, 0.0], [20.5, 0.3, 0.0]])
    fine = np.arange(0.0, 30.0, 0.01)
    held = asked[np.searchsorted(asked[:, 0], fine, side="right") - 1, 1]
    x = np.interp(t, fine, np.cumsum(held) * 0.01)
    poses = np.column_stack([x, 0.0 * t, 0.0 * t]) + 0.003 * np.random.default_rng(3).standard_normal((len(t), 3))
    volts = [[MODEL.translation.volts(v), 0.0] for v in asked[:, 1]]
    parts = {
        "command": Series(asked[:, 0], asked[:, 1:], ("v", "w")),
        "voltage": Series(asked[:, 0], np.array(volts), ("v_f", "v_s")),
    }
    run = Run("drive", **{name: part for name, part in parts.items() if name == heard})
    assert bool(said(t, poses, pose_jumps.asked(run, MODEL))) == (heard is None)


def test_a_jump_is_seen_in_a_drive_with_commands():
    rng = np.random.default_rng(5)
    t, poses = circle(rng)
    poses[900:, 0] += 0.12
    (line,) = said(t, poses, Series(np.array([0.0]), np.array([[SPEED, TURN]]), ("v", "w")))
    assert "jumps once" in line


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

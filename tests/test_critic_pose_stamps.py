# SPDX-License-Identifier: BSD-3-Clause
"""Stamps of a reference that say when a pose came, not when it was; gaps and a little jitter are no such fault."""

import numpy as np
import pytest
from phased_drive import phased

from kurumaisu.critic.sanity import pose_jumps
from kurumaisu.critic.values.recording import Series

SEEDS = range(3)


def stamped(seed, rate, stamps):
    """Return what is said of a drive's reference whose stamps (n,) are made of the true ones, and a generator."""
    rng = np.random.default_rng(seed)
    pose = phased(rng, rate=rate).pose
    return pose_jumps.problem(Series(stamps(pose.t, rng), pose.values, pose.columns))


def queued(t, rng, share=0.7, longest=0.3):
    """Return when rows come out of a queue in which a share of them wait, and those behind wait for them."""
    waits = np.where(rng.random(len(t)) < share, rng.uniform(0.0, longest, len(t)), 0.0)
    return np.maximum.accumulate(t + waits) + 1e-4 * np.arange(len(t))


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_queue_in_which_most_rows_wait_is_told(seed, rate):
    said = stamped(seed, rate, queued)
    assert said is not None
    assert "look like times of arrival" in said


def test_a_queue_in_which_each_row_waits_as_long_as_it_likes_is_told():
    for seed in SEEDS:
        assert stamped(seed, 10.0, lambda t, rng: queued(t, rng, share=1.0)) is not None


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_jitter_of_some_milliseconds_is_no_fault(rate):
    for seed in SEEDS:
        assert stamped(seed, rate, lambda t, rng: t + rng.uniform(-0.008, 0.008, len(t))) is None


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
@pytest.mark.parametrize("jitter", [0.0, 0.008])
def test_gaps_are_no_fault(rate, jitter):
    """Some long ones, and a third of all rows besides."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        pose = phased(rng, rate=rate).pose
        kept = rng.random(len(pose.t)) < 0.67
        for begin in rng.uniform(5.0, 55.0, 4):
            kept &= (pose.t < begin) | (pose.t > begin + rng.uniform(0.3, 1.5))
        stamps = pose.t + rng.uniform(-jitter, jitter, len(pose.t))
        assert pose_jumps.problem(Series(stamps[kept], pose.values[kept], pose.columns)) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_few_rows_that_come_late_are_no_fault_of_the_others(seed):
    def few(t, rng):
        waits = np.zeros(len(t))
        waits[rng.choice(len(t), 6, replace=False)] = 0.09  # before the next one
        return t + waits

    assert stamped(seed, 10.0, few) is None


@pytest.mark.parametrize("rate", [10.0, 20.0])
def test_true_stamps_are_no_fault(rate):
    for seed in SEEDS:
        assert stamped(seed, rate, lambda t, _: t) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_gaps_while_the_robot_changes_its_speed_are_no_fault(seed):
    """Of a reference that is lost where the robot stops or sets off: in the gap it had another speed."""
    rng = np.random.default_rng(seed)
    pose = phased(rng, rate=50.0).pose
    speed = np.hypot(*np.diff(pose.values[:, :2], axis=0).T) * 50.0
    changes = pose.t[1:-1][np.abs(np.diff(speed)) > 5 * np.median(np.abs(np.diff(speed)))]
    kept = np.ones(len(pose.t), dtype=bool)
    for begin in rng.choice(changes, 5):
        kept &= (pose.t < begin - 0.5) | (pose.t > begin + 0.7)
    stamps = pose.t + rng.uniform(-0.004, 0.004, len(pose.t))
    assert pose_jumps.problem(Series(stamps[kept], pose.values[kept], pose.columns)) is None

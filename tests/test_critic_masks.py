# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are off for a moment are set aside, with a note where they are; nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from phased_drive import phased, recorded

from kurumaisu.critic.sanity import examination, masks
from kurumaisu.critic.sanity import rows as sanity_rows
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
OFF = np.array([0.4, -0.3, 0.0])  # 0.5 m
UNIX = 1.79e9  # [s] a time of this year


def moved(run, rows, by=OFF):
    """Return a run whose reference is elsewhere in some rows."""
    values = run.pose.values.copy()
    values[rows] += by
    return replace(run, pose=replace(run.pose, values=values))


def judged(run):
    """Return the reference that is left of a run, and what is said."""
    out = masks.set_aside(recorded(run), MODEL)
    return out.runs[0].pose, out.problems


def assert_without(pose, run, rows):
    np.testing.assert_array_equal(pose.t, np.delete(run.pose.t, rows))
    np.testing.assert_array_equal(pose.values, np.delete(run.pose.values, rows, axis=0))


@pytest.mark.parametrize("start", [0.0, UNIX])
@pytest.mark.parametrize("seed", range(3))
def test_a_row_that_is_off_alone_is_set_aside(seed, start):
    """The note has the time by the run's clock to the millisecond: 1.79e+09 s would find no row."""
    run = moved(phased(np.random.default_rng(seed), start=start), [500])
    pose, (told,) = judged(run)
    assert_without(pose, run, [500])
    assert f"off at t = {start + 25.01:.2f} s: 1 of its 1200 rows set aside" in told


@pytest.mark.parametrize("start", [0.0, UNIX])
@pytest.mark.parametrize("seed", range(3))
def test_an_excursion_of_a_second_is_set_aside(seed, start):
    rows = np.arange(500, 520)
    run = moved(phased(np.random.default_rng(seed), start=start), rows)
    pose, (told,) = judged(run)
    assert_without(pose, run, rows)
    assert f"off at t = {start + 25.01:.2f} s to {start + 25.96:.2f} s: 20 of its 1200 rows set aside" in told


def test_rows_that_repeat_the_one_before_while_the_robot_moves_are_set_aside():
    run = phased(np.random.default_rng(2))
    values = run.pose.values.copy()
    moving, resting = 150, 350  # in a curve, and at a stand
    for row in (moving, resting):
        values[row + 1 : row + 4] = values[row]
    run = replace(run, pose=replace(run.pose, values=values))
    pose, (told,) = judged(run)
    assert_without(pose, run, np.arange(moving + 1, moving + 4))
    assert f"repeats itself while the robot moves at t = {run.pose.t[moving + 1]:.2f}" in told


def test_rows_that_repeat_while_the_robot_speeds_up_are_told_too():
    """It moves less meanwhile than behind them, and more than before."""
    t = np.arange(0.0, 20.0, 0.05)
    values = np.zeros((len(t), 3))
    values[:, 0] = 0.05 * np.cumsum(np.clip(0.3 + 2.0 * (t - 10.0), 0.3, 1.2))
    values[201:204] = values[200]
    np.testing.assert_array_equal(
        np.flatnonzero(sanity_rows.stale(Series(t, values, ("x", "y", "theta")))), [201, 202, 203]
    )


@pytest.mark.parametrize("later", [[], [530]])
def test_a_row_that_is_off_behind_a_gap_is_set_aside(later):
    """How far the chair may have driven in the gap hides its way out, not its way back, which ends at no other row."""
    run = moved(phased(np.random.default_rng(1)), [500, *later], 2 * OFF)
    run = replace(run, pose=run.pose.rows(np.r_[np.arange(470), np.arange(500, len(run.pose.t))]))
    pose, _ = judged(run)
    assert_without(pose, run, [470, *(row - 30 for row in later)])


@pytest.mark.parametrize("row", [0, 1199])
def test_a_row_that_is_off_at_an_end_is_set_aside(row):
    run = moved(phased(np.random.default_rng(1)), [row], 4 * OFF)
    pose, (told,) = judged(run)
    assert_without(pose, run, [row])
    assert f"off at t = {run.pose.t[row]:.2f} s: 1 of its 1200 rows set aside" in told


def test_a_reference_without_noise_that_stops_and_goes_repeats_nothing():
    t = np.arange(0.0, 40.0, 0.05)
    x = np.cumsum(0.05 * np.where(t % 2 < 1.2, 0.4, 0.0))
    pose = Series(t, np.column_stack([x, 0 * x, 0 * x]), ("x", "y", "theta"))
    assert not sanity_rows.stale(pose).any()


@pytest.mark.parametrize("rows", [[500, 502], [500, 502, 504], [500, 503], [500, 501], [500, 501, 503]])
def test_rows_that_are_off_by_turns_with_good_ones_are_set_aside(rows):
    run = moved(phased(np.random.default_rng(1)), rows)
    pose, _ = judged(run)
    assert_without(pose, run, rows)


def test_a_reference_that_jumps_about_until_it_is_back_is_set_aside():
    run = moved(moved(moved(phased(np.random.default_rng(2)), [500]), np.arange(501, 504), -2 * OFF), [503], 3 * OFF)
    pose, (told,) = judged(run)
    assert_without(pose, run, np.arange(500, 504))
    assert "4 of its 1200 rows set aside" in told


@pytest.mark.parametrize("seed", range(3))
def test_what_the_chair_drives_meanwhile_does_not_keep_a_reference_away(seed):
    """At 5 Hz it drives 0.4 m while the reference is elsewhere."""
    run = phased(np.random.default_rng(seed), rate=5.0)
    for row, by in ((130, [0.3, 0.0, 0.0]), (131, [0.5, 0.4, 0.0]), (132, [0.3, -0.4, 0.0]), (133, [0.5, 0.3, 0.0])):
        run = moved(run, [row], np.array(by))
    pose, (told,) = judged(run)
    assert_without(pose, run, np.arange(130, 134))
    assert "4 of its 300 rows set aside" in told


@pytest.mark.parametrize("rows", [[500], [500, 501, 502]])
@pytest.mark.parametrize("by", [[0.02, -0.02, 0.0], [0.0, 0.0, 0.15]])
def test_rows_that_are_off_by_less_than_a_jump_are_set_aside(rows, by):
    run = moved(phased(np.random.default_rng(4)), rows, by)
    pose, (told,) = judged(run)
    assert_without(pose, run, rows)
    assert f"off for a moment at t = 25.01 s: {len(rows)} of its 1200 rows set aside" in told


@pytest.mark.parametrize("late", [0.1, 0.4])
def test_a_chair_that_is_late_is_off_for_long_and_nothing_is_set_aside(late):
    run = phased(np.random.default_rng(5))
    later = replace(run, pose=replace(run.pose, t=run.pose.t + late))
    pose, told = judged(later)
    assert told == ()
    assert len(pose.t) == len(run.pose.t)


def test_several_of_them_are_told_in_one_line():
    rows = [300, *range(500, 510), 800]
    run = moved(phased(np.random.default_rng(4)), rows)
    pose, (told,) = judged(run)
    assert_without(pose, run, rows)
    assert "at t = 15.01 s, and 2 more: 12 of its 1200 rows set aside (1 %)" in told


def test_a_reference_that_stays_elsewhere_is_wrong_data():
    """Nobody knows which of the two places is right."""
    run = moved(phased(np.random.default_rng(5), start=UNIX), slice(500, None))
    pose, told = judged(run)
    assert (len(pose.t), told) == (1200, ())
    (line,) = examination.examine(recorded(run), MODEL).invalid
    assert "jumps once (first: 0." in line
    assert f"at t = {UNIX + 25.01:.2f} s" in line


def test_a_reference_that_is_off_often_is_not_made_a_good_one():
    run = moved(phased(np.random.default_rng(6)), np.arange(50, 1150, 15))  # one row in sixteen
    assert judged(run) == (run.pose, ())


def test_poses_that_were_worked_out_are_left_as_they_are():
    run = replace(moved(phased(np.random.default_rng(7)), [500]), pose_source="the odometry")
    assert judged(run) == (run.pose, ())


@pytest.mark.parametrize("rate", [10.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_a_good_reference_is_left_as_it_is(noise, rate):
    for seed in range(5):
        run = phased(np.random.default_rng(seed), noise=noise, rate=rate)
        assert judged(run) == (run.pose, ())

# SPDX-License-Identifier: BSD-3-Clause
"""Times in which the chair was held are set aside; one that does not move for another reason was not held."""

from dataclasses import replace

import numpy as np
import pytest
from phased_drive import PHASE, PHASES, RATES, phased, recorded

from kurumaisu.critic import criticise
from kurumaisu.critic.base.drive import prepare, without_spans
from kurumaisu.critic.sanity import contacts, masks
from kurumaisu.critic.values.recording import Recording, Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
AHEAD = 8 * PHASE  # [s] when a phase of straight driving begins, as another one did before
HELD = (AHEAD + 1.0, AHEAD + 4.0)
UNIX = 1.79e9  # [s] a time of this year


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("start", [0.0, UNIX])
def test_a_chair_that_is_held_for_three_seconds_is_told_with_time_and_place(seed, start):
    run = phased(np.random.default_rng(seed), held=HELD, start=start)
    out = masks.set_aside(recorded(run), MODEL)
    ((first, end),) = out.runs[0].aside
    assert first == pytest.approx(start + HELD[0], abs=0.5)
    assert start + HELD[1] < end < start + HELD[1] + 1.5
    (told,) = out.problems
    x, y = (np.interp(first, run.pose.t, run.pose.values[:, i]) for i in range(2))
    assert told.startswith(f"run_1: the chair is held from t = {first:.3f}".rstrip("0"))
    assert f"x {x:.2f}, y {y:.2f} m: a contact? {end - first:.1f} s set aside" in told


def test_a_chair_that_is_held_is_seen_by_a_reference_of_uncertain_headings():
    """Half a degree: between two rows 0.4 s apart it seems to turn by 0.03 rad/s."""
    run = phased(np.random.default_rng(3), held=HELD)
    noise = np.random.default_rng(4).normal(0.0, [0.003, 0.003, 0.009], run.pose.values.shape)
    run = replace(run, pose=replace(run.pose, values=run.pose.values + noise))
    ((first, end),) = contacts.contacts(run, MODEL)
    assert first == pytest.approx(HELD[0], abs=0.6)
    assert HELD[1] - 0.2 < end < HELD[1] + 1.5


def test_a_chair_that_is_held_while_other_rates_are_asked_for_is_seen():
    """Of each alone it is asked for too short a time to tell."""
    held = 7 * PHASE - 0.6, 7 * PHASE + 0.9
    ((first, end),) = contacts.contacts(phased(np.random.default_rng(7), held=held), MODEL)
    assert first == pytest.approx(held[0], abs=0.5)
    assert held[1] - 0.2 < end < held[1] + 1.5


@pytest.mark.parametrize("late", [0.3, 0.5])
def test_a_chair_that_answers_late_is_not_held_each_time_it_starts(late):
    for seed in range(5):
        run = phased(np.random.default_rng(seed), noise=0.002)
        assert contacts.contacts(replace(run, pose=replace(run.pose, t=run.pose.t + late)), MODEL) == ()


def test_what_it_did_while_it_was_held_is_not_judged():
    run = phased(np.random.default_rng(3), held=HELD)
    spans = contacts.contacts(run, MODEL)
    drive = prepare(run, MODEL)
    pieces = without_spans(drive, spans)
    assert [piece.times[0] > HELD[1] for piece in pieces] == [False, True]
    assert all((piece.times[-1] <= HELD[0] + 0.5) | (piece.times[0] >= HELD[1]) for piece in pieces)
    kept = sum(len(piece.times) for piece in pieces)
    assert len(drive.times) - 50 < kept < len(drive.times) - 30
    assert without_spans(drive, ()) == [drive]


def test_a_quantity_that_says_so_is_believed_whatever_the_chair_does():
    t = np.arange(0.0, 60.0, 0.5)
    collision = Series(t, ((t >= 20.0) & (t < 22.0))[:, None].astype(float), ("collision",))
    run = replace(phased(np.random.default_rng(4), held=HELD), covariates={"collision": collision, "warmth": collision})
    out = masks.set_aside(recorded(run), MODEL)
    ((first, end),) = out.runs[0].aside
    assert 19.0 < first < 20.0
    assert 22.0 < end < 23.5
    assert set(out.runs[0].covariates) == {"warmth"}  # nothing follows it


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.005])
@pytest.mark.parametrize("rate", [10.0, 20.0])
def test_nothing_holds_a_chair_that_rests_when_it_is_asked_to(noise, rate):
    for seed in range(5):
        assert contacts.contacts(phased(np.random.default_rng(seed), noise=noise, rate=rate), MODEL) == ()


@pytest.mark.parametrize("zone", [0.05, 0.12])
def test_what_a_dead_zone_swallows_is_no_contact(zone):
    """It does so wherever as little is asked for."""
    for seed in range(5):
        run = phased(np.random.default_rng(seed), [*RATES, (0.11, 0.0), (0.0, 0.11)], zone=zone)
        assert contacts.contacts(run, MODEL) == ()


def test_a_dead_zone_of_both_rates_is_no_contact_where_the_chair_turns_at_the_same_speed_elsewhere():
    turning = [(0.15, 0.6), (0.15, -0.6), (-0.15, 0.5), (0.15, 0.4)]
    for seed in range(5):
        run = phased(np.random.default_rng(seed), [(0.15, 0.15), *turning], zone=0.2)
        assert contacts.contacts(run, MODEL) == ()


def test_a_chair_that_hardly_ever_moves_is_not_held_every_time():
    """Then it may be dead, or have another law: that is for the critic to say."""
    run = phased(np.random.default_rng(5), [(0.3, 0.0), (0.0, 0.0)], held=(6.0, PHASE * PHASES))
    assert contacts.contacts(run, MODEL) == ()


def test_nobody_knows_what_a_chair_did_where_it_was_not_seen():
    run = phased(np.random.default_rng(6), held=HELD)
    seen = (run.pose.t < HELD[0]) | (run.pose.t > HELD[1])
    pose = Series(run.pose.t[seen], run.pose.values[seen], run.pose.columns)
    assert contacts.contacts(replace(run, pose=pose), MODEL) == ()
    assert contacts.contacts(replace(run, pose_source="the odometry"), MODEL) == ()
    assert contacts.contacts(replace(run, command=None), MODEL) == ()


def test_a_chair_that_was_held_once_is_told_of_what_it_does_elsewhere():
    """Three seconds of standing would pass for a slower chair, or for one that slips."""
    runs = []
    for seed in range(2):
        run = phased(np.random.default_rng(seed), held=HELD if seed else None)
        pose = replace(run.pose, values=run.pose.values * [1.1, 1.1, 1.0])
        runs.append(replace(run, name=f"run_{seed}", pose=pose))
    data = Recording("held", tuple(runs), train=("run_0", "run_1"))
    ids = frozenset({"base.gain_v", "base.gain_w", "base.dead_zone_v"})
    verdict = criticise(data, shipped("launch/md100.yaml"), lambda _: None, ids=ids).verdict
    assert (verdict.verdict, [cause.id for cause in verdict.causes]) == ("named", ["base.gain_v"])
    assert verdict.causes[0].parameters["gain"].estimate == pytest.approx(0.1, abs=0.01)
    assert any("run_1: the chair is held" in problem for problem in verdict.problems)

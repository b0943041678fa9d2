# SPDX-License-Identifier: BSD-3-Clause
"""What a drive would tell, before it is driven: against exact Gaussian algebra, and against what it then tells."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from kurumaisu.bench.critic import next_experiment as bench
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.experiment import design, plan, rehearse
from kurumaisu.critic.experiment.design import DrivePrediction, divergence, left_over
from kurumaisu.errors import Error
from kurumaisu.experiments import samples, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import driven_as, load_model, shipped, shipped_robot

MD100 = load_model(shipped("launch/md100.yaml"))


def prediction(rng, k, n=6):
    root = rng.standard_normal((k, k))
    return DrivePrediction(rng.standard_normal(n), rng.standard_normal((n, k)), root @ root.T)


def whole(p):
    return np.eye(len(p.mean)) + p.slopes @ p.covariance @ p.slopes.T


@pytest.mark.parametrize(("k", "m"), [(1, 2), (2, 0), (0, 1), (0, 0)])
def test_divergence_is_the_mean_log_ratio_of_the_densities(k, m):
    rng = np.random.default_rng(4)
    a, b = prediction(rng, k), prediction(rng, m)
    one, other = (multivariate_normal(p.mean, whole(p)) for p in (a, b))
    draws = one.rvs(400_000, random_state=5)
    logs = one.logpdf(draws) - other.logpdf(draws)
    assert divergence(a, b) == pytest.approx(logs.mean(), abs=5 * logs.std() / np.sqrt(len(logs)))
    assert divergence(a, a) == pytest.approx(0.0, abs=1e-9)


def test_a_signal_that_the_rival_can_imitate_leaves_nothing():
    rng = np.random.default_rng(6)
    slopes, free = rng.standard_normal((50, 2)), np.zeros((2, 2))
    other = rng.standard_normal(50)
    other -= slopes @ np.linalg.lstsq(slopes, other, rcond=None)[0]
    assert left_over(slopes @ [3.0, -2.0], slopes, free) == pytest.approx(0.0, abs=1e-9)
    assert left_over(slopes @ [3.0, -2.0] + other, slopes, free) == pytest.approx(0.5 * other @ other)
    assert left_over(other, slopes[:, :0], np.zeros((0, 0))) == pytest.approx(0.5 * other @ other)


def test_power_is_that_of_a_likelihood_ratio():
    """The log ratio of N(d, 1) and N(0, 1) under the first scatters about d^2 / 2."""
    d = 3.0
    draws = np.random.default_rng(7).normal(d, 1.0, 400_000)
    decided = np.mean(norm.logpdf(draws, d) - norm.logpdf(draws, 0.0) >= np.log(9))
    assert plan.power(d**2 / 2) == pytest.approx(decided, abs=0.003)
    assert plan.power(0.0) == 0.0
    runs = plan.repeats(1.0)
    assert plan.power(runs * 1.0) >= 0.95 > plan.power((runs - 1) * 1.0)
    assert plan.repeats(0.0) == np.inf


@pytest.mark.parametrize("name", ["steps_big", "circles_slow_fast", "steering_sweep", "standstill"])
def test_a_planned_drive_goes_where_the_simulated_chair_does(name):
    """An independent way: the simulator with its bodies, step by step, from voltages."""
    script = shipped_script(name)
    planned = design.planned(script, MD100, ())
    run = rehearse.rehearse(name, shipped("launch/md100.yaml"), None, 1).runs[0]
    ends = [run.pose.values[np.searchsorted(run.pose.t, t - 1e-6)] for t in planned.times]
    assert np.abs(planned.poses[:, :2] - np.array(ends)[:, :2]).max() < 0.03  # sd 0.005, and a step's delay
    assert planned.times[-1] == pytest.approx(script.seconds, abs=0.11)


def rows(*question, model=MD100):
    causes = [plan.cause(model, text) for text in question]
    return {row.script.name: row for row in plan.plan(model, plan.noise(), causes)}


def test_the_plan_knows_what_the_textbook_knows():
    slip = rows("base.lateral_slip=0.05", "base.marker_x=0.02")
    assert slip["forward_reverse_turns"].power > 0.95
    assert slip["straight_three_speeds"].seconds == np.inf
    assert all(row.seconds == np.inf for row in rows("base.cross_w_to_v", "base.marker_y").values())
    gain = rows("base.gain_v=0.05", "base.dead_zone_v=0.03")
    assert gain["straight_three_speeds"].nats > 5 * gain["there_and_back"].nats  # three speeds against one
    small, large = rows("base.lag_w=0.05"), rows("base.lag_w=0.1")
    assert large["spin_both_ways"].nats == pytest.approx(4 * small["spin_both_ways"].nats, rel=0.25)
    assert small["straight_three_speeds"].nats == 0.0
    assert "steering_sweep" in small
    assert "steering_sweep" not in rows("base.lag_w=0.05", model=driven_as(MD100, shipped_robot("velocity")))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("base.lag", "'base.lag' is no effect on the base; did you mean base.lag_"),
        ("laser.offset", "is no effect on the base"),
        ("base.lag_v=fast", "'base.lag_v=fast': the size must be a number"),
        ("base.lag_v=-1", "tau must be 0 to 3 s"),
        ("base.lag_v=nan", "tau must be 0 to 3 s"),
    ],
)
def test_a_question_that_cannot_be_asked_is_refused(text, words, capsys):
    with pytest.raises(Error, match=words):
        plan.cause(MD100, text)
    assert plan.main(["--detect", text]) == 1
    assert "critic plan: " in capsys.readouterr().err


def test_plan_prints_a_table(capsys):
    assert plan.main(["--between", "base.lateral_slip", "base.marker_x"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[2].startswith("forward_reverse_turns")
    assert "never" in said[-2]


def test_a_rehearsal_is_a_recording_that_the_critic_reads(tmp_path, capsys):
    assert rehearse.main(["spin_both_ways", "room_poses", "-o", str(tmp_path), "--seed", "3"]) == 0
    recording = read_recording(tmp_path)
    assert recording.problems == ()
    runs = {run.name: run for run in recording.runs}
    assert len(runs) == 9
    spin = runs["spin_both_ways"]
    asked = samples(shipped_script("spin_both_ways").phases, PERIOD)
    assert np.array_equal(np.column_stack([spin.command.t, spin.command.values]), asked)
    assert np.ptp(spin.pose.values[:, 2]) == pytest.approx(0.6 * 7.8, abs=0.05)
    place = runs["room_poses_place_2"]
    assert place.command is None
    assert place.voltage is None
    assert place.pose.values.mean(axis=0) == pytest.approx([2.5, 2.5, 2.0], abs=0.01)  # room.world starts at (1.5, 2)
    assert place.scan.values.shape[1] == 682


def test_a_rehearsal_stops_where_the_chair_hits_a_wall(tmp_path, capsys):
    text = shipped("launch/experiments/there_and_back.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(text.replace("world: hall.world", "world: wall.world"))
    assert rehearse.main([str(tmp_path / "mine.yaml"), "-o", str(tmp_path / "out")]) == 1
    assert "mine: the chair touches something at" in capsys.readouterr().err


def test_the_proposed_experiment_decides_and_nothing_is_proposed_where_nothing_is_open():
    """Drives by a generator that shares no code with the effects. One speed ahead: slip or marker? Seed 1 of many."""
    story = bench.tell(bench.PAIRS[0], 1, 1)
    assert story.first.verdict == "confounded"
    assert {"base.lateral_slip", "base.marker_x"} <= set(story.first.confounded[0])
    proposal = story.first.next_experiment
    assert proposal.id in ("forward_reverse_turns", "circles_slow_fast")
    assert {"base.lateral_slip", "base.marker_x"} <= set(proposal.separates)
    assert proposal.expected_nats > 5
    assert story.right
    assert story.last.next_experiment is None

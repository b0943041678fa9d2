# SPDX-License-Identifier: BSD-3-Clause
"""Which effects are looked for on which drives, how they are fitted, and exact doubles said as a set."""

from dataclasses import replace

import hidden_effect
import numpy as np
import pytest
from hidden_effect import recording, recording_of
from scipy import optimize

from kurumaisu.critic import pipeline
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine import least_squares
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import explain
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.effects import Parameter
from kurumaisu.params import load_model, shipped

MD100 = shipped("launch/md100.yaml")
NOISE = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)


def candidates(commands):
    rng = np.random.default_rng(1)
    made = recording_of("some", [hidden_effect.drive(commands, None, 0.0, rng, hidden_effect.USUAL)])
    model = load_model(MD100)
    problem = Problem([prepare(run, model) for run in made.runs], model, NOISE)
    return {candidate.id for candidate in problem.candidates}


def test_effects_that_the_drives_cannot_show_are_not_looked_for():
    t = np.arange(0.0, 40.0, 2.0)
    forward = candidates(np.column_stack([t, 0.3 + 0.1 * (t % 3), 0.0 * t]))
    assert {"base.gain_v", "base.veer", "base.lag_v"} <= forward
    assert not {"base.reverse_gain", "base.caster_reversal", "base.gain_w", "base.marker_x", "base.backlash"} & forward
    both = candidates(np.column_stack([t, 0.4 * (-1.0) ** (t // 4), 0.3 * np.sin(t)]))
    assert {"base.reverse_gain", "base.caster_reversal", "base.gain_w", "base.marker_x", "base.backlash"} <= both


def with_lever(data, x, y):
    """Poses of a marker elsewhere on the chair, by its own trigonometry."""
    runs = []
    for run in data.runs:
        poses = run.pose.values.copy()
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        poses[:, 0] += c * x - s * y
        poses[:, 1] += s * x + c * y
        runs.append(replace(run, pose=replace(run.pose, values=poses)))
    return replace(data, runs=tuple(runs))


def test_a_lever_to_the_side_is_exactly_a_leak_of_turns_and_said_as_a_set():
    found = pipeline.criticise(with_lever(recording(None, 0.0, 71, 40.0), 0.0, 0.05), MD100, lambda _: None)
    verdict = found.verdict
    assert verdict.verdict == "confounded"
    assert verdict.confounded == (("base.cross_w_to_v", "base.marker_y"),)
    assert "scans of a known map tell what the reference measures" in found.story.next_drive
    assert verdict.causes == ()


def test_a_set_of_which_nothing_matters_is_not_told(monkeypatch):
    for share in ("share_of_way", "share_of_noise"):
        monkeypatch.setattr(explain, share, lambda problem, settings, without: 0.0)
    verdict = pipeline.criticise(with_lever(recording(None, 0.0, 71, 40.0), 0.0, 0.05), MD100, lambda _: None).verdict
    assert (verdict.verdict, verdict.confounded) == ("none", ())


def test_a_lever_ahead_is_named_and_measured():
    verdict = pipeline.criticise(with_lever(recording(None, 0.0, 72, 40.0), 0.04, 0.0), MD100, lambda _: None).verdict
    assert [cause.id for cause in verdict.causes] == ["base.marker_x"]
    lever = verdict.causes[0].parameters["x"]
    assert lever.lo90 < lever.hi90
    assert lever.estimate == pytest.approx(0.04, abs=0.005)


class Curve:
    """y = a (1 - exp(-t / b)) with noise, as a problem of two parameters."""

    def __init__(self):
        self.t = np.linspace(0, 5, 60)
        self.y = 2.0 * (1 - np.exp(-self.t / 1.5)) + 0.02 * np.random.default_rng(4).standard_normal(60)

    def residual(self, terms, values):
        return (self.y - values[0] * (1 - np.exp(-self.t / values[1]))) / 0.02

    def linearised(self, terms, values, of):
        here, columns = self.residual(terms, values), []
        for i in range(len(terms)):
            if terms[i] in of:
                moved = values + 1e-6 * np.eye(2)[i]
                unit = terms[i].step * terms[i].parameter.scale
                columns.append((here - self.residual(terms, moved)) / 1e-6 * unit)
        return here, np.column_stack(columns)


@pytest.mark.parametrize("most", [10.0, 1.8], ids=["inside", "at the bound"])
def test_least_squares_against_scipy(most):
    problem = Curve()
    terms = [
        Term("one", Parameter("a", "1", null=0.0, scale=1.0, lower=0.0, upper=most), 0.0),
        Term("two", Parameter("b", "1", null=0.0, scale=0.5, lower=0.1, upper=9.0), 0.0),
    ]
    ours = least_squares.least_squares(problem, terms, np.array([0.5, 0.5]))
    theirs = optimize.least_squares(lambda x: problem.residual(terms, x), [0.5, 0.5], bounds=([0, 0.1], [most, 9.0]))
    np.testing.assert_allclose(ours.values, theirs.x, atol=1e-3)
    assert ours.cost == pytest.approx(theirs.cost, abs=0.02)
    if most > 2:
        sds = np.sqrt(np.diag(np.linalg.inv(theirs.jac.T @ theirs.jac)))
        np.testing.assert_allclose(ours.sds, sds, rtol=0.02)

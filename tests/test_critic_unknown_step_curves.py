# SPDX-License-Identifier: BSD-3-Clause
"""Curves that jump, against the catalogue and against noise."""

from dataclasses import replace

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu import effects
from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.unknown import sentences, shapes
from kurumaisu.critic.unknown.comparison import compare
from kurumaisu.critic.unknown.curves import Design
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.effect_likeness import EffectLikeness
from kurumaisu.critic.unknown.joint_fit import fit_with_curve
from kurumaisu.critic.unknown.step_curves import StepCurve, gains_over_own_rate, step_curves


def problem_of(recording):
    return Problem(
        [with_covariates(prepare(run, hidden.MODEL), run) for run in recording.runs], hidden.MODEL, hidden.USUAL
    )


@pytest.fixture(scope="module")
def slipping():
    """Return a chair that turns a third less than asked to from 0.4 rad/s on, and a limit of its yaw rate, fitted."""
    slip = hidden.Kind(2, "w", lambda s, a, b: s.w * (abs(s.w) > 0.4))
    problem = problem_of(hidden.make(slip, 60.0, 1004, seconds=40.0, runs=2).recording)
    return problem, problem.fit(["base.saturation"], {}), problem.fit_candidates((), {})


def test_a_jump_beats_an_effect_that_has_a_corner_near_by(slipping):
    problem, limit, empty = slipping
    rivalry = compare(problem, SearchResult((limit, empty), {"base.saturation": 1.0}, (), 0.0))
    assert (rivalry.winner.curve.id, rivalry.winner.fit.ids) == ("smooth.w_gain.abs_w", frozenset())
    assert isinstance(rivalry.winner.curve.basis, StepCurve)
    assert rivalry.p_effects["base.saturation"] < 0.01
    smooth = max(r.log_posterior for r in rivalry.rivals if not isinstance(r.curve.basis, StepCurve))
    assert rivalry.winner.log_posterior > smooth + 10  # eight knots draw it far worse


def test_a_jump_is_told_and_written_where_it_is(slipping):
    problem, _, empty = slipping
    best = compare(problem, SearchResult((empty,), {}, (), 1.0)).winner
    extension = fit_with_curve(problem, best.fit, best.curve, best.evidence.prior)
    found = shapes.shape_of(extension)
    assert found.place[1] - 0.01 < 0.4 < found.place[2] + 0.01  # these drives have no rate just there
    assert found.place[1] <= found.place[0] <= found.place[2]
    assert found.place[2] - found.place[1] < 0.06
    assert sentences.shape(extension, intervals=False).startswith("it jumps at 0.")
    effects.check((extension.unknown,))  # the simulator takes it
    v, w = np.full(3, 0.2), np.array([0.3, 0.5, -0.5])
    moved = effects.by_id(extension.unknown.id)(extension.unknown.parameters, None).apply(effects.Motion(0.01, v, w))
    np.testing.assert_allclose(moved.w / w - 1, extension.coefficients[[0, 1, 1]], atol=1e-12)
    assert abs(extension.coefficients[0]) < 0.05 < abs(extension.coefficients[1])
    at = shapes.grid(extension)  # a picture has both sides of it
    assert {float(knot) for knot in best.curve.basis.knots} <= {float(x) for x in at}


def test_noise_alone_rarely_jumps():
    """The mean of exp(evidence) over noise is 1, for any place that is looked for: that is what its prior is for."""
    problem = problem_of(hidden.make(hidden.KINDS["gully"], 10.0, 1005, seconds=20.0, runs=1).null)
    empty = problem.fit_candidates((), {})
    curves = list(gains_over_own_rate(Design(problem, ()).curves))[:4]
    rng, drive, found = np.random.default_rng(3), problem.drives[0], []
    for _ in range(60):
        noisy = replace(drive, poses=drive.poses + rng.normal(0.0, 0.005, drive.poses.shape))
        found += [belief.nats for _, belief in step_curves(problem.changed(drives=[noisy]), empty, curves)]
    assert len(found) == 240
    assert np.mean(np.array(found) > np.log(20)) <= 0.05


def test_what_jumps_is_no_other_form_of_what_does_not(slipping):
    """A curve that draws an effect speaks for it, but a jump that explains far more than its equation does not."""
    problem, limit, empty = slipping
    best = compare(problem, SearchResult((empty,), {}, (), 1.0)).winner
    assert EffectLikeness(problem, limit, Designs(problem, limit)).drawn(empty, best.curve, best.evidence) == {}


def test_a_jump_that_does_what_an_effect_does_speaks_for_it():
    """A chair that goes back by less than it goes forward has a gain that jumps where the speed changes its sign."""
    backward = hidden.Kind(0, "v", lambda s, a, b: s.v * (s.v < 0))
    problem = problem_of(hidden.make(backward, 40.0, 1006, seconds=40.0, runs=2).recording)
    right, empty = problem.fit(["base.reverse_gain"], {}), problem.fit_candidates((), {})
    rivalry = compare(problem, SearchResult((right, empty), {"base.reverse_gain": 1.0}, (), 0.0))
    assert rivalry.winner is None
    assert rivalry.odds["base.reverse_gain"] > 10


def test_a_tyre_that_goes_flat_bends_the_way_from_then_on_and_is_no_veer():
    flat = hidden.Kind(2, "time", lambda s, a, b: s.v * (s.time > 25))
    problem = problem_of(hidden.make(flat, 40.0, 1010, seconds=40.0, runs=2).recording)
    veer, empty = problem.fit(["base.veer"], {}), problem.fit_candidates((), {})
    rivalry = compare(problem, SearchResult((veer, empty), {"base.veer": 1.0}, (), 0.0))
    assert (rivalry.winner.curve.id, rivalry.winner.fit.ids) == ("smooth.curvature.time", frozenset())
    assert rivalry.p_effects["base.veer"] < 0.1
    extension = fit_with_curve(problem, empty, rivalry.winner.curve, rivalry.winner.evidence.prior)
    found = shapes.shape_of(extension)
    assert found.place[1] - 0.1 < 25 < found.place[2] + 0.1
    assert sentences.channel(extension.curve) == "base.w"
    assert sentences.shape(extension, intervals=False).endswith(" rad/m")

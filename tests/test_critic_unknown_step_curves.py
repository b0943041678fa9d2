# SPDX-License-Identifier: BSD-3-Clause
"""Curves that jump, against the catalogue and against noise."""

from dataclasses import replace

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu import effects
from kurumaisu.critic.search import search
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.critic.unknown import sentences, shapes
from kurumaisu.critic.unknown.curves import Design
from kurumaisu.critic.unknown.joint_fit import fit_with_curve
from kurumaisu.critic.unknown.step_curves import StepCurve, gains_over_own_rate, step_curves


@pytest.fixture(scope="module")
def slipping():
    """Return a chair that turns a third less than asked to from 0.4 rad/s on; a limit of its yaw rate may act."""
    slip = hidden.Kind(2, "w", lambda s, a, b: s.w * (abs(s.w) > 0.4))
    recording = hidden.make(slip, 60.0, 1004, seconds=40.0, runs=2).recording
    return hidden.problem_of(recording, frozenset({"base.saturation"}))


def curves_beside_nothing(problem):
    """Return the curves beside nothing, those that jump among them, best first."""
    curves, empty = CurveSearch(problem), problem.fit_candidates((), {})
    curves.closer(empty)
    return curves.found(empty)


def test_a_jump_beats_an_effect_that_has_a_corner_near_by(slipping):
    found = search.search(slipping, lambda _: None)
    best = found.curves[0]
    assert found.log_posterior(best) > found.log_posterior(found.best) + 20
    assert (best.curve.id, best.fit.ids) == ("smooth.w_gain.abs_w", frozenset())
    assert isinstance(best.curve.basis, StepCurve)
    assert found.p["base.saturation"] < 0.01
    smooth = max(one.nats for one in curves_beside_nothing(slipping) if not isinstance(one.curve.basis, StepCurve))
    assert best.nats > smooth + 10  # eight knots draw it far worse


def test_a_jump_is_told_and_written_where_it_is(slipping):
    best = curves_beside_nothing(slipping)[0]
    extension = fit_with_curve(slipping, best.fit, best.curve, best.evidence.prior)
    found = shapes.shape_of(extension.drawn)
    assert found.place[1] - 0.01 < 0.4 < found.place[2] + 0.01  # these drives have no rate just there
    assert found.place[1] <= found.place[0] <= found.place[2]
    assert found.place[2] - found.place[1] < 0.06
    assert sentences.shape(extension, intervals=False).startswith("it jumps at 0.")
    effects.check((extension.unknown,))  # the simulator takes it
    v, w = np.full(3, 0.2), np.array([0.3, 0.5, -0.5])
    moved = effects.by_id(extension.unknown.id)(extension.unknown.parameters, None).apply(effects.Motion(0.01, v, w))
    np.testing.assert_allclose(moved.w / w - 1, extension.coefficients[[0, 1, 1]], atol=1e-12)
    assert abs(extension.coefficients[0]) < 0.05 < abs(extension.coefficients[1])
    at = shapes.grid(extension.drawn)  # a picture has both sides of it
    assert {float(knot) for knot in best.curve.basis.knots} <= {float(x) for x in at}


def test_noise_alone_rarely_jumps():
    """The mean of exp(evidence) over noise is 1, for any place that is looked for: that is what its prior is for."""
    problem = hidden.problem_of(hidden.make(hidden.KINDS["gully"], 10.0, 1005, seconds=20.0, runs=1).null)
    empty = problem.fit_candidates((), {})
    curves = list(gains_over_own_rate(Design(problem, ()).curves))[:4]
    rng, drive, found = np.random.default_rng(3), problem.drives[0], []
    for _ in range(60):
        noisy = replace(drive, poses=drive.poses + rng.normal(0.0, 0.005, drive.poses.shape))
        found += [belief.nats for _, belief in step_curves(problem.changed(drives=[noisy]), empty, curves)]
    assert len(found) == 240
    assert np.mean(np.array(found) > np.log(20)) <= 0.05


@pytest.mark.parametrize("seed", [1006, 1007])
def test_a_jump_that_does_what_an_effect_does_is_that_effect(seed):
    """A chair that goes back by less than it goes forward has a gain that jumps where the speed changes its sign."""
    backward = hidden.Kind(0, "v", lambda s, a, b: s.v * (s.v < 0))
    recording = hidden.make(backward, 40.0, seed, seconds=40.0, runs=2).recording
    found = search.search(hidden.problem_of(recording, frozenset({"base.reverse_gain"})), lambda _: None)
    assert found.named == ("base.reverse_gain",)
    assert found.best.ids == {"base.reverse_gain"}
    assert sum(found.p_curves.values()) < 0.1


@pytest.mark.parametrize("seed", [1010, 1011])
def test_a_tyre_that_goes_flat_bends_the_way_from_then_on_and_is_no_veer(seed):
    flat = hidden.Kind(2, "time", lambda s, a, b: s.v * (s.time > 25))
    recording = hidden.make(flat, 40.0, seed, seconds=40.0, runs=2).recording
    problem = hidden.problem_of(recording, frozenset({"base.veer"}))
    found = search.search(problem, lambda _: None)
    best = found.curves[0]
    assert found.log_posterior(best) > found.log_posterior(found.best) + 20
    assert (best.curve.id, best.fit.ids) == ("smooth.curvature.time", frozenset())
    assert found.p["base.veer"] < 0.1
    extension = fit_with_curve(problem, best.fit, best.curve, best.evidence.prior)
    place = shapes.shape_of(extension.drawn).place
    assert place[1] - 0.2 < 25 < place[2] + 0.2
    assert sentences.channel(extension.curve) == "base.w"
    assert sentences.shape(extension, intervals=False).endswith(" rad/m")

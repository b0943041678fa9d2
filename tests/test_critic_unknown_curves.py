# SPDX-License-Identifier: BSD-3-Clause
"""Curves against the catalogue: derivatives, evidence and words by themselves, then whole criticisms."""

import math
from dataclasses import replace

import numpy as np
import pytest
import unknown_effects as hidden
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic import pipeline
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.covariance import without
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.search import search
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.critic.unknown import curves, sentences, shapes
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.joint_fit import FitWithCurve, fit_with_curve
from kurumaisu.critic.values.policy import Z_HIGH, Z_LOW, Z_USUAL
from kurumaisu.params import EffectSetting, load_model, shipped

MD100 = shipped("launch/md100.yaml")
MODEL = load_model(MD100)


@pytest.fixture(scope="module")
def problem():
    """Return a problem with the noise known, and nothing hidden."""
    case = hidden.make(hidden.KINDS["carpet edge"], 10.0, 3, seconds=30.0, runs=2)
    return hidden.problem_of(case.null)


@pytest.mark.parametrize("beside", [(), (EffectSetting("base.lag_v", {"tau": 0.2}),)], ids=["alone", "with a lag"])
def test_columns_are_the_derivative_of_the_replay(problem, beside):
    drive = problem.drives[0]
    design = curves.Design(problem, beside)
    assert {curve.basis.covariate for curve in design.curves} >= {"v", "w", "time", "heading", "x", "y", "temperature"}
    for curve in design.curves:
        wanted = curves.raw_columns(drive, problem.model, beside, [curve])
        coefficients = np.random.default_rng(1).standard_normal(curve.basis.size) * 1e-4

        def moved(sign, curve=curve, coefficients=coefficients):
            setting = EffectSetting(curve.id, curve.basis.parameters(sign * coefficients))
            return replay.increments(drive, problem.model, (*beside, setting)).ravel()

        np.testing.assert_allclose((moved(1) - moved(-1)) / 2, wanted @ coefficients, atol=2e-9, err_msg=curve.id)


def test_evidence_is_that_of_a_normal_distribution():
    """Integrated by hand: y ~ N(0, I + X K X') over the sizes that the prior allows, each K as likely."""
    rng = np.random.default_rng(2)
    x, y = rng.standard_normal((40, 3)), rng.standard_normal(40) * 2
    priors = [np.diag([1.0, 2.0, 3.0]), np.array([[2.0, 1, 0], [1, 2.0, 0], [0, 0, 1.0]])]
    nulls = multivariate_normal(np.zeros(40)).logpdf(y)
    sizes = np.geomspace(Z_LOW, Z_HIGH, 4000)
    density = np.where(sizes < Z_USUAL, 0.9 / np.log(Z_USUAL / Z_LOW), 0.1 / np.log(Z_HIGH / Z_USUAL))
    weights = density / density.sum()
    total = []
    for prior in priors:
        scaled = x @ prior @ x.T / np.trace(x @ prior @ x.T)
        values, vectors = np.linalg.eigh(scaled)
        c = vectors.T @ y
        spread = 1 + np.multiply.outer(sizes**2, np.maximum(values, 0))
        total.append(logsumexp(-0.5 * (c**2 / spread + np.log(spread)).sum(axis=1) + 0.5 * c @ c, b=weights))
    one = 9.0 * priors[0] / np.trace(x @ priors[0] @ x.T)
    by_hand = multivariate_normal(np.zeros(40), np.eye(40) + x @ one @ x.T).logpdf(y) - nulls
    own = curves.curve_evidence(x.T @ x, x.T @ y, [priors[0]])
    assert own.nats == pytest.approx(total[0], abs=0.2)  # a coarse grid stands for the integral
    assert own.nats > by_hand + np.log(0.9 / 8) - 1e-9
    both = curves.curve_evidence(x.T @ x, x.T @ y, priors).nats
    assert both == pytest.approx(logsumexp(total) - np.log(2), abs=0.2)


@pytest.mark.parametrize("seed", [1004, 1005])
def test_a_slip_beyond_a_threshold_is_no_dead_zone_with_a_gain(seed):
    """A narrower dead zone with a smaller gain draws it: neither of them acts."""
    slip = hidden.Kind(2, "w", lambda s, a, b: s.w * (abs(s.w) > 0.4))
    case = hidden.make(slip, 80.0, seed, seconds=40.0, runs=2)
    ids = frozenset({"base.dead_zone_w", "base.gain_w"})
    found = search.search(hidden.problem_of(case.recording, ids), lambda _: None)
    assert found.curves[0].curve.id == "smooth.w_gain.abs_w"
    assert found.log_posterior(found.curves[0]) > found.log_posterior(found.best)
    assert max(found.p.values()) < 0.9


def test_a_curve_and_an_effect_of_the_catalogue_are_fitted_together():
    case = hidden.make(hidden.KINDS["corrugated floor"], 30.0, 1003, seconds=40.0, runs=2, gain_w=0.06)
    problem = hidden.problem_of(case.recording)
    right = problem.fit(["base.gain_w"], {})
    best = CurveSearch(problem).beside(right)[0]
    extension = fit_with_curve(problem, best.fit, best.curve, best.evidence.prior)
    assert extension.fit.values[0] == pytest.approx(0.06, abs=4 * extension.fit.sds[0])
    assert sentences.shape(extension).startswith("periodic, period 2 pi/3, amplitude")
    size = shapes.shape_of(extension.drawn).size
    assert size[1] < abs(case.size) * 1.05
    assert size[2] > abs(case.size) * 0.95
    left = [d.measured - problem.simulated(d, extension.settings) for d in problem.drives]
    white = np.concatenate([problem.whitened(d, r.reshape(-1, 1)) for d, r in zip(problem.drives, left, strict=True)])
    assert float(np.mean(white**2)) == pytest.approx(1.07, abs=0.07)


def test_a_curve_and_effects_that_draw_the_same_are_fitted_no_worse_than_without_it():
    """Whole steps overshoot together, from round to round."""
    bent = hidden.Kind(0, "v", lambda s, a, b: math.sin(9 * s.v) * abs(s.v))
    problem = hidden.problem_of(hidden.make(bent, 80.0, 1009, seconds=40.0, runs=2).recording)
    parabola = next(one for one in problem.candidates if one.id == "base.curvature_v")
    *_, zone = (one for one in problem.candidates if one.id == "base.dead_zone_v")
    both = problem.fit_candidates([parabola, zone], {})
    (curve,) = (c for c in curves.Design(problem, both.settings).curves if c.id == "smooth.v.v")
    own, left = both.beside.own, both.beside.residual
    free = without(own, curves.columns(problem, both.settings, [curve]))
    prior = curves.curve_evidence(free.T @ free, free.T @ left, curve.basis.priors).prior
    extension = fit_with_curve(problem, both, curve, prior)
    curved = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    left = curved.residual(extension.fit.terms, extension.fit.values)
    assert -0.5 * left @ left > both.log_likelihood + 10


def drawn(law, sd):
    """Return an extension whose curve is a law of the covariate, known to sd."""
    knots = np.linspace(0.0, 4.0, 8)
    basis = Basis("time", knots, {}, (), 0.0, 4.0)
    curve = curves.Curve("v", basis, slice(0, 8))
    return FitWithCurve(None, curve, np.eye(8), np.array([law(k) for k in knots]), sd**2 * np.eye(8))


@pytest.mark.parametrize(
    ("law", "kind", "place", "size"),
    [
        (lambda t: 0.01 * t, "line", 2.0, 0.04),
        (lambda t: 0.02 * (t > 2.2), "step", 2.3, 0.02),
        (lambda t: -0.02 * max(t - 2.0, 0), "threshold", 2.0, -0.04),
        (lambda t: 0.03 * np.exp(-(((t - 1.5) / 0.6) ** 2)), "bump", 1.5, 0.03),
        (lambda t: 0.01 * np.sin(np.pi * (t - 2) * 1.75), "irregular", 2.0, 0.02),
    ],
)
def test_shapes_are_told_with_place_and_size(law, kind, place, size):
    found = shapes.shape_of(drawn(law, 0.001).drawn)
    assert found.kind == kind
    assert found.place[0] == pytest.approx(place, abs=0.35)
    assert found.size[0] == pytest.approx(size, rel=0.15)
    assert found.size[1] < found.size[0] < found.size[2]


def criticise(recording):
    return pipeline.criticise(recording, MD100, lambda _: None)


@pytest.fixture(scope="module")
def carpet():
    case = hidden.make(hidden.KINDS["turning costs speed"], 25.0, 1004, seconds=40.0, runs=2)
    return case, criticise(case.recording)


def test_an_unknown_effect_is_said_to_be_one(carpet, tmp_path):
    criticism = carpet[1]
    misfit = criticism.story.misfits[0]
    poses = {run.name: run.pose for run in carpet[0].recording.runs}
    for run, moment, place in zip(misfit.moments.run, misfit.moments.t, misfit.moments.places, strict=True):
        pose = poses[misfit.moments.runs[run]]
        assert list(pose.values[np.searchsorted(pose.t, moment), :2]) == list(place)
    assert len(misfit.moments.t) == len(misfit.residual) > 100
    verdict = criticism.verdict
    assert verdict.verdict == "unknown"
    assert not [cause for cause in verdict.causes if cause.p >= 0.9]
    assert (verdict.unknown[0].channel, verdict.unknown[0].covariate) == ("base.v", "|w|")
    assert verdict.unknown[0].shape.startswith(("threshold at", "monotone"))
    assert verdict.gain.log_density_per_sample.lo90 > 0
    pipeline.write(criticism, MD100, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Outside the catalogue" in page
    assert "extension, upper end" not in page  # the data are in the link
    (setting, _) = load_model(tmp_path / "extended.yaml").effects
    assert setting.id == "smooth.v.abs_w"


def test_the_extended_model_leaves_nothing_to_find(carpet):
    """The same drives judged against the extended model, with the noise known: neither curve nor gain is left."""
    case, criticism = carpet
    settings = tuple(setting for setting in criticism.settings if setting.id.startswith("smooth."))
    problem = hidden.problem_of(case.recording).changed(model=replay.extend(hidden.MODEL, settings))
    assert all(one.nats < 0 for one in CurveSearch(problem).beside(problem.fit_candidates((), {})))


def test_columns_of_words_are_no_covariates_and_constant_ones_neither():
    case = hidden.make(hidden.KINDS["gully"], 10.0, 1005, seconds=30.0, runs=2)
    constant = {"temperature": lambda s: replace(s, values=np.full_like(s.values, 20.0))}
    runs = tuple(
        replace(run, covariates={name: constant[name](series) for name, series in run.covariates.items()})
        for run in case.null.runs
    )
    problem = hidden.problem_of(replace(case.null, runs=runs))
    assert "temperature" not in {curve.basis.covariate for curve in curves.Design(problem, ()).curves}


@pytest.mark.parametrize("seed", [11, 12])
def test_a_curve_that_draws_a_strong_cause_as_well_does_not_hide_it(seed):
    """A lever moves the reference sideways in proportion to w, as a curve over w would, and far out of the noise."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(seed), seconds=20.0, rate=10.0)
    data = recordings.recording("lever", drives, [BASE["base.marker_x"].fault({"size": 0.25}, "plain")])
    ids = frozenset({"base.marker_x", "base.lateral_slip", "base.gain_v", "smooth"})
    problem = Problem([prepare(run, MODEL) for run in data.runs], MODEL, noise_of(USUAL), ids=ids)
    found = search.search(problem, lambda _: None)
    assert found.named == ("base.marker_x",)
    assert found.p["base.marker_x"] > 0.99
    assert max(found.p_curves.values()) < 0.9

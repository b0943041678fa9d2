# SPDX-License-Identifier: BSD-3-Clause
"""What the equation of a cause may miss is noise beside its sizes, as large as the cause is, and no second cause."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.motion import Fault, Form
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, prepare
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.covariance import orthonormal
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.form_error import form_errors, smooth_functions
from kurumaisu.critic.search import search
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
TWO = ("base.gain_v", "base.lag_w")


def problem_of(faults, ids, seed=3, seconds=30.0):
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(seed), seconds=seconds, rate=10.0)
    runs = recordings.recording("made", drives, faults).runs
    return Problem([prepare(run, MODEL) for run in runs], MODEL, noise_of(USUAL), ids=frozenset(ids))


@pytest.fixture(scope="module")
def problem():
    return problem_of([], TWO)


def missed(problem, sizes):
    """Return terms, values and slopes of two effects of these sizes, and what their equations may miss."""
    terms = tuple(term for name in TWO for term in problem.terms if term.id == name and not term.fixed)
    values = np.array([sizes.get(term.key, term.null) for term in terms])
    slopes = problem.columns(terms, values, terms)
    return terms, values, slopes, form_errors(problem, terms, values, orthonormal(slopes))


def signal(problem, terms, values, name):
    """Return what an effect does beside the other, whitened: its norm."""
    null = np.array([term.null if term.id == name else value for term, value in zip(terms, values, strict=True)])
    here, there = (problem.residual(terms, at) for at in (values, null))
    return float(np.linalg.norm(here - there))


SIZES = {("base.gain_v", "gain"): 0.2, ("base.lag_w", "tau"): 0.3}


def test_it_moves_no_size_of_any_cause(problem):
    _, _, slopes, blocks = missed(problem, SIZES)
    assert set(blocks) == set(TWO)
    slopes = slopes / np.linalg.norm(slopes, axis=0)
    for block in blocks.values():
        assert block.shape[1] > 10
        np.testing.assert_allclose(slopes.T @ block, 0.0, atol=1e-5 * np.abs(block).max())


@pytest.mark.parametrize("name", TWO)
def test_it_is_as_large_as_the_cause(problem, name):
    """With a share of 1 it may be anything as large as the signal: about as large by smooth functions as by sizes.

    Twice the gain misses twice as much; what the other cause may miss stays as it is.
    """
    key = next(key for key in SIZES if key[0] == name)
    (other,) = set(TWO) - {name}
    terms, values, _, small = missed(problem, SIZES | {key: SIZES[key] / 2})
    terms, larger, _, large = missed(problem, SIZES)
    for at, blocks in ((values, small), (larger, large)):
        norm = signal(problem, terms, at, name)
        assert 0.3 * norm < np.linalg.norm(blocks[name]) < 4 * norm
    ratio = signal(problem, terms, larger, name) / signal(problem, terms, values, name)
    assert np.linalg.norm(large[name]) == pytest.approx(ratio * np.linalg.norm(small[name]), rel=0.2)
    assert np.linalg.norm(large[other]) == pytest.approx(np.linalg.norm(small[other]), rel=0.1)


def test_what_does_nothing_misses_nothing(problem):
    blocks = missed(problem, {})[3]
    assert all(np.abs(block).max(initial=0.0) < 1e-6 for block in blocks.values())


def test_what_has_no_size_misses_nothing():
    """A sign is wrong or it is not."""
    problem = problem_of([], ["base.sign"])
    chosen = problem.candidates[0]
    values = np.array([term.parameter.lower if term.fixed else term.null for term in chosen.terms])
    assert form_errors(problem, chosen.terms, values, np.empty((len(problem.residual((), np.empty(0))), 0))) == {}


def test_smooth_functions_are_hats_that_cover_the_drive(problem):
    drive = problem.drives[0]
    hats = smooth_functions(drive)
    assert hats.shape[0] == len(drive.times) - 1
    assert (hats[:, :-2] >= 0).all()
    np.testing.assert_allclose(hats[:, :-2].reshape(len(hats), -1, 5).sum(axis=2), 1.0, atol=1e-12)
    np.testing.assert_allclose((hats[:, -2:] ** 2).sum(axis=1), 1.0, atol=1e-12)


def test_a_form_may_follow_the_way_since_a_reversal(problem):
    """Far from any before the first, at one just after it, and far again a metre on."""
    drive = problem.drives[0]
    half = len(drive.v) // 2
    back = replace(drive, v=np.where(np.arange(len(drive.v)) < half, 0.5, -0.5))
    since = back.times[:-1] - (back.start + half * GRID)
    near, far = smooth_functions(back)[:, [-7, -3]].T
    np.testing.assert_array_equal(far[since < -0.1], 1.0)
    assert near[np.argmax(since > 0)] > 0.7
    np.testing.assert_array_equal(far[since > 2.1], 1.0)
    assert (near[since > 0.8] == 0).all()


def bent(problem, setting, share):
    """Return the problem of exact drives by an effect, whose signal is off by a share that follows the time."""
    drives = []
    for drive in problem.drives:
        full, none = (replay.path(drive, MODEL, settings) for settings in ((setting,), ()))
        late = np.linspace(-share, share, len(full))[:, None]
        drives.append(drive.seen_at(drive.times, full + late * (full - none)))
    return problem.changed(drives=drives)


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, -np.inf, 0.0), (0.3, 5.0, np.inf)])
def test_a_fit_says_how_much_likelier_the_data_are_where_its_equation_misses_something(problem, share, least, most):
    terms = tuple(term for term in problem.terms if term.id == "base.gain_v")
    (setting,) = settings_of(terms, np.full(len(terms), 0.3))
    fit = bent(problem, setting, share).fit(["base.gain_v"], {})
    assert least < fit.beside.nats < most
    assert set(fit.beside.forms) == {"base.gain_v"}


@pytest.mark.parametrize("seed", [1, 2])
def test_a_zone_with_a_soft_corner_is_a_dead_zone_and_nothing_else(seed):
    """What its equation misses is far out of the noise, and passed for a bent law or a gain beside it."""
    ids = {"base.dead_zone_w", "base.gain_w", "base.curvature_w"}
    problem = problem_of([BASE["base.dead_zone_w"].fault({"size": 0.05}, "other")], ids, seed, 15.0)
    found = search.search(problem, lambda _: None)
    assert found.named == ("base.dead_zone_w",)
    assert found.best.ids == {"base.dead_zone_w"}
    assert not found.confounded


SOFT = {"base.saturation", "base.curvature_v"}  # a soft top speed bends the law, too
LAWS = [
    ("v", lambda v: 0.8 * np.tanh(v / 0.8), SOFT),
    ("w", lambda w: w * (1 - 0.2 * np.abs(w) ** 2.5), {"base.curvature_w"}),
]


@pytest.mark.parametrize(("rate", "law", "right"), LAWS)
def test_a_law_that_is_nobody_s_first_is_one_cause_still(rate, law, right):
    """A top speed like a tanh, a gain that falls late: the likeliest set may bend it by two, which nobody can name."""
    fault = Fault(Form("events", lambda e, _: replace(e, **{rate: law(getattr(e, rate))})), {})
    rivals = {f"base.{kind}_{rate}" for kind in ("gain", "curvature", "dead_zone")} | {"base.saturation"}
    found = search.search(problem_of([fault], rivals, 2), lambda _: None)
    assert len(found.named) == 1
    assert found.best.ids <= right
    assert set(found.named) <= right

# SPDX-License-Identifier: BSD-3-Clause
"""What single candidates would explain of what a fit leaves: what is there is proposed, and noise proposes nothing."""

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.search.search import Dictionary, scan
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
IDS = frozenset(
    f"base.{name}"
    for name in ("gain_v", "gain_w", "lag_v", "dead_zone_v", "saturation", "marker_x", "marker_yaw", "veer")
)
SEEDS = range(3)


def problem_of(seed, ids=IDS, **sizes):
    """Return the problem of two short drives in which effects of these sizes act."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(seed), seconds=20.0, rate=10.0)
    faults = [BASE[f"base.{name}"].fault({"size": size}, "plain") for name, size in sizes.items()]
    runs = recordings.recording("made", drives, faults).runs[:2]
    return Problem([prepare(run, MODEL) for run in runs], MODEL, noise_of(USUAL), ids=ids)


def nothing(problem):
    return problem.fit_candidates((), {})


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_proposes_nothing(seed):
    problem = problem_of(seed)
    guesses = scan(Dictionary(problem), nothing(problem))
    assert {guess.candidate.id for guess in guesses} <= IDS
    assert max(guess.nats for guess in guesses) < 5.0  # with all the sizes that were tried


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("name", "size"), [("gain_w", 0.1), ("gain_w", -0.1), ("lag_v", 0.2), ("dead_zone_v", 0.1)])
def test_what_is_hidden_is_proposed_first_about_as_large_as_it_is(seed, name, size):
    problem = problem_of(seed, **{name: size})
    empty = nothing(problem)
    best = scan(Dictionary(problem), empty)[0]
    assert best.candidate.id == f"base.{name}"
    fit = problem.fit_candidates([best.candidate], best.start)
    (amplitude,) = (t for t in fit.terms if not (t.shape or t.fixed))
    assert best.start[amplitude.key] == pytest.approx(fit.start[amplitude.key], rel=0.5)
    # Along a line about the model it promises about what the fit keeps.
    assert best.nats == pytest.approx(fit.log_likelihood - empty.log_likelihood, rel=0.3)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_gain_behind_a_larger_one_is_proposed_beside_it(seed):
    """Alone it is far behind; beside the larger one it is all there is."""
    problem = problem_of(seed, gain_v=0.2, gain_w=0.06)
    dictionary = Dictionary(problem)
    larger = scan(dictionary, nothing(problem))[0]
    assert larger.candidate.id == "base.gain_v"
    fit = problem.fit_candidates([larger.candidate], larger.start)
    beside = scan(dictionary, fit)
    assert "base.gain_v" not in {guess.candidate.id for guess in beside}
    assert beside[0].candidate.id == "base.gain_w"
    both = problem.fit_candidates([larger.candidate, beside[0].candidate], {**fit.start, **beside[0].start})
    assert beside[0].start["base.gain_w", "gain"] == pytest.approx(both.start["base.gain_w", "gain"], rel=0.3)


def test_what_a_curve_draws_speaks_for_no_effect():
    problem = problem_of(1, gain_w=0.1)
    empty, dictionary = nothing(problem), Dictionary(problem)
    (own,) = (signals.columns for signals in dictionary.signals if signals.candidate.id == "base.gain_w")
    alone, beside = (
        {guess.candidate.id: guess.nats for guess in scan(dictionary, empty, also)} for also in (None, own)
    )
    assert alone["base.gain_w"] > 50
    assert beside.get("base.gain_w", 0.0) < 1.0
    assert beside["base.marker_x"] == pytest.approx(alone["base.marker_x"], abs=5.0)


@pytest.mark.parametrize("name", ["base.lag_v", "base.marker_yaw", "base.gain_w"])
def test_neighbouring_sizes_do_nearly_the_same(name):
    """Else one between them would be missed."""
    (signals,) = (one for one in Dictionary(problem_of(2)).signals if one.candidate.id == name)
    sizes = signals.values[:, 0] - signals.candidate.terms[0].null
    norms = np.linalg.norm(signals.columns, axis=0)
    assert (norms > 0).all()
    for sign in {-1, 1} & set(np.sign(sizes).astype(int).tolist()):
        ordered = np.flatnonzero(np.sign(sizes) == sign)[np.argsort(np.abs(sizes[np.sign(sizes) == sign]))]
        unit = signals.columns[:, ordered] / norms[ordered]
        assert (np.sum(unit[:, 1:] * unit[:, :-1], axis=0) > 0.8).all()
        assert (np.diff(norms[ordered]) > 0).all()


SIGN = frozenset({"base.sign"})


def test_a_wrong_sign_is_proposed():
    right = problem_of(3, SIGN)
    wrong = right.changed(drives=[drive.seen_at(drive.times, drive.poses * [1, -1, -1]) for drive in right.drives])
    best = scan(Dictionary(wrong), nothing(wrong))[0]
    assert best.nats > 1000
    assert best.start == {("base.sign", "factor_v"): 1.0, ("base.sign", "factor_w"): -1.0, ("base.sign", "swap"): 0.0}


@pytest.mark.parametrize("gain", [0.1, -0.1])
def test_what_has_no_size_promises_no_more_than_all_of_it_explains(gain):
    """A chair that turns a tenth less is no chair that turns the other way, though a twentieth of that would do."""
    problem = problem_of(1, SIGN, gain_w=gain)
    assert all(guess.nats < 1.0 for guess in scan(Dictionary(problem), nothing(problem)))

# SPDX-License-Identifier: BSD-3-Clause
"""Sets of effects that a search from the best set alone would miss: twins in the same company, and two for one."""

import numpy as np

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine import search
from kurumaisu.critic.engine.catalogue import Candidate, Term
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.swapped_sets import swapped_sets
from kurumaisu.effects import Parameter
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SIZE = Parameter("size", "1", null=0.0, scale=1.0, lower=-9.0, upper=9.0)
OF = 10


def fit(score, **sizes):
    """Return a set of effects, by name, with their sizes, and a log posterior [nat] of another of its number."""
    terms = tuple(Term(name, SIZE, 0.0) for name in sizes)
    chosen = frozenset(Candidate(term.id, (term,), 1.0) for term in terms)
    values = np.array(list(sizes.values()))
    return Fit(chosen, terms, values, np.ones(len(terms)), (), score, score)


def names(sets):
    return {tuple(sorted(candidate.id for candidate in chosen)): start for chosen, start in sets}


def test_a_twin_is_tried_in_the_company_of_the_other():
    fits = [fit(0.0, veer=1.0, zone=2.0), fit(-0.3, cross=3.0, zone=2.1), fit(1.5, sag=4.0, veer=1.1, zone=1.5)]
    tried = names(swapped_sets(fits, OF))
    assert set(tried) == {("cross", "sag", "zone")}
    assert tried["cross", "sag", "zone"] == {("cross", "size"): 3.0, ("sag", "size"): 4.0, ("zone", "size"): 1.5}


def test_what_is_no_twin_or_hardly_likely_is_not_exchanged():
    others = [
        fit(-0.3, zone=2.1),
        fit(-0.3, a=1.0, b=1.0),
        fit(-4.0, cross=3.0, zone=2.1),
        fit(-5.0, veer=1.0, sag=1.0),
    ]
    assert swapped_sets([fit(0.0, veer=1.0, zone=2.0), *others], OF) == []


def test_one_effect_that_does_what_two_others_do_does_not_hide_them():
    """A load makes both rates slower, as two gains do: from the set with it the true one is four changes away."""
    sizes = {"base.gain_v": 0.124, "base.gain_w": 0.10, "base.left_right_gain": 0.11}
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(5), seconds=40.0, rate=10.0)
    faults = [BASE[name].fault({"size": size}, "plain") for name, size in sizes.items()]
    runs = recordings.recording("gains", drives, faults).runs
    ids = frozenset((*sizes, "base.payload", "base.curvature_v", "base.curvature_w", "base.dead_zone_w"))
    problem = Problem([prepare(run, MODEL) for run in runs], MODEL, noise_of(USUAL), ids=ids)
    assert search.search(problem, lambda _: None).best.ids == set(sizes)


def test_a_search_whose_lines_promise_nothing_goes_on_by_fits(monkeypatch):
    """Beside a large bend every set that lines know may lie outside its bounds."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(5), seconds=20.0, rate=10.0)
    runs = recordings.recording("gain", drives, [BASE["base.gain_v"].fault({"size": 0.2}, "plain")]).runs
    ids = frozenset({"base.gain_v", "base.curvature_v"})
    problem = Problem([prepare(run, MODEL) for run in runs], MODEL, noise_of(USUAL), ids=ids)
    monkeypatch.setattr(search.Screen, "guesses", lambda _: [])
    first = problem.fit(["base.curvature_v"], {})
    assert search.search(problem, lambda _: None, first).best.ids == {"base.gain_v"}

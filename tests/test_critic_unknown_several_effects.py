# SPDX-License-Identifier: BSD-3-Clause
"""A free curve over the yaw rate is any law of it: it is no news where several effects draw it better together."""

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.search import search
from kurumaisu.critic.unknown import comparison
from kurumaisu.critic.unknown.comparison import compare
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.effect_likeness import EffectLikeness
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
TWO = ("base.dac_zero_s", "base.dead_zone_w")


@pytest.fixture(scope="module")
def found():
    """Return drives with a large offset and a large dead zone, and what the catalogue says."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(7), rate=10.0)
    faults = [BASE[name].fault({"size": size}, "plain") for name, size in zip(TWO, (-0.067, 0.27), strict=True)]
    data = recordings.recording("two", drives, faults)
    problem = Problem([prepare(run, MODEL) for run in data.runs], MODEL, noise_of(USUAL), ids=frozenset(TWO))
    return problem, search(problem, lambda _: None)


def test_a_curve_of_the_yaw_rate_draws_both_together(found):
    problem, naming = found
    assert naming.best.ids == set(TWO)
    designs = Designs(problem, naming.best)
    alone = [rival for rival in compare(problem, naming).rivals if not rival.fit.ids]
    other = next(rival for rival in alone if rival.curve.channel == "v")
    likeness = EffectLikeness(problem, naming.best, designs)
    assert set(likeness.drawn_together(alone[0].fit, alone[0].curve, alone[0].evidence)) == set(TWO)
    assert likeness.drawn_together(other.fit, other.curve, other.evidence) == {}
    assert likeness.drawn_together(naming.best, alone[0].curve, alone[0].evidence) == {}  # nothing is missing there


def test_two_effects_are_believed_more_where_a_curve_that_explains_less_is_them(found, monkeypatch):
    """Evidence of strong causes counts for little: against the curve nothing was named, nor told."""
    problem, naming = found
    odds = compare(problem, naming).odds
    monkeypatch.setattr(comparison, "_BEHIND", np.inf)
    apart = compare(problem, naming).odds
    assert all(odds[name] >= apart[name] for name in TWO)
    assert odds[TWO[1]] > apart[TWO[1]] + 20

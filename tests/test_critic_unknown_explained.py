# SPDX-License-Identifier: BSD-3-Clause
"""When what is outside the catalogue is told: drives held out confirm it, by density or by where the chair comes to."""

from dataclasses import replace

import pytest
import unknown_effects as hidden

from kurumaisu.critic import pipeline
from kurumaisu.critic.heldout.materiality import simulates_nearer
from kurumaisu.critic.judge import explain_unknown, multipliers
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.criticism import UNRESOLVED
from kurumaisu.critic.values.verdict import ChannelGain, Gain, LogDensityGain, RmseGain
from kurumaisu.params import shipped

LOST = LogDensityGain(1.0, 0.9, -0.1, -0.2, 0.1)


def gain(low):
    """Return a gain that lost in density, and may be nearer along the way by `low` metres at least."""
    rmse = RmseGain(0.15, 0.12, 0.03, low, 0.05, "m")
    return Gain(LOST, {}, {"dx": ChannelGain(LOST, rmse), "dtheta": ChannelGain(LOST)})


@pytest.mark.parametrize(
    ("channels", "low", "near"),
    [(("dx",), 0.01, True), (("dx", "dtheta"), 0.01, True), (("dx",), -0.01, False), (("dx", "dy"), 0.01, False)],
)
def test_surprises_do_not_hide_that_the_chair_is_simulated_nearer(channels, low, near):
    """In one direction, and in none farther off."""
    worse = ChannelGain(LOST, RmseGain(0.1, 0.15, -0.05, -0.06, -0.04, "m"))
    one = gain(low)
    assert simulates_nearer(replace(one, channels={**one.channels, "dy": worse}), channels) is near


@pytest.mark.parametrize(("mean", "moved", "near"), [(-0.1, -0.1, False), (-0.1, 0.1, True), (0.1, -0.1, True)])
def test_what_loses_density_and_misses_the_place_as_well_is_not_nearer(mean, moved, near):
    path = {"position after 2 s": RmseGain(0.9, 0.9 - moved, moved, moved - 0.2, moved + 0.2, "m")}
    lost = replace(gain(0.01), log_density_per_sample=replace(LOST, gain=mean), rmse=path)
    assert simulates_nearer(lost, ("dx",)) is near


def test_what_is_not_known_confirms_nothing():
    assert not simulates_nearer(None, ("dx",))
    assert not simulates_nearer(gain(0.01), ("dtheta",))
    assert not simulates_nearer(gain(0.01), ("dy",))


def test_a_curve_that_is_another_form_of_an_effect_is_told_as_no_unknown():
    """Nor does it take the place of the curve that extends the model."""
    problem = hidden.problem_of(hidden.make(hidden.KINDS["carpet edge"], 30.0, 1003, seconds=30.0, runs=2).recording)
    empty = problem.fit_candidates((), {})
    first, *others = CurveSearch(problem).beside(empty)
    other = next(replace(one, form_of=frozenset({"base.gain_w"})) for one in others if one.curve.id != first.curve.id)
    p = {first.curve.id: 0.9}
    found = SearchResult((empty,), (first, other), {"base.gain_w": 0.1}, p, ())
    assert [one.p for one in explain_unknown._unknowns(problem, found)] == [0.9]


@pytest.mark.parametrize(
    ("least", "unresolved", "said"),
    [(50.0, False, "Held-out data do not confirm this: it is not"), (1e9, True, "Something is wrong")],
)
def test_what_cannot_be_noise_is_unknown_though_no_curve_holds(monkeypatch, least, unresolved, said):
    """Nothing is extended by what did not hold, and no curve is certain; without one it is still not green.

    Nobody measured the path either, so that no numbers are offered for a controller.
    """
    recording = hidden.make(hidden.KINDS["carpet edge"], 30.0, 1003, seconds=30.0, runs=2).recording
    recording = replace(recording, runs=tuple(replace(run, pose_source="the odometry") for run in recording.runs))
    monkeypatch.setattr(explain_unknown, "confirmed", lambda worth, nats, free: False)
    monkeypatch.setattr(explain_unknown, "simulates_nearer", lambda worth, channels: False)
    monkeypatch.setattr(explain_unknown, "NO_NOISE", least)
    asked = list[object]()
    monkeypatch.setattr(multipliers, "measured", lambda *of, **_: asked.append(of))
    ids = frozenset({"base.gain_w", "base.veer", "smooth"})
    found = pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None, ids=ids)
    assert (found.verdict.verdict, found.verdict.causes) == ("unknown", ())
    assert not any(setting.id.startswith("smooth") for setting in found.settings)
    assert all(one.p <= 0.5 for one in found.verdict.unknown)
    assert (found.verdict.unknown[0].covariate == UNRESOLVED) is unresolved
    assert said in found.story.headline
    assert bool(asked) is not unresolved

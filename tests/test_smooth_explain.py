# SPDX-License-Identifier: BSD-3-Clause
"""When what is outside the catalogue is told: drives held out confirm it, by density or by where the chair comes to."""

from types import SimpleNamespace

import pytest

from kurumaisu.critic import smooth_explain
from kurumaisu.critic.verdict import ChannelGain, Gain, LogDensityGain, RmseGain

LOST = LogDensityGain(1.0, 0.9, -0.1, -0.2, 0.1)


def gain(low):
    """Return a gain that lost in density, and may be nearer along the way by `low` metres at least."""
    rmse = RmseGain(0.15, 0.12, 0.03, low, 0.05, "m")
    return Gain(LOST, {}, {"dx": ChannelGain(LOST, rmse), "dtheta": ChannelGain(LOST)})


@pytest.mark.parametrize(("channel", "low", "near"), [("v", 0.01, True), ("v_gain", 0.01, True), ("v", -0.01, False)])
def test_surprises_do_not_hide_that_the_chair_is_simulated_nearer(channel, low, near):
    assert smooth_explain._nearer(gain(low), channel) is near


def test_what_is_not_known_confirms_nothing():
    assert not smooth_explain._nearer(None, "v")
    assert not smooth_explain._nearer(gain(0.01), "w")
    assert not smooth_explain._nearer(gain(0.01), "lateral")


@pytest.mark.parametrize(("winner", "nats"), [("a curve", 5.0), (None, 62.0)])
def test_evidence_is_over_nothing_where_an_effect_may_be_it_as_well(winner, nats):
    """What lies between a curve and an effect that explain as much is no evidence that neither acts."""
    fit = object()
    best = SimpleNamespace(fit=fit, belief=SimpleNamespace(nats=40.0))
    rivalry = SimpleNamespace(rivals=(best,), lead=5.0, winner=winner)
    found = SimpleNamespace(nats={fit: 22.0}.__getitem__)
    assert smooth_explain._nats(found, SimpleNamespace(rivalry=rivalry)) == nats

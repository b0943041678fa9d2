# SPDX-License-Identifier: BSD-3-Clause
"""Beside an effect that does far more than small changes tell, nothing else is seen that is not there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import sparse

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic.base.replay import extend
from kurumaisu.critic.judge import scan_verdict
from kurumaisu.critic.ranges.search import large_effect
from kurumaisu.critic.values.criticism import LaserFinding, Pictures
from kurumaisu.critic.values.verdict import Cause, Estimate
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


@pytest.mark.parametrize("own", [(), (EffectSetting("laser.sweep", {"stretch": -0.6}),)])
def test_scans_that_are_taken_nearly_at_once_have_no_other_fault(own, tmp_path):
    """A slow clock, a wrong mounting and a wrong map drew the rest of a line; a model may know a part of it already."""
    case = make(Ask("single", ("laser.sweep",), 300.0, "other", family="laser"), 29301, tmp_path)
    found = scan_verdict.criticise_scans(sparse(case.recording, scans=6), extend(MODEL, own), lambda _: None)
    assert [cause.id for cause in found.causes] == ["laser.sweep"]
    assert not found.confounded
    assert not found.unknown
    stretch = found.causes[0].parameters["stretch"]
    assert stretch.estimate == pytest.approx(case.truth.parameters["laser.sweep"]["stretch"], abs=0.01)
    assert {setting.id: setting.parameters for setting in found.settings} == {
        "laser.sweep": {"stretch": pytest.approx(stretch.estimate, abs=1e-6)}
    }
    assert [misfit.explained_by for misfit in found.pictures.misfits] == ["laser.sweep"]
    assert any(line.startswith("laser.sweep: changes the readings") for line in found.details)


def test_what_is_still_missing_of_it_makes_no_set(monkeypatch):
    monkeypatch.setattr(large_effect, "misfits", lambda *_: ())
    assembly = SimpleNamespace(marks=SimpleNamespace(together=lambda _: np.zeros((1, 1))))
    lead = EffectSetting("laser.clock_skew", {"skew": -0.002})
    apart = ("laser.offset", "laser.warmup")
    rest = LaserFinding(confounded=(("laser.clock_skew", "laser.latency"), apart))
    found = large_effect.with_dominant(rest, lead, Cause(lead.id, 1.0, {}, 50.0), assembly, None)
    assert found.confounded == (apart,)
    assert [cause.id for cause in found.causes] == [lead.id]
    assert found.settings == (lead,)


@pytest.mark.parametrize(
    ("low", "causes"), [(-0.001, ["laser.clock_skew"]), (0.001, ["laser.latency", "laser.clock_skew"])]
)
def test_a_lead_of_which_nothing_is_left_beside_the_others_is_taken_back(monkeypatch, low, causes):
    """A clock that runs fast was a delay at first."""
    monkeypatch.setattr(large_effect, "misfits", lambda *_: ())
    assembly = SimpleNamespace(marks=SimpleNamespace(together=lambda _: np.zeros((1, 1))))
    lead = EffectSetting("laser.latency", {"delay": 0.03})
    skew = EffectSetting("laser.clock_skew", {"skew": 0.005})
    again = Cause("laser.latency", 1.0, {"delay": Estimate(0.002, low, 0.005, "s")}, 10.0)
    other = Cause("laser.clock_skew", 1.0, {"skew": Estimate(0.005, 0.0049, 0.0051, "1")}, 900.0)
    drawn = tuple(SimpleNamespace(explained_by=name) for name in ("laser.latency", "laser.clock_skew"))
    settings = (replace(lead, parameters={"delay": 0.002}), skew)
    rest = LaserFinding(causes=(again, other), settings=settings, pictures=Pictures(misfits=drawn))
    found = large_effect.with_dominant(rest, lead, Cause(lead.id, 1.0, {}, 50.0), assembly, None)
    assert [cause.id for cause in found.causes] == causes
    assert [setting.id for setting in found.settings] == causes
    assert [misfit.explained_by for misfit in found.pictures.misfits] == ["laser.clock_skew"]

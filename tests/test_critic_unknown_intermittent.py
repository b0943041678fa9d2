# SPDX-License-Identifier: BSD-3-Clause
"""What comes and goes is told with when it was, and is not taken for noise; noise, however loud, is not told."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_effect import Disturbance, recording

from kurumaisu.critic import pipeline
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import unresolved
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.noise import base_noise
from kurumaisu.critic.unknown import intermittent
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


def losing(data, share, lasts=0.8, every=5.0):
    """A recording whose chair loses a share of its way for some tenths of a second now and then, and when that is."""
    rng, runs, whens = np.random.default_rng(8), [], {}
    for run in data.runs:
        starts = np.cumsum(rng.uniform(0.4 * every, 1.6 * every, int(run.pose.t[-1] / every) + 1))
        there = ((run.pose.t[:, None] >= starts) & (run.pose.t[:, None] < starts + lasts)).any(axis=1)
        ways = np.diff(run.pose.values[:, :2], axis=0, prepend=run.pose.values[:1, :2])
        lost = np.cumsum(np.where(there[:, None], share * ways, 0.0), axis=0)
        values = np.column_stack([run.pose.values[:, :2] - lost, run.pose.values[:, 2]])
        runs.append(replace(run, pose=replace(run.pose, values=values)))
        whens[run.name] = starts
    return replace(data, runs=tuple(runs)), whens


def criticised(data):
    return pipeline.criticise(data, shipped("launch/md100.yaml"), lambda _: None)


def test_packets_that_are_lost_are_told_with_their_time():
    data, whens = losing(recording(None, 0.0, 71, 40.0), 0.8)
    found = criticised(data)
    assert found.verdict.verdict == "unknown"
    first = found.verdict.unknown[0]
    assert (first.channel, first.covariate) == ("base.v", "time")
    assert first.shape.startswith("comes and goes: less by ")
    assert first.p > 0.95
    assert not found.verdict.causes
    words = found.story.headline
    name = next(run for run in whens if f"surest in {run}" in words)
    since = float(words.split(" from ")[1].split(" s")[0])
    assert np.any((since > whens[name] - 0.5) & (since < whens[name] + 0.8))


@pytest.mark.parametrize("noise", [Disturbance(0.01, 0.02, 0.3, 0.005), Disturbance(0.06, 0.1, 1.0, 0.002)])
def test_noise_does_not_come_and_go(noise):
    found = criticised(recording(None, 0.0, 72, 40.0, noise))
    assert not [one for one in found.verdict.unknown if one.shape.startswith("comes and goes")]


@pytest.mark.parametrize(
    ("events", "told", "leads"), [("ab", 80.0, "a"), ("a", None, "b"), ("b", None, "a"), ("", None, "a")]
)
def test_an_equation_that_does_without_what_comes_and_goes_leads(monkeypatch, events, told, leads):
    """Of a voltage that leaves its branch some converters make no turn, and others a wrong one, for moments."""

    @dataclass(frozen=True)
    class Found:
        near: tuple[SimpleNamespace, ...]
        enough = True

        def led_by(self, fit):
            return Found((fit, *(one for one in self.near if one is not fit)))

    def beside(problem, drives, settings):
        return SimpleNamespace(nats=80.0, share=0.05, size=1.0, channel="v_gain") if settings in tuple(events) else None

    monkeypatch.setattr(unresolved, "intermittent", beside)
    monkeypatch.setattr(unresolved, "_usual", lambda *_: 1.0)
    made = Decision(SimpleNamespace(ids=None), Found(tuple(SimpleNamespace(settings=name) for name in "ab")), None)
    made, one = unresolved.certain_intermittent(made, [])
    assert (one and one.nats) == told
    assert made.found.near[0].settings == leads


def test_moments_that_share_a_column_say_what_they_say_alone(monkeypatch):
    (run, *_) = recording(None, 0.0, 73, 90.0).runs
    problem = Problem([prepare(run, MODEL)], MODEL, base_noise.START)
    shared = intermittent._moments(problem, (), "v")
    monkeypatch.setattr(intermittent, "_SPACING", 1000.0)
    alone = intermittent._moments(problem, (), "v")
    np.testing.assert_array_equal(shared.middles, alone.middles)
    np.testing.assert_allclose(shared.z, alone.z, atol=0.1)


def test_a_gap_in_the_poses_is_not_told_many_times():
    (run, *_) = recording(None, 0.0, 73, 60.0).runs
    some = (run.pose.t < 20) | (run.pose.t > 40)
    holed = replace(run, pose=replace(run.pose, t=run.pose.t[some], values=run.pose.values[some]))
    moments = intermittent._moments(Problem([prepare(holed, MODEL)], MODEL, base_noise.START), (), "v")
    assert not np.any((moments.middles > 20.5) & (moments.middles < 39.5))
    assert len(moments.z) > 50


@pytest.mark.parametrize(("apart", "nats"), [(0.0, -np.inf), (4.0, 12.0)])
def test_a_mixture_is_likelier_where_some_moments_are_off_to_one_side(apart, nats):
    rng = np.random.default_rng(4)
    z = rng.standard_normal(300) - np.where(rng.random(300) < 0.1, apart, 0.0)
    best = max(intermittent._mixtures(z), key=lambda one: one.nats)
    assert (best.nats > 0) == (apart > 0)
    assert best.nats > nats
    if apart:
        assert best.apart == pytest.approx(-apart, abs=0.5)
        assert best.share == pytest.approx(0.1, abs=0.03)

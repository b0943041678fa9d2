# SPDX-License-Identifier: BSD-3-Clause
"""The noise that the critic has estimated, as the effect that the simulator draws it from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic.judge.explain import process_noise
from kurumaisu.critic.noise.base_noise import START
from kurumaisu.params import load_model, shipped


def drawn(noise, v, w, count=4000):
    """Return sd of v and w about steady rates [m/s, rad/s], in the simulator's steps of 10 ms; seed 1."""
    model = load_model(shipped("launch/md100.yaml"))
    setting = process_noise(SimpleNamespace(noise=noise))
    context = effects.Context(model.translation, model.steering, np.random.default_rng(1))
    effect = effects.by_id(setting.id)(setting.parameters, context)
    out = effect.apply(effects.Motion(0.01, np.full(count, v), np.full(count, w)))
    return (out.v - v).std(), (out.w - w).std()


def test_noise_that_grows_with_the_rates_does_so_in_the_simulator():
    """A quick chair: tau is short, so that 40 s are many independent samples."""
    quick = replace(START, tau=0.02, growth=0.5, slow_v=0.0, slow_w=0.0)
    for v, w in ((0.1, 0.0), (0.8, 0.8)):
        expected = 1 + 0.5 * (v + w) / 0.8  # the pace of a drive is 1 at 0.8 m/s
        sd_v, sd_w = drawn(quick, v, w)
        assert sd_v == pytest.approx(quick.sd_v * expected, rel=0.1)
        assert sd_w == pytest.approx(quick.sd_w * expected, rel=0.1)


def test_noise_that_does_not_grow_is_the_same_at_all_rates():
    steady = replace(START, tau=0.02, growth=0.0, slow_v=0.0, slow_w=0.0)
    assert drawn(steady, 0.1, 0.0) == pytest.approx(drawn(steady, 0.8, 0.8), rel=1e-9)

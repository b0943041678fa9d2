# SPDX-License-Identifier: BSD-3-Clause
"""The noise that is estimated, on drives whose noise the bench's generator drew."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden.base.recordings import draw_drives, recording
from kurumaisu.bench.hidden.generator.motion import drive
from kurumaisu.bench.hidden.generator.noise import REGIMES
from kurumaisu.bench.hidden.oracle import errors
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.noise.base_noise import NoiseResiduals, turned
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


def estimated(regime, seed, truth=None, heading=lambda times: 0.0 * times):
    """Return the noise of three drives of a minute about what they do without any.

    heading: how far [rad] the reference's is besides off at some times [s].
    """
    drawn = draw_drives("rich", regime, np.random.default_rng(seed), seconds=60.0, rate=10.0)
    made = [prepare(run, MODEL) for run in recording("drawn", drawn, ()).runs]
    left = [
        errors(one, setting.stamps, drive(replace(setting, noise=None), ())[0])
        for one, setting in zip(made, drawn.settings, strict=True)
    ]
    left = [
        rest + heading(one.times[1:])[:, np.newaxis] * turned(one).reshape(rest.shape)
        for one, rest in zip(made, left, strict=True)
    ]
    nothing = [np.empty((rest.size, 0)) for rest in left]
    return NoiseResiduals(made, left, nothing, truth).estimate().noise


@pytest.mark.parametrize("known", [False, True])
def test_errors_of_the_reference_that_last_are_no_noise_of_the_motion(known):
    regime = REGIMES["lasting"]
    truth = (regime.position_sd, regime.heading_sd) if known else None
    found = estimated(regime, 1, truth)
    assert found.position_sd * found.louder == pytest.approx(regime.position_sd, rel=1e-9 if known else 0.25)
    assert found.heading_sd * found.louder == pytest.approx(regime.heading_sd, rel=1e-9 if known else 0.25)
    assert (found.lasting / found.louder) ** 2 == pytest.approx(regime.lasting, abs=0.15)
    assert regime.lasting_tau / 2 < found.lasting_tau < regime.lasting_tau * 2
    assert found.sd_lateral < 2 * regime.colours[0].sd[1]
    assert found.rest < 0.1


@pytest.mark.parametrize("name", ["usual", "slow", "rough", "poor reference", "quiet", "two colours"])
def test_white_errors_of_the_reference_do_not_last(name):
    found = estimated(REGIMES[name], 2)
    assert found.lasting < 0.3
    assert found.position_sd == pytest.approx(REGIMES[name].position_sd, rel=0.2)


def test_a_heading_may_be_off_throughout_a_drive_by_what_it_wanders_within():
    """A marker that is turned by as much in all drives is no noise, however noisy single headings are."""
    regime = replace(REGIMES["usual"], heading_sd=0.012)
    truth = (regime.position_sd, regime.heading_sd)
    plain, marker, wave = (
        estimated(regime, 3, truth, heading).wander
        for heading in (
            lambda times: 0.0 * times,
            lambda times: 0.01 + 0.0 * times,
            lambda times: 0.012 * np.sin(2 * np.pi * times / 50.0),
        )
    )
    assert max(plain, marker) < 0.004
    assert wave > 0.008

# SPDX-License-Identifier: BSD-3-Clause
"""The generator of hidden faults: its noise, its z, its nulls, and that a seed says all."""

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base_case import draw_drives
from kurumaisu.bench.hidden.base_catalogue import BASE
from kurumaisu.bench.hidden.motion import STEP, Setting, drive
from kurumaisu.bench.hidden.noise import REGIMES, Colour, Regime, draw_rates


def same(one, other):
    return all(
        np.array_equal(getattr(a, part).values, getattr(b, part).values)
        for a, b in zip(one.runs, other.runs, strict=True)
        for part in ("command", "voltage", "pose")
    )


def test_a_seed_says_all():
    ask = Ask("pair")
    first, again, other = make(ask, 3), make(ask, 3), make(ask, 4)
    assert same(first.recording, again.recording)
    assert first.truth == again.truth
    assert not same(first.recording, other.recording)


def test_a_null_is_the_twin_without_the_fault():
    one, other = make(Ask("single", ("base.gain_v",)), 5), make(Ask("single", ("base.lag_w",)), 5)
    assert same(one.null, other.null)
    assert not same(one.null, one.recording)
    nothing = make(Ask("null"), 5)
    assert same(nothing.null, nothing.recording)
    assert nothing.truth.ids == ()


@pytest.mark.parametrize("name", REGIMES)
def test_the_noise_of_the_rates_is_what_was_asked_for(name):
    regime = REGIMES[name]
    noise = draw_rates(regime, 400_000, np.random.default_rng(1))
    asked = np.sum([np.square(colour.sd) for colour in regime.colours], axis=0)
    np.testing.assert_allclose(noise.var(axis=0), asked, rtol=0.15)
    lag = round(0.1 / STEP)
    kept = np.sum([np.square(colour.sd) * np.exp(-0.1 / colour.tau) for colour in regime.colours], axis=0)
    np.testing.assert_allclose((noise[lag:] * noise[:-lag]).mean(axis=0), kept, atol=0.15 * asked.max())


def test_arcs_end_where_geometry_says():
    command = np.array([[0.0, 0.5, 0.4], [5.0, 0.0, 0.0]])
    setting = Setting(command, np.zeros(3), np.array([0.0, 5.0, 5.5]))
    end = drive(setting, ())[0][-1]
    radius = 0.5 / 0.4
    np.testing.assert_allclose(end, [radius * np.sin(2.0), radius * (1 - np.cos(2.0)), 2.0], atol=1e-5)


def test_what_the_reference_sees_of_a_null_is_drive_and_noise_only():
    """Body steps of the null beside the noise-free drive: zero mean, no more spread than the noise makes."""
    regime = Regime((Colour((1e-9, 1e-9, 1e-9), 0.3),), 0.004, 0.002)
    drives = draw_drives("rich", regime, np.random.default_rng(2))
    for setting, error in zip(drives.settings, drives.errors, strict=True):
        left = drive(setting, ())[0] + error - drive(Setting(setting.command, setting.start, setting.stamps), ())[0]
        np.testing.assert_allclose(left.std(axis=0), [0.004, 0.004, 0.002], rtol=0.12)
        assert np.all(np.abs(left.mean(axis=0)) < 4 * left.std(axis=0) / np.sqrt(len(left)))


@pytest.mark.parametrize("form", ["plain", "other"])
@pytest.mark.parametrize("name", BASE)
def test_every_base_id_reaches_the_z_that_was_asked_for(name, form):
    truth = make(Ask("single", (name,), z=15.0, form=form, regime="usual"), 8).truth
    assert truth.ids == (name,)
    if BASE[name].scaled:
        assert truth.z == pytest.approx(15.0, rel=0.1)
    if form == "plain" and name != "base.process_noise":
        assert truth.z_form < 1e-6

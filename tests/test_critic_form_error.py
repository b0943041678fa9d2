# SPDX-License-Identifier: BSD-3-Clause
"""What a loud cause of another form than the catalogue's leaves behind is no second cause."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base import catalogue
from kurumaisu.bench.hidden.generator.motion import STEP, Form
from kurumaisu.critic import pipeline
from kurumaisu.critic.engine import form_error_fit
from kurumaisu.critic.engine.form_error import FormError, FormErrorWhitener, change
from kurumaisu.params import EffectSetting, shipped

MD100 = shipped("launch/md100.yaml")


def test_what_may_be_off_is_muted_until_all_is_white_again():
    columns = np.random.default_rng(0).standard_normal((40, 3)) * [0.1, 2.0, 30.0]
    muted = FormErrorWhitener(columns).whiten(np.eye(40))
    np.testing.assert_allclose(muted @ (np.eye(40) + columns @ columns.T) @ muted.T, np.eye(40), atol=1e-9)


def test_marks_are_beside_what_a_fit_does_itself():
    """The increments of an effect are a square of its size and a line beside it."""

    def simulated(settings):
        size = settings[0].parameters["size"]
        return np.outer(np.linspace(0.0, 1.0, 5), [size, size**2, 1.0])

    def sized(size):
        return (EffectSetting("a", {"size": size}),)

    marks = FormError(sized(1.0), ((sized(0.5), False, 1.0), (sized(3.0), False, 0.5)), (sized(1.0 + 1e-6),)).marks(
        simulated, np.asarray
    )
    slope = np.outer(np.linspace(0.0, 1.0, 5), [1.0, 2.0, 0.0]).ravel()
    np.testing.assert_allclose(marks.T @ slope, 0.0, atol=1e-5)
    assert np.linalg.norm(marks, axis=0) == pytest.approx([0.25 * 0.61, 0.5 * 4.0 * 0.61], rel=0.01)


@pytest.mark.parametrize(("form", "exact"), [("plain", True), ("other", False)])
def test_a_lag_that_is_not_of_the_first_order_is_a_lag_and_nothing_else(form, exact, tmp_path, monkeypatch):
    """Its rest passed for an acceleration limit or a clock; where the equation is exact, nothing is missed."""
    told, missed = [], form_error_fit.likeliest_form_error

    def heard(problem, found):
        told.append(missed(problem, found))
        return told[-1]

    monkeypatch.setattr(form_error_fit, "likeliest_form_error", heard)
    case = make(Ask("single", ("base.lag_v",), 150.0, form, regime="usual", family="base"), 31240, tmp_path)
    verdict = pipeline.criticise(case.recording, MD100, lambda _: None).verdict
    assert [cause.id for cause in verdict.causes] == ["base.lag_v"]
    assert not verdict.confounded
    tau = verdict.causes[0].parameters["tau"]
    assert tau.estimate == pytest.approx(case.truth.parameters["base.lag_v"]["tau"], rel=0.1)
    assert all(what is None for what, _ in told) is exact


def test_what_holds_back_is_told_from_what_drives_on():
    """While it speeds up a slower chair has less way, while it slows down more."""
    here, there = np.array([[0.2, 0.0, -0.1]]), np.array([[0.1, 0.1, -0.3]])
    np.testing.assert_allclose(change(here, there), [-0.1, 0.1, -0.2])
    np.testing.assert_allclose(change(here, there, held_back=True), [-0.1, 0.0, 0.0])


def test_a_chair_that_turns_sooner_less_than_more_lags_and_does_nothing_else(tmp_path, monkeypatch):
    """Its rest passed for yaw rates that jump."""

    def uneven(rates, sizes):
        out, level = np.empty_like(rates.w), 0.0
        for k, asked in enumerate(rates.w.tolist()):
            tau = sizes["size"] * (1.5 if abs(asked) > abs(level) else 0.67)
            after = asked + (level - asked) * np.exp(-STEP / tau)
            out[k], level = (level + after) / 2, after
        return replace(rates, w=out)

    hidden = replace(catalogue.BASE["base.lag_w"], other=Form("rates", uneven))
    monkeypatch.setitem(catalogue.BASE, "base.lag_w", hidden)
    case = make(Ask("single", ("base.lag_w",), 30.0, "other", regime="usual", family="base"), 31703, tmp_path)
    verdict = pipeline.criticise(case.recording, MD100, lambda _: None).verdict
    assert ([cause.id for cause in verdict.causes], verdict.confounded, verdict.unknown) == (["base.lag_w"], (), ())

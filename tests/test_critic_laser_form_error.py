# SPDX-License-Identifier: BSD-3-Clause
"""What the equation of a strong cause misses is no second cause; what acts beside it still is one."""

from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.search.block_evidence import compare_blocks
from kurumaisu.critic.ranges.search.effect_sets import FormSearch
from kurumaisu.critic.ranges.signals.coefficient_blocks import Block
from kurumaisu.critic.ranges.signals.effect_columns import Column, Form
from kurumaisu.critic.ranges.signals.form_error import DrawnCurve, FormFamily, form_family, integrated_out
from kurumaisu.critic.values.prior import FORM_ERROR
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SCANS, BEAMS, WALLS = 20, 60, 12
SIZE = SimpleNamespace(name="bias", null=0.0, scale=1.0, lower=-1e9, upper=1e9)


def scene(rng):
    """Return shots and looks of scans whose beams meet one of some walls, each of a reflectance, at any range."""
    wall = rng.integers(WALLS, size=(SCANS, BEAMS))
    seen = SimpleNamespace(
        ranges=rng.uniform(0.5, 4.0, (SCANS, BEAMS)),
        incidence=rng.uniform(0.0, 1.3, (SCANS, BEAMS)),
        returns=np.array([1.0, 0.7, 0.4, 0.1])[wall % 4],
        origins=np.zeros((SCANS, BEAMS, 3)),
    )
    shots = SimpleNamespace(
        stamps=np.linspace(0.0, 300.0, SCANS),
        laser=SimpleNamespace(bearings=np.linspace(-2.0, 2.0, BEAMS)),
    )
    return shots, seen, wall


@pytest.mark.parametrize(
    ("covariate", "change"),
    [
        ("time", lambda shots, _: 0.01 / (1 + shots.stamps / 60)[:, np.newaxis] + np.zeros(BEAMS)),
        ("range", lambda _, seen: 0.003 * np.sin(2 * np.pi * seen.ranges / 1.8)),
        ("incidence", lambda _, seen: 0.003 * np.tan(seen.incidence) ** 2),
        ("returns", lambda _, seen: -0.01 * np.log(seen.returns)),
        (None, lambda _, seen: 0.01 * seen.ranges * np.sin(seen.incidence)),
        (None, lambda _, seen: np.zeros(seen.ranges.shape)),
    ],
)
def test_what_an_effect_follows_is_found_by_drawing_what_it_does(covariate, change):
    shots, seen, _ = scene(np.random.default_rng(0))
    moved = change(shots, seen)
    found = form_family(moved, shots, seen, np.ones(moved.shape, dtype=bool))
    if found is None:
        assert not moved.any()
        return
    assert {curve.covariate for curve in found.curves if curve.signal is None} == {covariate} - {None}
    multiplied = {curve.covariate for curve in found.curves if curve.signal is not None}
    assert multiplied == {"time", "range", "incidence", "bearing"} - {covariate}
    columns = found.columns(shots, seen).reshape(moved.size, -1)
    drawn = columns @ np.linalg.lstsq(columns, moved.ravel(), rcond=None)[0]
    assert np.std(moved.ravel() - drawn) < 0.05 * np.std(moved)
    gram = columns.T @ columns
    prior = found.scaled(gram, float(moved.ravel() @ moved.ravel()))
    # Drawn from that, curves are as large as the share that nobody can refuse.
    assert np.trace(gram @ prior) == pytest.approx(len(found.curves) * FORM_ERROR**2 * np.sum(moved**2))


@pytest.mark.parametrize("readings", [0, 1, SCANS * BEAMS])
def test_what_is_the_same_everywhere_is_drawn_by_finite_curves(readings):
    """All walls are as dark; and of no reading, nothing is drawn."""
    shots, seen, _ = scene(np.random.default_rng(4))
    change = np.full(seen.ranges.shape, 0.01)
    found = form_family(change, shots, seen, np.arange(change.size).reshape(change.shape) < readings)
    assert (found is None) == (readings < 2)
    if found is not None:
        assert np.isfinite(found.columns(shots, seen)).all()
        assert all(np.isfinite(curve.prior).all() for curve in found.curves)


def test_coefficients_integrated_out_are_noise_of_their_covariance():
    rng = np.random.default_rng(1)
    every, root = rng.standard_normal((40, 5)), rng.standard_normal((2, 2))
    prior = root @ root.T
    found = integrated_out(every.T @ every, np.array([3, 1]), prior)
    covariance = np.eye(40) + every[:, [3, 1]] @ prior @ every[:, [3, 1]].T
    kept = np.ix_([0, 2, 4], [0, 2, 4])
    assert found[kept] == pytest.approx((every.T @ np.linalg.solve(covariance, every))[kept])


@pytest.mark.parametrize("moved", [False, True])
def test_dark_walls_that_are_read_by_another_law_are_not_walls_that_are_off(moved):
    rng = np.random.default_rng(2)
    shots, seen, wall = scene(rng)
    dark = 1 - seen.returns
    columns = np.concatenate([dark[:, :, np.newaxis], wall[:, :, np.newaxis] == np.arange(WALLS)], axis=2)
    form = Form("laser.reflectance", {}, (Column(SIZE, False, {}),), 0)
    off = rng.standard_normal(WALLS)[wall] * moved
    residual = 40 * dark**1.6 + 2 * off + rng.standard_normal(dark.shape)  # in sds of readings

    change = dark * float(np.sum(dark * residual) / np.sum(dark**2))
    family = form_family(change, shots, seen, np.ones(dark.shape, dtype=bool))
    assert family is not None
    every = np.concatenate([columns, family.columns(shots, seen), residual[:, :, np.newaxis]], axis=2)
    every = every.reshape(dark.size, -1)
    gram, count = every.T @ every, columns.shape[2]
    walls = Block("world.map_error", SimpleNamespace(), None, (np.eye(WALLS),), slice(1, 1 + WALLS))
    found = FormSearch([form], gram).run()
    exact = compare_blocks(found, [walls], gram, {})
    nearly = compare_blocks(found, [walls], gram, {form.id: (slice(count, every.shape[1] - 1), family)})
    assert exact.winner is not None
    assert (nearly.winner is not None) == moved
    assert nearly.found.best.ids == {"laser.reflectance"}


@pytest.mark.parametrize("common", [0.0, 0.002])
def test_a_warm_up_of_another_form_leaves_no_common_mode_and_hides_none(tmp_path, common):
    data = recording(tmp_path, "laser.warmup", 0.05, 3, scans=120, common=common)
    seen = criticise_scans(
        data, MODEL, lambda _: None, frozenset({"laser.warmup", "laser.common_mode", "laser.offset"})
    )
    named = {cause.id for cause in seen.causes}
    assert named == ({"laser.warmup", "laser.common_mode"} if common else {"laser.warmup"})


def test_steps_of_reflectance_need_no_straight_lines():
    found = FormFamily((DrawnCurve("returns", np.array([0.4, 1.0]), np.eye(2)),))
    seen = SimpleNamespace(returns=np.array([[1.0, 0.4, 1.0]]))
    assert found.columns(SimpleNamespace(), seen).tolist() == [[[0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]]

# SPDX-License-Identifier: BSD-3-Clause
"""Curves as effects: what they add, in chunks as in one, from a model file, in the simulator; and what they refuse."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import interp1d

from kurumaisu import effects, geometry
from kurumaisu.effects import Context, Motion, Reference
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

DT = 0.02
MODEL = load_model(shipped("launch/md100.yaml"))
CONTEXT = Context(MODEL.translation, MODEL.steering, np.random.default_rng(0))
HATS = {"knot_0": -0.3, "knot_1": 0.1, "knot_2": 0.4, "value_0": 0.05, "value_1": -0.02, "value_2": 0.03}
WAVE = {"period": 2 * np.pi, "level": 0.01, "cos_1": 0.0, "cos_2": 0.03, "sin_1": 0.02, "sin_2": 0.0}


def parameters(covariate: str) -> dict[str, float]:
    if covariate in effects.PERIODIC:
        return WAVE
    constant = effects.constant_of(covariate)
    return HATS | ({constant: 0.5} if constant else {})


def apply(name: str, values: dict[str, float], motion: Motion) -> Motion:
    return effects.by_id(name)(values, CONTEXT).apply(motion)


def test_a_curve_is_added_to_its_channel_while_the_chair_moves():
    v, w = np.array([0.3, 0.0, 0.0, -0.2]), np.array([0.0, 0.25, 0.0, 0.1])
    expected = interp1d([-0.3, 0.1, 0.4], [0.05, -0.02, 0.03])(w) * [1, 1, 0, 1]
    for channel, rate in (("v", v), ("w", w), ("lateral", np.zeros(4))):
        moved = apply(f"smooth.{channel}.w", HATS, Motion(DT, v, w))
        found = {"v": moved.v, "w": moved.w, "lateral": moved.u}[channel]
        np.testing.assert_allclose(found, rate + expected, atol=1e-15)


def test_a_curve_multiplies_its_rate():
    v, w = np.array([0.3, 0.0, 0.5, -0.2]), np.array([0.0, 0.25, 0.0, 0.1])
    over_w = interp1d([-0.3, 0.1, 0.4], [0.05, -0.02, 0.03])(w)
    over_v = np.interp(v, [-0.3, 0.1, 0.4], [0.05, -0.02, 0.03])
    moved = apply("smooth.v_gain.w", HATS, Motion(DT, v, w))
    np.testing.assert_allclose(moved.v, v + v * over_w, atol=1e-15)
    np.testing.assert_array_equal(moved.w, w)
    np.testing.assert_allclose(apply("smooth.w_gain.v", HATS, Motion(DT, v, w)).w, w + w * over_v, atol=1e-15)


def test_with_a_period_a_curve_over_the_time_comes_again_and_again():
    v = np.full(400, 0.3)
    moved = apply("smooth.v.time", WAVE | {"period": 2.5}, Motion(DT, v, 0 * v))
    phase = 2 * np.pi * (np.arange(400) + 0.5) * DT / 2.5
    np.testing.assert_allclose(moved.v - v, 0.01 + 0.02 * np.sin(phase) + 0.03 * np.cos(2 * phase), atol=1e-12)


@pytest.mark.parametrize("turned", [0.0, 1.2])
def test_a_curve_bends_what_a_reference_measures_along_the_axes_of_the_map(turned):
    """However the frame of the poses is turned in the map."""
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(-0.3, 0.4, (6, 2)), rng.uniform(-3, 3, 6)])
    frame = np.array([0.0, 0.0, -turned])
    known = dict(zip(("x", "y", "heading"), poses.T, strict=True))
    truth = Reference(np.arange(6.0), geometry.compose(frame, poses), np.zeros((6, 3)), known=known)
    over_y = np.interp(poses[:, 1], [-0.3, 0.1, 0.4], [0.05, -0.02, 0.03])
    for i, part in enumerate(("x", "y", "heading")):
        seen = effects.by_id(f"smooth.reference_{part}.y")(HATS, CONTEXT).apply(truth)
        expected = poses + over_y[:, None] * np.eye(3)[i]
        np.testing.assert_allclose(geometry.between(frame, seen.poses), geometry.between(np.zeros(3), expected))


def test_where_nobody_knows_where_a_chair_is_a_reference_is_bent_where_its_poses_are():
    pose, rates = np.array([2.0, 0.1, 0.5]), np.array([0.4, 0.0, 0.1])
    for part, over, by in (("x", "y", -0.02), ("heading", "v", 0.03), ("y", "w", -0.02)):
        seen = effects.by_id(f"smooth.reference_{part}.{over}")(HATS, CONTEXT).apply(
            Reference(np.array(1.0), pose, rates)
        )
        moved = pose + by * np.array([part == "x", part == "y", part == "heading"])
        np.testing.assert_allclose(seen.poses, moved, atol=1e-12)
        np.testing.assert_array_equal(seen.rates, rates)


def test_beyond_its_knots_a_curve_is_constant():
    moved = apply("smooth.w.v", HATS, Motion(DT, np.array([-2.0, 2.0]), np.zeros(2)))
    np.testing.assert_allclose(moved.w, [0.05, 0.03])


def test_the_time_since_the_chair_rested_begins_with_each_start():
    v, w = np.array([0.0, 0.2, 0.2, 0.0, 0.0, 0.0, -0.1]), np.array([0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.0])
    since = effects.Follower("since_rest", 0.0).values(Motion(DT, v, w))
    np.testing.assert_allclose(since, DT * np.array([0.0, 0.5, 1.5, 2.5, 0.0, 0.0, 0.5]))


def test_covariates_are_what_they_are_called():
    v = np.array([0.2, 0.2, -0.4, -0.4, 0.0, 0.0])
    w = np.array([0.0, 0.0, 0.0, 0.5, 0.5, 0.0])

    def values(name, constant=0.0, **known):
        return effects.Follower(name, constant).values(Motion(DT, v, w, heading=1.0, known=known))

    np.testing.assert_allclose(values("time"), DT * np.array([0.5, 1.5, 2.5, 3.5, 4.5, 5.5]))
    np.testing.assert_allclose(values("since_command"), DT * np.array([0.5, 1.5, 0.5, 0.5, 0.5, 0.5]))
    np.testing.assert_allclose(values("since_rest"), [np.inf] * 5 + [0.0])
    np.testing.assert_allclose(values("since_reversal"), [np.inf, np.inf, 0.004, 0.012, 0.016, 0.016])
    lag = 0.2 * np.exp(-DT / 0.2 * np.arange(3))  # what v, held at 0.2 from rest on, is ahead of a lag
    np.testing.assert_allclose(values("acceleration")[:2], -np.diff(lag) / DT)
    np.testing.assert_allclose(values("yaw_acceleration")[:3], 0.0)
    np.testing.assert_allclose(values("heading"), 1 + DT * np.array([0, 0, 0, 0.25, 0.75, 1.0]))
    np.testing.assert_allclose(values("distance"), DT * np.array([0.1, 0.3, 0.6, 1.0, 1.2, 1.2]))
    np.testing.assert_allclose(values("wheel_left", 0.6), v - 0.3 * w)
    np.testing.assert_allclose(values("x", x=np.full(6, 7.0)), 7.0)
    np.testing.assert_allclose(values("y")[:2], DT * 0.2 * np.sin(1) * np.array([0.5, 1.5]))
    np.testing.assert_allclose(values("rust", 3.0), 3.0)


@pytest.mark.parametrize("covariate", [*effects.COVARIATES, "heading", "rust"])
@given(cuts=st.lists(st.integers(1, 119), max_size=4, unique=True), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_chunks_give_the_same_motion_as_the_whole(covariate, cuts, seed):
    rng = np.random.default_rng(seed)
    v, w = np.repeat(rng.uniform(-0.6, 0.6, (2, 12)) * (rng.random((2, 12)) > 0.3), 10, axis=1)
    name, values = effects.smooth_id("w", covariate), parameters(covariate)
    whole = apply(name, values, Motion(DT, v, w)).w
    effect = effects.by_id(name)(values, CONTEXT)
    bounds = [0, *sorted(cuts), 120]
    parts = [effect.apply(Motion(DT, v[a:b], w[a:b])).w for a, b in pairwise(bounds)]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("smooth.q.v", HATS, "not in the catalogue"),
        ("smooth.v", HATS, "not in the catalogue"),
        ("smooth.v.w", {}, "needs the parameters knot_0"),
        ("smooth.v.w", HATS | {"value_3": 1.0}, "needs the parameters"),
        ("smooth.v.w", HATS | {"knot_1": 0.5}, "knots must increase"),
        ("smooth.v.w", HATS | {"value_1": float("nan")}, "value_1 must be a finite number"),
        ("smooth.v.heading", WAVE | {"period": 0.0}, "period must be a positive number"),
        ("smooth.v.wheel_left", HATS, "track"),
        ("smooth.v.rust", HATS, "now"),
    ],
)
def test_what_does_not_fit_is_refused(name, values, words):
    with pytest.raises(Error, match=words):
        effects.check((EffectSetting(name, values),))


def test_the_simulator_runs_curves_from_a_model_file_beside_effects_of_the_catalogue(tmp_path):
    """It drives straight on at +20 % and, from x = 1 m on, 0.1 m/s faster; the curve knows where it is."""
    text = shipped("launch/md100.yaml").read_text(encoding="utf-8")
    assert "effects: []" in text
    (tmp_path / "m.yaml").write_text(
        text.replace(
            "effects: []",
            "effects:\n- {id: base.gain_v, parameters: {gain: 0.2}}\n- {id: smooth.v.x, parameters: "
            "{knot_0: 0.999, knot_1: 1.001, value_0: 0.0, value_1: 0.1}}",
        ),
        encoding="utf-8",
    )
    model = load_model(tmp_path / "m.yaml")
    (tmp_path / "w.world").write_text("model ( pose [500 0 0 0] )\nposition ( pose [0.5 0 0 0] )", encoding="utf-8")
    dynamics = load_dynamics(shipped("launch/physical.yaml"))
    simulator = ChairSimulator(model, load_world(tmp_path / "w.world"), dynamics)
    simulator.reset(1)
    command = Command(model.translation.volts(0.5), 0.0, 1.0, 0.0)
    seen = [simulator.step(command) for _ in range(round(2.0 / simulator.step_time))]
    for observation in seen:
        expected = 0.6 if observation.pose[0] < 0.98 else 0.7 if observation.pose[0] > 1.02 else None
        if expected:
            assert observation.rates[0] == pytest.approx(expected, abs=1e-9)
    assert seen[0].pose[0] < 0.98 < 1.02 < seen[-1].pose[0]

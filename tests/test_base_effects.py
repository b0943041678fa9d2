# SPDX-License-Identifier: BSD-3-Clause
"""Each effect on the base against its formula by hand, or against a differential equation solved by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from kurumaisu import _core, effects
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.plant import Plant, path

DT = 0.01
MODEL = load_model(shipped("launch/md100.yaml"))
CONTEXT = effects.Context(MODEL.translation, MODEL.steering, np.random.default_rng(0))
V = np.array([0.5, -0.5, 0.2, 0.0, 0.0, 1.4])
W = np.array([0.3, 0.4, -0.6, 0.5, 0.0, 0.0])


def apply(name, values, v=V, w=W, **more):
    motion = effects.Motion(DT, np.array(v, dtype=float), np.array(w, dtype=float), **more)
    return effects.by_id(name)(values, CONTEXT).apply(motion)


# name, parameters, v and w expected of V and W
STATIC = [
    ("base.reverse_gain", {"gain": 0.1}, [0.5, -0.55, 0.2, 0.0, 0.0, 1.4], W),
    ("base.curvature_v", {"curvature": 0.1}, [0.475, -0.475, 0.196, 0.0, 0.0, 1.204], W),
    ("base.curvature_v", {"curvature": 0.1, "power": 2.0}, [0.4875, -0.4875, 0.1992, 0.0, 0.0, 1.1256], W),
    ("base.curvature_v", {"curvature": 1.0}, [0.25, -0.25, 0.16, 0.0, 0.0, 0.0], W),
    ("base.curvature_w", {"curvature": -0.1}, V, [0.309, 0.416, -0.636, 0.525, 0.0, 0.0]),
    (
        "base.saturation",
        {"inverse_v": 2.5, "inverse_w": 2.0, "knee": 0.0},
        [0.4, -0.4, 0.2, 0.0, 0.0, 0.4],
        [0.3, 0.4, -0.5, 0.5, 0, 0],
    ),
    ("base.understeer", {"k": 0.2}, V, [0.285, 0.38, -0.5952, 0.5, 0.0, 0.0]),
    ("base.cross_w_to_v", {"lever": 0.1, "even": 0.0}, [0.53, -0.46, 0.14, 0.05, 0.0, 1.4], W),
    ("base.cross_w_to_v", {"lever": -0.1, "even": 1.0}, V - 0.1 * np.abs(W), W),
    ("base.sign", {"factor_v": -1.0, "factor_w": 2.0, "swap": 0.0}, -V, 2 * W),
    ("base.sign", {"factor_v": 1.0, "factor_w": 1.0, "swap": 1.0}, W, V),
    # 1 % of 1.32402 v + 0.127906 V, or of 2.07369 v - 0.108783 V in reverse, by 1 / -0.499211 or 1 / -0.469278
    (
        "base.cross_v_to_w",
        {"share": 0.01},
        V,
        [
            0.3 - 0.00789916 / 0.499211,
            0.4 + 0.01145628 / 0.499211,
            -0.6 - 0.0039271 / 0.469278,
            0.5,
            0.0,
            -0.01981534 / 0.499211,
        ],
    ),
    (
        "base.battery_sag",
        {"sag": 0.1, "through": 1.0},
        V * (1 - 0.1 * DT * (0.5 + np.arange(6))),
        W * (1 - 0.1 * DT * (0.5 + np.arange(6))),
    ),
    ("base.payload", {"droop": 0.1, "tau": 0.0}, 0.9 * V, 0.9 * W),
]


@pytest.mark.parametrize(("name", "values", "v", "w"), STATIC, ids=lambda it: it if isinstance(it, str) else "")
def test_formula_at_chosen_values(name, values, v, w):
    out = apply(name, values)
    np.testing.assert_allclose(out.v, v, atol=1e-12)
    np.testing.assert_allclose(out.w, w, atol=1e-12)
    assert out.u is None


def test_a_leak_that_the_dead_zone_swallows_turns_no_chair_back():
    """10 % of 0.79 V at 0.5 m/s turn it by 0.158 rad/s to the right, or by 0.168 if it turns right already."""
    out = apply("base.cross_v_to_w", {"share": 0.1, "rests": 1.0}, [0.5, 0.5, 0.5], [0.3, 0.1, 0.0])
    np.testing.assert_allclose(out.w, [0.3 - 0.0789916 / 0.499211, 0.0, 0.0], atol=1e-6)


def test_lateral_slip_goes_outwards():
    np.testing.assert_allclose(
        apply("base.lateral_slip", {"c": 0.1}).u, [-0.015, 0.02, 0.012, 0.0, 0.0, 0.0], atol=1e-12
    )
    np.testing.assert_allclose(apply("base.lateral_slip", {"c": 0.1}, u=np.ones(6)).u[:2], [0.985, 1.02], atol=1e-12)


def test_slope_depends_on_the_heading_in_the_map():
    """A quarter turn per sample; the middle of the first is at 45 degrees, if nobody knows better."""
    turns = np.full(4, np.pi / 2 / DT)
    climb = {"climb_x": 0.02, "climb_y": 0.0}
    share = np.sqrt(0.5)
    np.testing.assert_allclose(
        apply("base.slope", climb, np.full(4, 0.3), turns).v, 0.3 - 0.02 * share * np.array([1, -1, -1, 1])
    )
    north = apply("base.slope", {"climb_x": 0.02, "climb_y": 0.03}, [0.3, -0.3], [0.0, 0.0], heading=np.pi / 2)
    np.testing.assert_allclose(north.v, [0.27, -0.33])
    assert not apply("base.slope", climb, np.zeros(3), np.zeros(3)).v.any()  # brakes
    # A floor that shakes the chair turns it where no sum of the turns asked for tells: where it heads was measured.
    seen = apply("base.slope", climb, [0.3, 0.3], [0.0, 0.0], heading=0.0, known={"heading": np.array([0.0, np.pi])})
    np.testing.assert_allclose(seen.v, [0.28, 0.32])


@given(cut=st.integers(1, 49), heading=st.floats(-7, 7), seed=st.integers(0, 99))
@settings(max_examples=20)
def test_slope_told_the_heading_in_chunks(cut, heading, seed):
    v, w = np.random.default_rng(seed).uniform(-1, 1, (2, 50))
    values = {"climb_x": 0.02, "climb_y": -0.03}
    whole = apply("base.slope", values, v, w, heading=heading).v
    then = heading + DT * w[:cut].sum()
    first = apply("base.slope", values, v[:cut], w[:cut], heading=heading).v
    second = apply("base.slope", values, v[cut:], w[cut:], heading=then).v
    np.testing.assert_allclose(np.concatenate([first, second]), whole, atol=1e-12)


def test_ramp_against_the_differential_equation():
    rng = np.random.default_rng(4)
    target = np.repeat(rng.uniform(-0.7, 0.7, 10), 20)
    slowness = 1.3

    def slope(t, state):
        gap = target[min(int(t / DT + 1e-9), 199)] - state[0]
        return [np.clip(1e5 * gap, -1 / slowness, 1 / slowness), state[0]]

    edges = np.arange(201) * DT
    solution = solve_ivp(
        slope, (0, 2.0), [0.0, 0.0], t_eval=edges, max_step=DT / 3, method="LSODA", rtol=1e-9, atol=1e-10
    )
    out = apply("base.accel_limit", {"slowness_v": slowness, "slowness_w": 0.0, "round": 0.0}, target, target)
    np.testing.assert_allclose(out.v, np.diff(solution.y[1]) / DT, atol=1e-5)
    np.testing.assert_array_equal(out.w, target)
    assert np.abs(np.diff(out.v)).max() <= DT / slowness + 1e-12


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _core.ramp(V, -1.0, DT, 0.0), "slowness must not be negative"),
        (lambda: _core.ramp(V, 1.0, 0.0, 0.0), "dt must be positive"),
        (lambda: _core.lag(V, 0.0, DT, 0.0), "tau and dt must be positive"),
        (lambda: _core.lag(V, 1.0, 0.0, 0.0), "tau and dt must be positive"),
        (lambda: _core.play(V, -0.1, 0.0), "half must not be negative"),
        (lambda: _core.play(np.zeros((2, 2)), 0.1, 0.0), r"inputs must have shape \(n,\)"),
    ],
)
def test_followers_refuse_nonsense(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_payload_is_a_gain_and_a_lag_of_both():
    rng = np.random.default_rng(5)
    v, w = np.repeat(rng.uniform(-0.7, 0.7, (2, 10)), 20, axis=1)
    out = apply("base.payload", {"droop": 0.1, "tau": 0.2}, v, w)
    np.testing.assert_allclose(out.v, apply("base.lag_v", {"tau": 0.2}, 0.9 * v, w).v)
    np.testing.assert_allclose(out.w, apply("base.lag_w", {"tau": 0.2}, v, 0.9 * w).w)


def test_backlash_drags_and_lets_go_at_rest():
    w = [0.0, 0.05, 0.3, 0.25, 0.15, 0.05, -0.2, 0.0, 0.0]
    v = [0.1] * 8 + [0.0]
    expected = [0.0, 0.0, 0.2, 0.2, 0.2, 0.15, -0.1, -0.1, 0.0]
    np.testing.assert_allclose(apply("base.backlash", {"play": 0.2}, v, w).w, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("onset", "expected"),
    [
        (0.5, [0.0, 0.4, 0.4, 0.3, 0.0, 0.2, -0.2, -0.2, -0.2]),
        (1.0, [0.0, 0.3, 0.3, 0.2, 0.0, 0.1, -0.1, -0.1, -0.1]),
    ],
)
def test_backlash_of_each_side_by_itself(onset, expected):
    """What begins to turn to the other side takes up its own play; at the onset it is lost while a turn grows."""
    w = np.array([0.1, 0.5, 0.4, 0.2, 0.0, 0.3, -0.3, -0.25, -0.1])
    moved = apply("base.backlash", {"play": 0.2, "onset": onset}, np.ones(len(w)), w).w
    np.testing.assert_allclose(moved, expected, atol=1e-12)


@given(inputs=st.lists(st.floats(-1, 1), min_size=1, max_size=60), play=st.floats(0, 0.5))
@settings(max_examples=50)
def test_backlash_is_never_further_than_half_the_play(inputs, play):
    out = apply("base.backlash", {"play": play}, np.ones(len(inputs)), inputs).w
    assert np.abs(out - inputs).max() <= play / 2 + 1e-12
    moved = np.diff(np.concatenate([[0.0], out]))
    at_the_end = np.isclose(np.abs(out - inputs), play / 2, atol=1e-12)
    assert (at_the_end | (moved == 0)).all()


def test_casters_kick_to_the_side_of_the_last_turn_and_die_away():
    """Forward in a left turn, then straight back: exp(-s / 0.25 m), s at the middle of each step of 5 mm."""
    n = 100
    v = np.concatenate([np.full(n, 0.5), np.zeros(10), np.full(n, -0.5)])
    w = np.concatenate([np.full(n, 0.2), np.zeros(n + 10)])
    values = {"kick": 0.1, "length": 0.25}
    out = apply("base.caster_reversal", values, v, w).w
    np.testing.assert_array_equal(out[: n + 10], w[: n + 10])
    s = 0.005 * (np.arange(n) + 0.5)
    np.testing.assert_allclose(out[n + 10 :], 0.1 * np.exp(-s / 0.25), atol=1e-12)
    np.testing.assert_allclose(apply("base.caster_reversal", values, v, -w).w[n + 10 :], -out[n + 10 :])
    assert not apply("base.caster_reversal", values, v, 0 * w).w.any()  # casters straight


@pytest.mark.parametrize(("by", "sides"), [(0.0, (1, 1)), (1.0, (-1, 1)), (2.0, (1, 1)), (3.0, (-1, 1))])
def test_casters_kick_by_the_turn_by_the_way_or_always_to_one_side(by, sides):
    """Forward in a left turn, straight back, straight forward again; and the same with a right turn."""
    n = 100
    v, w = np.repeat([0.5, -0.5, 0.5], n), np.repeat([0.2, 0.0, 0.0], n)
    values = {"kick": 0.1, "length": 0.25, "by": by}
    for turn in (1, -1):
        kicks = apply("base.caster_reversal", values, v, turn * w).w - turn * w
        expected = np.array(sides) * (1 if by >= 2 else turn)
        assert not kicks[:n].any()
        np.testing.assert_array_equal(np.sign(kicks[n::n]), expected)


def test_casters_stand_as_before_a_step_in_which_everything_changes():
    """From left forward to right backward late within a step, whose means still drive forward but turn right."""
    v = np.concatenate([np.full(50, 0.5), [0.3], np.full(50, -0.5)])
    w = np.concatenate([np.full(50, 0.1), [-0.05], np.full(50, -0.5)])
    out = apply("base.caster_reversal", {"kick": 0.1, "length": 0.25}, v, w).w - w
    assert not out[:51].any()
    assert (out[51:] > 0).all()


def test_dac_zero_and_steps():
    it = effects.Volts(np.array([0.1, 0.0]), np.array([-0.1234, 0.0]), np.array([1.0, 0.0]), np.array([1.0, 0.0]))
    zero = effects.by_id("base.dac_zero_f")({"offset": 0.02}, CONTEXT).apply(it)
    np.testing.assert_allclose([*zero.v_f, *zero.v_s], [0.12, 0.0, -0.1234, 0.0])  # brakes hold what is asked to rest
    zero = effects.by_id("base.dac_zero_s")({"offset": 0.02, "rests": 0.0}, CONTEXT).apply(it)
    np.testing.assert_allclose([*zero.v_f, *zero.v_s], [0.1, 0.0, -0.1034, 0.02])


@pytest.mark.parametrize(
    ("form", "expected"),
    [((0.0, 0.0), [0.1, 0.0, -0.125, 0.0]), ((0.5, 0.0), [0.1025, 0.0, -0.1225, 0.0]),
     ((0.5, 1.0), [0.1, 0.0, -0.12, 0.0])],
)  # fmt: skip
def test_steps_are_rounded_or_have_no_zero_or_cut(form, expected):
    it = effects.Volts(np.array([0.101, 0.0]), np.array([-0.1234, 0.0]), np.array([1.0, 0.0]), np.array([1.0, 0.0]))
    values = {"step": 0.005, "phase": form[0], "cut": form[1], "rests": 0.0}
    steps = effects.by_id("base.dac_quantisation")(values, CONTEXT).apply(it)
    np.testing.assert_allclose([*steps.v_f, *steps.v_s], expected)


@pytest.mark.parametrize(("rests", "rate"), [(0.0, -0.169476 / 0.469278), (1.0, 0.0)])
def test_a_turn_of_no_volts_goes_on_or_rests(rests, rate):
    effect = EffectSetting("base.dac_quantisation", {"step": 0.01, "phase": 0.0, "cut": 0.0, "rests": rests})
    plant = Plant(replace(MODEL, effects=(effect,)), DT, np.random.default_rng(0))
    w = plant.from_rates(np.zeros(2), np.array([-0.36, 0.0])).w
    np.testing.assert_allclose(w, [rate, 0.0], atol=1e-9)


def test_a_voltage_beyond_its_branch_is_the_other_side_or_rest():
    """A left turn of 0.05 rad/s is 0.0792 V; 0.05 V more is a right turn by equation (2)."""
    law = CONTEXT.steering
    it = effects.Volts(np.zeros(2), law.volts(np.array([0.05, 0.2])), np.zeros(2), np.ones(2))
    jumps, rests = (
        effects.by_id("base.dac_zero_s")({"offset": 0.05, "rests": rests}, CONTEXT).apply(it) for rests in (0.0, 1.0)
    )
    np.testing.assert_allclose(jumps.v_s, it.v_s + 0.05)
    np.testing.assert_allclose(rests.v_s, [0.0, it.v_s[1] + 0.05])


def test_steps_beyond_the_end_of_a_branch_are_rest_or_the_other_side():
    """A left turn of 0.05 rad/s is 0.0792 V, and no turn 0.1042 V; the nearest level is 0.12 V, a right turn."""
    it = effects.Volts(np.zeros(2), CONTEXT.steering.volts(np.array([0.05, 0.5])), np.zeros(2), np.ones(2))
    form = {"step": 0.12, "phase": 0.0, "cut": 0.0}
    jumps, rests = (
        effects.by_id("base.dac_quantisation")({**form, "rests": rests}, CONTEXT).apply(it) for rests in (0.0, -1.0)
    )
    np.testing.assert_allclose(jumps.v_s, [0.12, -0.12])
    np.testing.assert_allclose(rests.v_s, [0.0, -0.12])


@pytest.mark.parametrize("offset", [0.02, -0.02])
def test_a_chair_without_brakes_creeps_at_rest_by_an_offset(offset):
    """As fast as it is then faster when it drives: there is no neutral zone in which the offset is lost."""
    effect = EffectSetting("base.dac_zero_f", {"offset": offset, "rests": -1.0})
    plant = Plant(replace(MODEL, effects=(effect,)), DT, np.random.default_rng(0))
    side = MODEL.translation.positive if offset > 0 else MODEL.translation.negative
    v = plant.from_rates(np.array([0.0, 0.3]), np.zeros(2)).v
    np.testing.assert_allclose(v, [offset / side.slope, 0.3 + offset / MODEL.translation.positive.slope], atol=1e-9)


def test_turning_moves_the_chair_as_it_turns_not_as_it_was_asked_to():
    """Else a lag would tell it from a marker beside base_link, which it is exactly like."""
    acting = (
        EffectSetting("base.lag_w", {"tau": 0.2}),
        EffectSetting("base.understeer", {"k": 0.3}),
        EffectSetting("base.cross_w_to_v", {"lever": 0.1, "even": 0.0}),
    )
    v, w = np.full(200, 0.4), np.where(np.arange(200) < 80, 0.5, -0.3)
    out = Plant(replace(MODEL, effects=acting), DT, np.random.default_rng(0)).from_rates(v, w)
    np.testing.assert_allclose(out.v - v, 0.1 * out.w, atol=1e-12)
    assert np.abs(out.w - w).max() > 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_dead_zone_of_one_branch_leaves_the_other_as_it_is(side):
    values = {"width": 0.02, "even": 0.0, "whole": 0.0, "side": side}
    v = np.array([0.5, -0.5, 0.005, -0.005, 0.0])
    both = apply("base.dead_zone_v", {**values, "side": 0.0}, v, np.zeros(5)).v
    out = apply("base.dead_zone_v", values, v, np.zeros(5)).v
    np.testing.assert_array_equal(out, np.where(v * side > 0, both, v))
    assert (both[2:] == 0).all()


def test_a_steering_without_a_neutral_zone_turns_a_chair_that_is_to_drive_straight():
    """By its offset alone, as it turns one that is to turn; a chair that is to rest is held by its brakes."""
    shifted = replace(MODEL, effects=(EffectSetting("base.dac_zero_s", {"offset": -0.02, "rests": -1.0}),))
    rates = np.array([0.5, 0.5, 0.5, 0.0]), np.array([0.0, 0.4, -0.4, 0.0])
    out = Plant(shifted, DT, np.random.default_rng(0)).from_rates(*rates)
    np.testing.assert_allclose(out.w - rates[1], [0.02 / 0.499211, 0.02 / 0.499211, 0.02 / 0.469278, 0.0], atol=1e-9)


def test_casters_do_not_turn_a_chair_that_creeps_to_its_rest():
    v = np.concatenate([np.full(10, 0.5), np.full(10, -0.5), -0.5e-3 * 0.5 ** np.arange(10)])
    out = apply("base.caster_reversal", {"kick": 0.1, "length": 0.25}, v, np.where(v > 0, 0.2, 0.0)).w
    assert out[10:20].all()
    assert not out[20:].any()


def test_a_shifted_zero_reaches_the_rates_by_the_voltage_law():
    shifted = replace(MODEL, effects=(EffectSetting("base.dac_zero_f", {"offset": 0.02}),))
    out = Plant(shifted, DT, np.random.default_rng(0)).from_rates(np.array([0.5, -0.5, 0.0]), np.zeros(3))
    np.testing.assert_allclose(out.v, [0.5 + 0.02 / 1.32402, -0.5 + 0.02 / 2.07369, 0.0], atol=1e-12)


def test_path_with_slip_against_the_differential_equation():
    v, u, w = np.random.default_rng(6).uniform(-1, 1, (3, 20))

    def slope(t, pose):
        k = min(int(t / 0.1 + 1e-9), 19)
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return [c * v[k] - s * u[k], s * v[k] + c * u[k], w[k]]

    solution = solve_ivp(
        slope, (0, 2), [1.0, 2.0, 0.5], t_eval=np.arange(21) * 0.1, max_step=0.02, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(path(effects.Motion(0.1, v, w, u), np.array([1.0, 2.0, 0.5])), solution.y.T, atol=1e-7)


@pytest.mark.parametrize("effect", effects.ALL, ids=lambda effect: effect.id)
def test_values_beyond_the_bounds_are_refused_by_name(effect):
    nulls = {parameter.name: parameter.null for parameter in effect.parameters}
    for parameter in effect.parameters:
        assert parameter.lower <= parameter.null <= parameter.upper
        assert parameter.lower <= parameter.null + parameter.scale <= parameter.upper
        for wrong in (parameter.lower - 1, parameter.upper + 1, float("nan")):
            with pytest.raises(Error, match=f"{effect.id}: {parameter.name} must be"):
                effect({**nulls, parameter.name: wrong}, CONTEXT)
    with pytest.raises(Error, match=f"{effect.id}: needs the parameters"):
        effect({**nulls, "nonsense": 1.0}, CONTEXT)


def test_every_effect_on_the_base_that_is_asked_for_exists():
    ids = """gain_v gain_w veer dead_zone_v dead_zone_w dac_zero_f dac_zero_s dac_quantisation reverse_gain
        left_right_gain curvature_v curvature_w lag_v lag_w delay accel_limit saturation battery_sag understeer
        lateral_slip slope caster_reversal backlash cross_w_to_v cross_v_to_w marker_x marker_y marker_yaw clock_scale
        payload process_noise sign steering_law"""
    assert sorted(effect.id for effect in effects.BASE) == sorted(f"base.{name}" for name in ids.split())

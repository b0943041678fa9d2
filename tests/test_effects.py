# SPDX-License-Identifier: BSD-3-Clause
"""Effects against differential equations solved by scipy, and their promise: chunks do not matter."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from kurumaisu import effects
from kurumaisu._core import AxisInverse
from kurumaisu.effects import __main__ as table
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.settings import with_effects

DT = 0.01
MODEL = load_model(shipped("launch/md100.yaml"))
TYPICAL = {
    effect.id: {parameter.name: parameter.null + parameter.scale for parameter in effect.parameters}
    for effect in effects.ALL
}
RATES = [effect for effect in effects.BASE if issubclass(effect, effects.Effect)]
VOLTS = [effect for effect in effects.BASE if issubclass(effect, effects.VoltageEffect)]


def context(seed: int = 0) -> effects.Context:
    return effects.Context(MODEL.translation, MODEL.steering, np.random.default_rng(seed))


def drive(n: int, seed: int) -> effects.Motion:
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-0.7, 0.7, (n // 20 + 1, 2)) * (rng.random((n // 20 + 1, 2)) > 0.2)
    rates = np.repeat(steps, 20, axis=0)[:n]
    return effects.Motion(DT, rates[:, 0], rates[:, 1])


def rates(motion: effects.Motion) -> np.ndarray:
    return np.array([motion.v, np.zeros_like(motion.v) if motion.u is None else motion.u, motion.w])


@pytest.mark.parametrize("effect", RATES, ids=lambda effect: effect.id)
@given(cuts=st.lists(st.integers(1, 299), max_size=6, unique=True), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_chunks_give_the_same_motion_as_the_whole(effect, cuts, seed):
    motion = drive(300, seed)
    whole = effect(TYPICAL[effect.id], context()).apply(motion)
    chunked = effect(TYPICAL[effect.id], context())
    bounds = [0, *sorted(cuts), 300]
    parts = [chunked.apply(effects.Motion(DT, motion.v[a:b], motion.w[a:b])) for a, b in pairwise(bounds)]
    np.testing.assert_allclose(np.hstack([rates(part) for part in parts]), rates(whole), atol=1e-12)


@pytest.mark.parametrize("effect", RATES, ids=lambda effect: effect.id)
def test_every_effect_changes_the_motion_and_its_null_does_not(effect):
    motion = drive(400, 1)
    changed = effect(TYPICAL[effect.id], context()).apply(motion)
    assert not np.allclose(rates(changed), rates(motion), atol=1e-4)
    null = {parameter.name: parameter.null for parameter in effect.parameters}
    np.testing.assert_allclose(rates(effect(null, context()).apply(motion)), rates(motion), atol=1e-12)


def volts(n: int, seed: int) -> effects.Volts:
    rng = np.random.default_rng(seed)
    v, w = rng.uniform(-0.7, 0.7, (2, n)) * (rng.random((2, n)) > 0.2)
    return effects.Volts(MODEL.translation.volts(v), MODEL.steering.volts(w), np.sign(v), np.sign(w))


def columns(it: effects.Volts) -> np.ndarray:
    return np.array([it.v_f, it.v_s, it.sign_v, it.sign_w])


@pytest.mark.parametrize("effect", VOLTS, ids=lambda effect: effect.id)
@given(cut=st.integers(1, 99), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_chunks_give_the_same_voltages_as_the_whole(effect, cut, seed):
    given_volts = columns(volts(100, seed))
    whole = columns(effect(TYPICAL[effect.id], context()).apply(effects.Volts(*given_volts)))
    chunked = effect(TYPICAL[effect.id], context())
    parts = [columns(chunked.apply(effects.Volts(*part))) for part in (given_volts[:, :cut], given_volts[:, cut:])]
    np.testing.assert_allclose(np.hstack(parts), whole, atol=1e-12)
    assert not np.allclose(whole, given_volts, atol=1e-6)
    same = effect({p.name: p.null for p in effect.parameters}, context()).apply(effects.Volts(*given_volts))
    np.testing.assert_array_equal(columns(same), given_volts)


def test_the_other_steering_law_is_the_shipped_one():
    """Voltages of the published law, by (2) with its intercepts flipped, typed from the model file's other law."""
    law = effects.by_id("base.steering_law")({"flip": 1.0, "meant": 0.0}, context())
    asked = np.array([0.7, 0.1, 0.0, -0.1, -0.7])
    given_volts = effects.Volts(np.zeros(5), MODEL.steering.volts(asked), np.zeros(5), np.sign(asked))
    answered = law.apply(given_volts)
    expected = [
        (v + 0.104181) / -0.499211 if v < -0.104181 else min(0.169476 - v, 0) / 0.469278 for v in given_volts.v_s
    ]
    assert expected[3] == pytest.approx(0.0368, abs=1e-4)  # asked for the right, turns to the left
    back = AxisInverse(MODEL.steering).rates(answered.v_s, answered.sign_w)
    np.testing.assert_allclose(back, expected, atol=1e-12)


def test_lag_against_the_differential_equation():
    tau, motion = 0.23, drive(300, 1)

    def slope(t, state):
        k = min(int(t / DT + 1e-9), 299)
        return [(motion.w[k] - state[0]) / tau, state[0]]

    solution = solve_ivp(
        slope, (0, 3.0), [0.0, 0.0], t_eval=np.arange(301) * DT, max_step=DT / 4, rtol=1e-9, atol=1e-12
    )
    mean_rates = np.diff(solution.y[1]) / DT
    lagged = effects.by_id("base.lag_w")({"tau": tau}, context()).apply(motion).w
    np.testing.assert_allclose(lagged, mean_rates, atol=1e-5)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.123])
def test_delay_moves_the_integral_in_time(delay):
    motion = drive(300, 2)
    late = effects.by_id("base.delay")({"delay": delay}, context()).apply(motion)
    edges = np.arange(301) * DT
    integral = np.concatenate([[0.0], np.cumsum(motion.v) * DT])
    expected = np.diff(np.interp(edges - delay, edges, integral)) / DT
    np.testing.assert_allclose(late.v, expected, atol=1e-12)


def test_dead_zone_swallows_volts_of_each_branch():
    motion = effects.Motion(DT, np.array([0.5, -0.5, 0.02, 0.0]), np.zeros(4))
    out = effects.by_id("base.dead_zone_v")({"width": 0.06, "even": 0.0, "whole": 0.0}, context()).apply(motion).v
    np.testing.assert_allclose(out, [0.5 - 0.06 / 1.32402, -0.5 + 0.06 / 2.07369, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("whole", "forward"), [(0.0, 0.5 - 0.06 / 1.32402), (1.0, 0.5)])
def test_a_dead_zone_of_rates_is_as_wide_on_either_side(whole, forward):
    motion = effects.Motion(DT, np.array([0.5, -0.5, 0.045, -0.045, -0.046]), np.zeros(5))
    values = {"width": 0.06, "even": 1.0, "whole": whole}
    out = effects.by_id("base.dead_zone_v")(values, context()).apply(motion).v
    beyond = -0.046 if whole else -0.046 + 0.06 / 1.32402
    np.testing.assert_allclose(out, [forward, -forward, 0.0, 0.0, beyond], atol=1e-12)


def test_process_noise_has_the_stated_size_and_colour():
    n, tau = 400_000, 0.3
    motion = effects.Motion(DT, np.full(n, 0.5), np.full(n, 0.1))
    noise = effects.by_id("base.process_noise")({"sd_v": 0.01, "sd_w": 0.02, "tau": tau, "growth": 0.0}, context(5))
    out = noise.apply(motion)
    samples = n * DT / (2 * tau)  # independent ones
    for values, sd in ((out.v - 0.5, 0.01), (out.w - 0.1, 0.02)):
        assert values.std() == pytest.approx(sd, rel=4 / np.sqrt(2 * samples))
        assert np.corrcoef(values[:-30], values[30:])[0, 1] == pytest.approx(np.exp(-1), abs=4 / np.sqrt(samples))


def build(*pairs):
    return effects.build(tuple(EffectSetting(name, values) for name, values in pairs), context())


def test_effects_act_in_the_order_of_the_drive_chain():
    built = build(("base.lag_v", {"tau": 0.1}), ("base.gain_v", {"gain": 0.1}), ("base.delay", {"delay": 0.1}))
    assert [effect.id for effect in built.rates] == ["base.delay", "base.gain_v", "base.lag_v"]


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ([("base.lagv", {"tau": 0.1})], "'base.lagv' is not in the catalogue"),
        ([("base.lag_v", {"tau": -1.0})], "base.lag_v: tau must be 0 to 3 s: -1"),
        ([("base.lag_v", {"t": 0.1})], "base.lag_v: needs the parameters tau; got t"),
        ([("base.gain_v", {"gain": 0.1}), ("base.gain_v", {"gain": 0.2})], "given twice"),
    ],
)
def test_bad_settings_are_refused_by_name(pairs, message):
    with pytest.raises(Error, match=message):
        build(*pairs)


def test_the_catalogue_in_docs_is_that_of_the_classes():
    page = Path(__file__).resolve().parents[1] / "docs/effects.md"
    assert page.read_text(encoding="utf-8") == table.text()


def test_shipped_files_of_effects_are_accepted():
    folder, of_robots = shipped("launch/md100.yaml").parent, "simulator.yaml"  # which has effects by robots' names
    files = [path for path in folder.glob("*.yaml") if "\neffects:" in path.read_text() and path.name != of_robots]
    assert {"real_laser.yaml", "uneven_floor.yaml"} < {path.name for path in files}
    for path in files:
        listed = with_effects(MODEL, path).effects if path.name != "md100.yaml" else MODEL.effects
        effects.build(listed, context())
        effects.build_laser(listed, np.random.default_rng(0))

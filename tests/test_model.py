# SPDX-License-Identifier: BSD-3-Clause
"""Equations (1)-(4) as Python sees them: against mpmath in 50 digits, scipy, and their own inverses."""

import mpmath
import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.stats import kstest

from kurumaisu._core import AxisInverse, AxisLaw, Branch, LaserError, integrate
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped

MD100 = shipped("launch/md100.yaml")
LAWS = yaml.safe_load(MD100.read_text(encoding="utf-8"))["voltage_laws"]
AXES = [(name, axis) for name in LAWS for axis in ("translation", "steering")]
mpmath.mp.dps = 50


def law(name, axis):
    sides = LAWS[name][axis]
    return AxisLaw(*(Branch(sides[side]["slope"], sides[side]["intercept"]) for side in ("positive", "negative")))


def pose_by_mpmath(v, w, dt):
    v, w, dt = mpmath.mpf(v), mpmath.mpf(w), mpmath.mpf(dt)
    if w == 0:
        return [v * dt, mpmath.mpf(0), mpmath.mpf(0)]
    return [v / w * mpmath.sin(w * dt), v / w * (1 - mpmath.cos(w * dt)), w * dt]


@pytest.mark.parametrize("w", [0.0, 1e-300, 1e-12, 1e-9, 1e-6, 1e-4, 2e-4, 1e-3, 0.1, 1.0, 6.3, -1e-7, -3.0])
@pytest.mark.parametrize("v", [0.5, -0.3, 0.0])
def test_the_arc_is_exact_down_to_a_straight_line(v, w):
    pose = integrate(np.array([v]), np.array([w]), np.array([2.0]))[-1]
    expected = [float(x) for x in pose_by_mpmath(v, w, 2.0)]
    np.testing.assert_allclose(pose, expected, rtol=1e-14, atol=1e-15)


def test_a_drive_against_the_differential_equation():
    rng = np.random.default_rng(1)
    v, w, dt = rng.uniform(-1, 1, 20), rng.uniform(-2, 2, 20), rng.uniform(0.01, 0.5, 20)
    pose = np.array([0.3, -0.2, 1.0])
    for i in range(20):

        def slope(_, p, i=i):
            return [v[i] * np.cos(p[2]), v[i] * np.sin(p[2]), w[i]]

        pose = solve_ivp(slope, (0, dt[i]), pose, rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(integrate(v, w, dt, [0.3, -0.2, 1.0])[-1], pose, atol=1e-9)


@pytest.mark.parametrize("heading", [0.0, -2.0, 1e3, 99_999.9, -3e7])
@pytest.mark.parametrize("fastest", [0.5, 5.0, 90.0])
def test_a_drive_is_the_sum_of_its_steps(heading, fastest):
    """However many steps are taken at once, however far the chair has turned, and through turns of half a step."""
    rng = np.random.default_rng(2)
    v, w, dt = rng.uniform(-1, 1, 83), rng.uniform(-fastest, fastest, 83), rng.uniform(0.009, 0.011, 83)
    before = np.cumsum(np.append(heading, w * dt))
    middle, chord = before[:-1] + 0.5 * w * dt, v * dt * np.sinc(0.5 * w * dt / np.pi)
    way = np.cumsum(np.stack([chord * np.cos(middle), chord * np.sin(middle)], axis=1), axis=0)
    poses = integrate(v, w, dt, [0.0, 0.0, heading])
    np.testing.assert_array_equal(poses[:, 2], before)
    np.testing.assert_allclose(poses[1:, :2], way, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(("name", "axis"), AXES)
@given(rate=st.floats(-3.0, 3.0))
@example(rate=0.0)
@example(rate=5e-324)
@example(rate=-1e-17)
@example(rate=1e-9)
def test_every_rate_comes_back_from_its_voltage(name, axis, rate):
    it = law(name, axis)
    volts = np.array([it.volts(rate)])
    back = AxisInverse(it).rates(volts, np.sign([rate]))
    assert back[0] == pytest.approx(rate, abs=4e-15)


@pytest.mark.parametrize(("name", "axis"), AXES)
@given(volts=st.floats(-4.0, 4.0))
def test_every_voltage_has_one_rate_and_it_answers_to_the_voltage(name, axis, volts):
    """With or without a sign; a rate of 0 stands for 0 V and for the whole of a dead zone."""
    it = law(name, axis)
    for sign in (np.nan, -1.0, 0.0, 1.0):
        (rate,) = AxisInverse(it).rates(np.array([volts]), np.array([sign]))
        assert np.isfinite(rate)
        if rate != 0:
            assert it.volts(float(rate)) == pytest.approx(volts, abs=1e-8)


def test_volts_that_are_held_are_answered_as_one_by_one():
    inverse, alone = (AxisInverse(law("published", "steering")) for _ in range(2))
    volts = np.repeat([0.05, -0.3, 0.05, 0.0, 0.05, 0.05, np.nan], 3)
    signs = np.repeat([1.0, np.nan, np.nan, 0.0, 0.0, -1.0, 1.0], 3)
    one_by_one = [alone.rates(volts[i : i + 1], signs[i : i + 1])[0] for i in range(len(volts))]
    np.testing.assert_array_equal(inverse.rates(volts, signs), one_by_one)
    assert inverse.state == alone.state
    assert inverse.ambiguous_samples == 12


def test_the_last_unambiguous_sample_decides_without_a_sign():
    inverse = AxisInverse(law("published", "steering"))
    volts = np.array([-0.3, 0.05, 0.3, 0.05, -0.05])
    rates = inverse.rates(volts, np.full(5, np.nan))
    assert np.sign(rates).tolist() == [1, 1, -1, -1, -1]
    assert inverse.ambiguous_samples == 3


@pytest.mark.parametrize("name", LAWS)
def test_laws_by_hand(name):
    """V_f of 0.5 and -0.5 m/s, V_s of 0.3 and -0.3 rad/s, worked out from the printed coefficients."""
    expected = {
        "published": (0.789916, -1.145628, -0.0455823, -0.0286926),
        "corrected": (0.789916, -1.145628, -0.2539443, 0.3102594),
        "custom": (0.76201, -1.136845, -0.2539443, 0.3102594),
    }[name]
    found = [
        law(name, axis).volts(rate)
        for axis, rates in (("translation", 0.5), ("steering", 0.3))
        for rate in (rates, -rates)
    ]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_laser_against_mpmath_and_its_gate():
    error = load_model(MD100).laser.error
    for r in (0.06, 0.2, 0.5, 1.0, 1.226, 2.0, 3.9, 4.0):
        mean = mpmath.mpf("1.004587") * mpmath.mpf(r) + mpmath.mpf("0.058826")
        sd = (
            mpmath.mpf("0.000199") * mpmath.mpf(r) ** 2
            - mpmath.mpf("0.000488") * mpmath.mpf(r)
            + mpmath.mpf("0.002334")
        )
        assert error.mean(r) == pytest.approx(float(mean), abs=1e-15)
        assert error.deviation(r) == pytest.approx(float(sd), abs=1e-17)
        assert error.range(error.mean(r)) == pytest.approx(r, abs=1e-15)
    readings = error.reading(np.array([3.95, np.inf, 0.0, 1.0]), np.zeros(4))
    assert readings[0] == np.inf  # reads above 4 m: bias comes before the gate
    assert readings[1] == np.inf
    assert np.isnan(readings[2])  # 59 mm: below the gate
    assert readings[3] == 1.063  # 1.063413 in whole millimetres


def test_readings_have_the_distribution_of_equation_4():
    model = load_model(MD100).laser.error
    sigma = [0.002334, -0.000488, 0.000199]
    smooth = LaserError(scale=1.004587, datum_offset=0.0, sigma=sigma, resolution=0.0, range_min=0.0, range_max=9.0)
    draws = np.random.default_rng(4).standard_normal(20_000)
    r = np.full(20_000, 2.0)
    scaled = (smooth.reading(r, draws) - 2.0 * 1.004587) / 0.002154
    assert kstest(scaled, "norm").pvalue > 0.01
    steps = model.reading(r, draws) / 0.001
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m["voltage_laws"]["custom"]["steering"]["positive"].update(slope=0.0), "custom.steering: slope"),
        (lambda m: m["voltage_laws"]["custom"]["steering"]["positive"].update(slope=1.0), "the same sign"),
        (lambda m: m.update(voltage_law="publishd"), "voltage_law: must be one of"),
        (lambda m: m["laser"]["error"].update(sigma=[1.0]), "laser.error.sigma: must be a list of 3 numbers"),
        (lambda m: m["laser"]["error"].update(range_max=0.01), "range_max must exceed range_min"),
        (lambda m: m["laser"].update(beams=682.5), "laser.beams: must be an integer"),
        (lambda m: m["chassis"].pop("mass"), "chassis.mass: is missing"),
        (lambda m: m["chassis"].update(mas=1.0), "chassis.mas: is not a known key"),
        (lambda m: m.update(reference_voltage="2.5"), "reference_voltage: must be a number"),
        (lambda m: m.update(effects=[{"id": "base.lag_v"}]), r"effects\[0\].parameters: is missing"),
    ],
)
def test_a_bad_model_file_is_refused_by_file_and_key(tmp_path, change, message):
    model = yaml.safe_load(MD100.read_text(encoding="utf-8"))
    change(model)
    path = tmp_path / "chair.yaml"
    path.write_text(yaml.safe_dump(model), encoding="utf-8")
    with pytest.raises(Error, match=message) as refusal:
        load_model(path)
    assert str(path) in str(refusal.value)


def test_yaml_that_cannot_be_read_is_told_with_its_line(tmp_path):
    path = tmp_path / "chair.yaml"
    path.write_text("name: a\nlaser: {x: 1\n")
    with pytest.raises(Error, match=r"chair\.yaml:\d+: "):
        load_model(path)
    with pytest.raises(Error, match=r"none\.yaml: No such file"):
        load_model(tmp_path / "none.yaml")

# SPDX-License-Identifier: BSD-3-Clause
"""The IMU: errors by Allan variance and chi-square against IEEE 952's formulas, kinematics against derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, kstest

from kurumaisu.sim.sensors.imu import STANDARD_GRAVITY, Imu, ImuSettings
from kurumaisu.sim.sensors.inertial_error import InertialError, InertialErrorSettings
from kurumaisu.types import FloatArray

NONE = InertialErrorSettings(0, 0, 0, 1.0, 0, 0, math.inf)
ALARM = 1e-6


def allan_variances(readings: FloatArray, clusters: list[int]) -> list[FloatArray]:
    """Half the mean square of differences of means of neighbouring clusters, by axis; readings (n, axes)."""
    out = []
    for size in clusters:
        means = readings[: len(readings) // size * size].reshape(-1, size, readings.shape[1]).mean(axis=1)
        out.append((np.diff(means, axis=0) ** 2).mean(axis=0) / 2)
    return out


def long_run(terms: InertialErrorSettings, n: int, axes: int, dt: float, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    error = InertialError(terms, (axes,), rng)
    zero = np.zeros(axes)
    return np.array([error.apply(zero, dt, rng) for _ in range(n)])


def allan_variance(terms: InertialErrorSettings, t: FloatArray) -> FloatArray:
    """Return the Allan variance [u^2] at averaging times t [s] of short steps: IEEE Std 952-1997, annex C."""
    tc = terms.correlation_time
    shape = 1 - tc / (2 * t) * (3 - 4 * np.exp(-t / tc) + np.exp(-2 * t / tc))
    return terms.noise_density**2 / t + terms.random_walk**2 * t / 3 + 2 * terms.instability**2 * tc / t * shape


@pytest.mark.parametrize(
    "terms",
    [
        replace(NONE, noise_density=0.02),
        replace(NONE, random_walk=0.01),
        replace(NONE, instability=0.05, correlation_time=2.0),
        replace(NONE, noise_density=0.01, instability=0.03, correlation_time=3.0, random_walk=0.005),
    ],
    ids=["white", "walk", "markov", "all"],
)
def test_allan_variance_is_ieee_952s(terms: InertialErrorSettings) -> None:
    dt, axes = 0.02, 1000
    found = allan_variances(long_run(terms, 3000, axes, dt, 1), clusters := [10, 30, 100, 300, 1000])
    expected = allan_variance(terms, dt * np.array(clusters))
    for by_axis, value, size in zip(found, expected, clusters, strict=True):
        error = by_axis.std() / math.sqrt(axes)
        coarse = 0.3 * value / size**2 + (2e-2 * value / size)  # the formula is for steps much below the time
        assert abs(by_axis.mean() - value) < 5 * error + coarse, (size, by_axis.mean(), value)
        assert error < 0.05 * value  # or the test could not fail


def test_white_noise_by_chi_square() -> None:
    readings = long_run(replace(NONE, noise_density=0.02), 500, 200, 0.01, 2)
    expected = 0.02 / math.sqrt(0.01)
    assert ALARM < chi2.cdf(((readings / expected) ** 2).sum(), readings.size) < 1 - ALARM
    assert kstest(readings.ravel() / expected, "norm").pvalue > ALARM


def test_markov_bias_is_stationary_and_forgets_at_its_rate() -> None:
    terms = replace(NONE, instability=0.05, correlation_time=0.5)
    rng = np.random.default_rng(3)
    error = InertialError(terms, (40_000,), rng)
    first = error.bias
    for _ in range(7):
        error.apply(first * 0, 0.1, rng)
    last = error.bias
    assert kstest(first / 0.05, "norm").pvalue > ALARM
    assert kstest(last / 0.05, "norm").pvalue > ALARM
    assert np.corrcoef(first, last)[0, 1] == pytest.approx(math.exp(-0.7 / 0.5), abs=5 / 200)


def test_steps_may_be_of_any_length() -> None:
    """One long step and many short ones leave a bias of the same variance."""
    terms = replace(NONE, random_walk=0.1, instability=0.2, correlation_time=0.7)
    spread = []
    for steps in (1, 50):
        rng = np.random.default_rng(4)
        error = InertialError(terms, (40_000,), rng)
        for _ in range(steps):
            error.apply(np.zeros(40_000), 1.0 / steps, rng)
        spread.append(error.bias.var())
    assert spread == pytest.approx([0.01 + 0.04] * 2, rel=0.04)


def test_scale_limit_and_power_up_bias() -> None:
    rng = np.random.default_rng(5)
    readings = InertialError(replace(NONE, scale=0.1, limit=2.0), (3,), rng).apply(np.array([1.0, 5, -5]), 0.1, rng)
    np.testing.assert_allclose(readings, [1.1, 2.0, -2.0])
    assert InertialError(replace(NONE, bias=0.3), (90_000,), rng).bias.std() == pytest.approx(0.3, rel=0.02)


def ideal(mount: tuple[float, float, float], velocities: FloatArray, heading: str = "none") -> Imu:
    terms = ImuSettings(mount, NONE, NONE, heading)
    return Imu(terms, velocities, np.full(len(velocities), 0.4), np.random.default_rng(6))


rates = st.floats(-2, 2)
mounts = st.tuples(rates, rates, st.floats(-3, 3))


@settings(deadline=None)
@given(mount=mounts, v=st.tuples(rates, rates, rates), slope=st.tuples(rates, rates, rates))
def test_force_is_the_second_derivative_of_the_path_of_the_unit(
    mount: tuple[float, float, float], v: tuple[float, float, float], slope: tuple[float, float, float]
) -> None:
    """The path of the unit in the map, by Taylor's series of the robot's motion, differentiated twice by hand."""
    dt = 1e-3
    start, end = np.array([v]) - np.array([slope]) * dt / 2, np.array([v]) + np.array([slope]) * dt / 2
    reading = ideal(mount, start).read(end, dt, np.random.default_rng(7))
    # Velocity of the unit in the map at heading theta: R(theta) (v + w x r). Its derivative by central differences.
    h = 1e-5

    def velocity(t: float) -> FloatArray:
        forward, leftward, w = np.array(v) + np.array(slope) * t
        theta = v[2] * t + slope[2] * t**2 / 2
        c, s = math.cos(theta), math.sin(theta)
        a, b = forward - w * mount[1], leftward + w * mount[0]
        return np.array([c * a - s * b, s * a + c * b])

    acceleration = (velocity(h) - velocity(-h)) / (2 * h)
    c, s = math.cos(mount[2]), math.sin(mount[2])
    expected = [c * acceleration[0] + s * acceleration[1], c * acceleration[1] - s * acceleration[0], STANDARD_GRAVITY]
    np.testing.assert_allclose(reading.acceleration[0], expected, atol=1e-6)
    np.testing.assert_allclose(reading.angular_velocity[0], [0, 0, v[2]], atol=1e-12)


def test_a_circle_at_constant_speed_is_pulled_to_its_centre() -> None:
    v = np.array([[0.5, 0.0, 0.8]])
    reading = ideal((0.0, 0.0, 0.0), v).read(v, 0.01, np.random.default_rng(8))
    np.testing.assert_allclose(reading.acceleration, [[0, 0.4, STANDARD_GRAVITY]])
    assert reading.heading is None


def test_heading_is_integrated_from_the_measured_rate() -> None:
    v = np.array([[0.0, 0.0, 0.8], [0.0, 0.0, -0.8]])
    imu = ideal((0.0, 0.0, 0.1), v, "integrated")
    for _ in range(100):
        reading = imu.read(v, 0.1, np.random.default_rng(9))
    assert reading.heading is not None
    expected = np.array([0.5 + 8.0, 0.5 - 8.0])
    np.testing.assert_allclose(np.exp(1j * reading.heading), np.exp(1j * expected), atol=1e-9)

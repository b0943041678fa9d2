# SPDX-License-Identifier: BSD-3-Clause
"""Stage's ranger noise by its moments, sonars by geometry, and equation (4) by a million beams."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, kstest
from sensing import PLACE, BruteRays

from kurumaisu._core import LaserError
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.sensors.ranger_noise import RangerNoise
from kurumaisu.sim.sensors.sonar import Sonar, SonarSettings
from kurumaisu.world.model import Fan

N = 400_000
NOBODY = np.array([-2])
ONE_IN_A_MILLION = 1e-6  # chance of a false alarm, for seeds are fixed but code changes


def fan(samples: int, noise: tuple[float, float, float], range_max: float = 8.0, fov: float = 2.0) -> Fan:
    return Fan(np.zeros(4), 0.02, 0.0, range_max, fov, samples, np.array(noise), PLACE)


def test_constant_noise_is_a_variance() -> None:
    readings = RangerNoise([fan(N, (0.0004, 0, 0))]).readings(np.full(N, 3.0), np.random.default_rng(1))
    assert kstest((readings - 3.0) / 0.02, "norm").pvalue > ONE_IN_A_MILLION


def test_proportional_noise_has_stages_thousand_steps() -> None:
    readings = RangerNoise([fan(N, (0, 0.1, 0))]).readings(np.full(N, 4.0), np.random.default_rng(2))
    steps = (readings / 4.0 - 1) / 0.1 / 0.002
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    counts = np.bincount(np.round(steps).astype(int) + 500, minlength=1000)
    assert len(counts) == 1000  # from -1 to 0.998: the mean is -0.001
    statistic = ((counts - N / 1000) ** 2 / (N / 1000)).sum()
    assert chi2.sf(statistic, 999) > ONE_IN_A_MILLION


def test_bearings_swing_by_half_the_increment_times_the_angle() -> None:
    noise = RangerNoise([fan(5, (0, 0, 0.3), fov=0.8), fan(3, (0, 0, 0))])
    bearings = np.array([noise.bearings(np.random.default_rng(seed)) for seed in range(2000)])
    assert (bearings[:, 5:] == 0).all()
    limit = 0.5 * 0.2 * 0.3
    assert -limit <= bearings.min() < -0.99 * limit
    assert 0.99 * limit < bearings.max() < limit
    assert noise.on_bearings
    assert not noise.on_ranges


def test_misses_are_untouched_and_do_not_change_the_others() -> None:
    noise = RangerNoise([fan(4, (0.01, 0.1, 0), range_max=5.0)])
    some = noise.readings(np.array([1.0, 5.0, np.inf, 2.0]), np.random.default_rng(3))
    all_hit = noise.readings(np.array([1.0, 2.0, 2.0, 2.0]), np.random.default_rng(3))
    assert some[1] == 5.0
    assert some[2] == np.inf
    np.testing.assert_array_equal(some[[0, 3]], all_hit[[0, 3]])


def test_no_fans_and_no_noise() -> None:
    rng = np.random.default_rng(4)
    assert len(RangerNoise([]).readings(np.empty(0), rng)) == 0
    ranges = np.array([1.0, np.inf])
    np.testing.assert_array_equal(RangerNoise([fan(2, (0, 0, 0))]).readings(ranges, rng), ranges)


def ring(**changes: float) -> SonarSettings:
    values = {"field_of_view": 0.5, "rays": 101, "range_min": 0.1, "range_max": 5.0, "deviation": 0.0} | changes
    mounts = np.array([[0.1, 0.0, 0.2, 0.0], [0.0, 0.1, 0.2, math.pi / 2]])
    return SonarSettings(mounts, rays=int(values.pop("rays")), **values)


@given(angle=st.floats(-math.pi, math.pi), distance=st.floats(0.3, 4.0), tilt=st.floats(-1.2, 1.2))
@settings(max_examples=100)
def test_a_sonar_reads_the_nearest_point_of_a_wall_in_its_cone(angle: float, distance: float, tilt: float) -> None:
    facing = (
        angle + tilt
    )  # direction of the wall's normal; the foot of the perpendicular is within the cone or beside it
    normal, along = np.array([math.cos(facing), math.sin(facing)]), np.array([-math.sin(facing), math.cos(facing)])
    pose = np.array([1.0, 2.0, 0.0, angle])
    sonar = pose[:2] + 0.1 * np.array([math.cos(angle), math.sin(angle)])
    foot = sonar + distance * normal
    wall = np.array([[*(foot - 50 * along), *(foot + 50 * along), 0.0, 1.0]])
    reading = Sonar(ring()).read(BruteRays(wall), pose[None], NOBODY, np.random.default_rng(5))[0, 0]
    beside = max(abs(tilt) - 0.25, 0.0)  # of the nearest ray, if the foot is outside the cone
    expected = distance / math.cos(beside)
    half_spacing = 0.5 / 100 / 2
    if expected > 5.0:
        assert reading == np.inf
    elif expected / math.cos(half_spacing) < 5.0:
        assert expected * (1 - 1e-9) <= reading <= expected / math.cos(half_spacing) * (1 + 1e-9)


def test_sonar_beyond_and_below_its_range() -> None:
    wall = np.array([[5.5, -9, 5.5, 9, 0, 1], [-9, 0.15, 9, 0.15, 0, 1.0]])
    poses = np.array([[0.0, 0, 0, 0]])
    readings = Sonar(ring(rays=1)).read(BruteRays(wall), poses, NOBODY, np.random.default_rng(6))
    np.testing.assert_array_equal(readings, [[np.inf, -np.inf]])


def test_sonars_of_several_robots_keep_their_order() -> None:
    wall = np.array([[4.0, -9, 4.0, 9, 0, 1.0]])
    poses = np.array([[0.0, 0, 0, 0], [1.0, 0, 0, 0], [2.0, 0, 0, -math.pi / 2]])
    readings = Sonar(ring(rays=1)).read(BruteRays(wall), poses, np.array([0, 1, 2]), np.random.default_rng(7))
    np.testing.assert_allclose(readings, [[3.9, np.inf], [2.9, np.inf], [np.inf, 1.9]])


def published(
    scale: float = 1.004587, offset: float = 0.058826, resolution: float = 0.0, wider: float = 1.0
) -> LaserError:
    """Equation (4) as the paper prints it, or another law."""
    return LaserError(
        scale=scale,
        datum_offset=offset,
        sigma=(0.002334 * wider, -0.000488 * wider, 0.000199 * wider),
        resolution=resolution,
        range_min=0.0,
        range_max=100.0,
    )


def by_bins(ranges: np.ndarray, readings: np.ndarray, bins: int = 50) -> tuple[float, float]:
    """Probabilities of the means and deviations in bins of distance under equation (4), written out again here."""
    mean = 1.004587 * ranges + 0.058826
    deviation = 0.000199 * ranges**2 - 0.000488 * ranges + 0.002334
    z = ((readings - mean) / deviation).reshape(bins, -1)
    n = z.shape[1]
    means = chi2.sf(n * (z.mean(axis=1) ** 2).sum(), bins)
    spreads = chi2.cdf(((z - z.mean(axis=1, keepdims=True)) ** 2).sum(axis=1), n - 1)
    return float(means), float(kstest(spreads, "uniform").pvalue)


MILLION = 1_000_000


def test_a_million_beams_obey_equation_4() -> None:
    ranges = np.linspace(0.06, 4.0, MILLION)
    readings = published().reading(ranges, np.random.default_rng(8).standard_normal(MILLION))
    assert min(by_bins(ranges, readings)) > ONE_IN_A_MILLION


@pytest.mark.parametrize(
    "wrong",
    [published(scale=1.004597), published(offset=0.058856), published(resolution=0.004), published(wider=1.01)],
    ids=["10 um/m", "30 um", "4 mm steps", "1 % wider"],
)
def test_a_million_beams_tell_other_laws(wrong: LaserError) -> None:
    ranges = np.linspace(0.06, 4.0, MILLION)
    readings = wrong.reading(ranges, np.random.default_rng(8).standard_normal(MILLION))
    assert min(by_bins(ranges, readings)) < ONE_IN_A_MILLION


def test_the_shipped_laser_is_equation_4_with_steps_of_1_mm() -> None:
    error = load_model(shipped("launch/md100.yaml")).laser.error
    ranges = np.full(MILLION, 1.5)
    readings = error.reading(ranges, np.random.default_rng(9).standard_normal(MILLION))
    variance = error.deviation(ranges[:1])[0] ** 2 + 0.001**2 / 12  # Sheppard's correction
    assert abs(readings.mean() - error.mean(ranges[:1])[0]) < 5 * math.sqrt(variance / MILLION)
    assert chi2.cdf(readings.var() / variance * MILLION, MILLION - 1) == pytest.approx(0.5, abs=0.4999)
    np.testing.assert_allclose(readings * 1000, np.round(readings * 1000), atol=1e-9)

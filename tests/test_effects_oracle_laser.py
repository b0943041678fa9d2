# SPDX-License-Identifier: BSD-3-Clause
"""Every effect on readings against a second implementation, oracle_laser.py; what is drawn by its moments.

Seeds are fixed; a tolerance is four standard errors of what is estimated, so that a right effect fails once in 16000.
"""

from dataclasses import replace

import numpy as np
import oracle_laser
import pytest
from oracle_laser import Beam
from scipy import stats

from kurumaisu import effects
from kurumaisu.params import EffectSetting

N = 400
SIGMAS = 4.0
MOMENTS = [
    "laser.common_mode",
    "laser.beam_correlation",
    "laser.heavy_tails",
    "laser.mixed_pixels",
    "laser.dropout",
    "laser.crosstalk",
]
TESTED = [*oracle_laser.READINGS, *MOMENTS]
NO_OUTLIERS = {"outliers": 0.0, "reach": 0.1}


def beams(rng, n=N):
    """Beams that meet something, anywhere and at any time."""
    ranges = rng.uniform(0.1, 6.0, n)
    time = float(rng.uniform(0, 900))
    return [
        Beam(
            range=float(r),
            incidence=float(rng.uniform(0, 1.57)),
            reflectance=float(rng.uniform(0, 1.5)),
            bearing=float(rng.uniform(-3.1, 3.1)),
            time=time,
            mean=1.01 * float(r) + 0.05,
            sd=0.002 + 0.001 * float(r),
            noise=float(rng.standard_normal()),
        )
        for r in ranges
    ]


def echoes(some):
    column = {name: np.array([getattr(beam, name) for beam in some]) for name in ("range", "mean", "sd", "noise")}
    return effects.Echoes(
        stamp=some[0].time,
        bearings=np.array([beam.bearing for beam in some]),
        ranges=column["range"],
        incidence=np.array([beam.incidence for beam in some]),
        returns=np.array([beam.reflectance for beam in some]),
        mean=column["mean"],
        sd=column["sd"],
        noise=column["noise"],
        readings=np.full(len(some), -77.0),  # until readings are made they mean nothing
    )


def chain(name, seed=0, **values):
    return effects.build_laser((EffectSetting(name, values),), np.random.default_rng(seed))


def drawn(name, rng, anywhere):
    def draw(p):
        if anywhere:
            return float(rng.uniform(p.lower, p.upper))
        return float(np.clip(p.null + p.scale * rng.uniform(-3, 3), p.lower, p.upper))

    return {p.name: draw(p) for p in effects.by_id(name).parameters}


@pytest.mark.parametrize("name", oracle_laser.READINGS)
def test_readings(name):
    differs = 0.0
    for seed in range(5):
        rng = np.random.default_rng([seed, 3])
        values, some = drawn(name, rng, seed > 2), beams(rng)
        if name == "laser.beam_bias":
            values["sd"] = 0.0
        if name == "laser.quantisation":
            values["step"] = max(values["step"], 1e-4)
        expected = np.array([oracle_laser.READINGS[name](values, beam) for beam in some])
        np.testing.assert_allclose(chain(name, **values).read(echoes(some)), expected, atol=1e-12, err_msg=str(values))
        differs = max(differs, np.abs(expected - [beam.mean + beam.sd * beam.noise for beam in some]).max())
    assert differs > 1e-4, "else the comparison could not fail"


@pytest.mark.parametrize("name", [*oracle_laser.READINGS, *MOMENTS])
def test_beams_that_meet_nothing_return_nothing(name):
    """But for another laser's light, which needs no wall."""
    rng = np.random.default_rng(4)
    some = echoes(beams(rng))
    values = drawn(name, rng, False)
    free = replace(some, ranges=np.full(N, np.inf), mean=np.full(N, np.inf), sd=np.full(N, np.inf))
    readings = chain(name, **values).read(free)
    if name == "laser.crosstalk":
        readings = readings[readings > values["reach"]]
    assert np.isposinf(readings).all()


@pytest.mark.parametrize("name", ["laser.warmup", "laser.temperature", "laser.crosstalk"])
def test_time_runs_from_when_an_effect_begins_to_act(name):
    rng = np.random.default_rng(5)
    values, some = drawn(name, rng, False), echoes(beams(rng))
    late, early = chain(name, **values), chain(name, **values)
    late.effects[0].since = 123.0
    early_echoes = replace(some, stamp=some.stamp - 123.0)
    np.testing.assert_array_equal(late.read(some), early.read(early_echoes))
    assert (late.read(some) != early.read(some)).any()


def flat(n, seed, **more):
    """One scan of a wall at 2 m, with mean 2, sd 1 mm and independent noise."""
    it = effects.Echoes(
        stamp=0.0,
        bearings=np.linspace(-2.0, 2.0, n),
        ranges=np.full(n, 2.0),
        incidence=np.zeros(n),
        returns=np.ones(n),
        mean=np.full(n, 2.0),
        sd=np.full(n, 0.001),
        noise=np.random.default_rng(seed).standard_normal(n),
        readings=np.full(n, 2.0),
    )
    return replace(it, **more)


def test_beams_have_offsets_that_stay():
    n, sd = 20_000, 0.004
    it, silent = chain("laser.beam_bias", 1, sd=sd, amplitude=0.0, phase=0.0), flat(n, 0, noise=np.zeros(n))
    offsets = it.read(silent) - 2.0
    np.testing.assert_array_equal(it.read(replace(silent, stamp=50.0)) - 2.0, offsets)
    assert stats.kstest(offsets / sd, "norm").pvalue > 1e-3
    assert offsets.std() == pytest.approx(sd, rel=SIGMAS / np.sqrt(2 * n))
    assert abs(np.corrcoef(offsets[1:], offsets[:-1])[0, 1]) < SIGMAS / np.sqrt(n)


@pytest.mark.parametrize("rho", [0.0, 0.7, 0.95])
def test_a_scan_is_off_as_a_whole_and_remembers(rho):
    """2000 lasers, three scans each, so that samples are independent."""
    count, sd = 2000, 0.003
    silent = flat(3, 0, noise=np.zeros(3))
    lasers = [chain("laser.common_mode", 10 + i, sd=sd, rho=rho) for i in range(count)]
    rows = np.array([[it.read(replace(silent, stamp=0.1 * k)) - 2.0 for k in range(3)] for it in lasers])
    assert (rows == rows[:, :, :1]).all()
    scans = rows[:, :, 0]
    for k in range(3):  # stationary from the first on
        assert scans[:, k].std() == pytest.approx(sd, rel=SIGMAS / np.sqrt(2 * count))
        assert stats.kstest(scans[:, k] / sd, "norm").pvalue > 1e-3
    for lag in (1, 2):
        expected = rho**lag
        found = np.corrcoef(scans[:, 0], scans[:, lag])[0, 1]
        assert found == pytest.approx(expected, abs=SIGMAS * (1 - expected**2) / np.sqrt(count))


@pytest.mark.parametrize("rho", [0.5, -0.6])
def test_neighbours_err_together(rho):
    """The recursion exactly, then what it is for: size and correlation."""
    it = flat(500, 3)
    readings = chain("laser.beam_correlation", rho=rho).read(it)
    expected = [2.0 + 0.001 * z for z in oracle_laser.correlated(rho, it.noise.tolist())]
    np.testing.assert_allclose(readings, expected, atol=1e-15)
    scans = np.array([chain("laser.beam_correlation", rho=rho).read(flat(3, 100 + i)) - 2.0 for i in range(3000)])
    for k in range(3):
        assert scans[:, k].std() == pytest.approx(0.001, rel=SIGMAS / np.sqrt(2 * 3000))
    for lag in (1, 2):
        found = np.corrcoef(scans[:, 0], scans[:, lag])[0, 1]
        assert found == pytest.approx(rho**lag, abs=SIGMAS * (1 - rho ** (2 * lag)) / np.sqrt(3000))


@pytest.mark.parametrize("inverse_nu", [0.1, 0.2, 0.4])
def test_tails_are_student_s_of_the_same_size(inverse_nu):
    n, nu = 40_000, 1 / inverse_nu
    z = (chain("laser.heavy_tails", 2, inverse_nu=inverse_nu, core=0.0, **NO_OUTLIERS).read(flat(n, 4)) - 2.0) / 0.001
    assert stats.kstest(z * np.sqrt(nu / (nu - 2)), stats.t(nu).cdf).pvalue > 1e-3
    assert stats.kstest(z, "norm").pvalue < 1e-6, "and not the normal distribution"
    far = 2 * stats.t(nu).sf(3 * np.sqrt(nu / (nu - 2)))
    assert (np.abs(z) > 3).mean() == pytest.approx(far, abs=SIGMAS * np.sqrt(far / n))


def test_points_hang_between_foreground_and_background():
    """Posts in front of a wall, one beam wide, and steps of 5 cm, which are no jump."""
    n, probability = 60_000, 0.4
    ranges = np.full(n, 3.0)
    posts = np.arange(5, n - 5, 12)
    ranges[posts] = 1.0
    ranges[2::12] = 3.05
    it = flat(n, 5, ranges=ranges, mean=ranges, noise=np.zeros(n))
    readings = chain("laser.mixed_pixels", 6, probability=probability, jump=0.2).read(it)
    changed = readings != ranges
    beside = np.zeros(n, dtype=bool)
    for post in posts:
        beside[post - 1 : post + 2] = True
    assert not changed[~beside].any()
    count = int(beside.sum())
    assert changed[beside].mean() == pytest.approx(probability, abs=SIGMAS * np.sqrt(0.24 / count))
    for near in (True, False):  # a post's reading goes towards the wall, a wall's towards the post: both uniformly
        where = (readings[changed & ((ranges == 1.0) == near)] - 1.0) / 2.0
        assert stats.kstest(where, "uniform").pvalue > 1e-3
    assert (chain("laser.mixed_pixels", 6, probability=1.0, jump=0.2).read(it) != ranges).sum() == count


def test_readings_drop_out_as_often_as_asked():
    n = 40_000
    for seed, values in enumerate(
        [
            {"probability": 0.1, "per_metre": 0.0, "oblique": 0.0, "dark": 0.0},
            {"probability": 0.0, "per_metre": 0.1, "oblique": 0.3, "dark": 0.2},
            {"probability": 0.9, "per_metre": 0.1, "oblique": 0.0, "dark": 0.3},
        ]
    ):
        for beam in beams(np.random.default_rng(seed), 3):
            beam.reflectance = min(beam.reflectance, 1.0)
            it = flat(
                n,
                6,
                ranges=np.full(n, beam.range),
                incidence=np.full(n, beam.incidence),
                returns=np.full(n, beam.reflectance),
            )
            lost = np.isnan(chain("laser.dropout", seed, **values).read(it)).mean()
            chance = oracle_laser.dropout(values, beam)
            assert lost == pytest.approx(chance, abs=SIGMAS * np.sqrt(chance * (1 - chance) / n) + 1e-12)


def test_another_laser_s_light_comes_from_a_sector_that_drifts():
    n, values = 30_000, {"probability": 0.25, "width": 0.8, "drift": -0.7, "reach": 5.0}
    it, always = chain("laser.crosstalk", 7, **values), chain("laser.crosstalk", 7, **values | {"probability": 1.0})
    for stamp in (0.0, 3.0, 8.0):
        scan = flat(n, 7, stamp=stamp, noise=np.zeros(n))
        readings = it.read(scan)
        inside = np.array([oracle_laser.lit(values, bearing, stamp) for bearing in scan.bearings.tolist()])
        hit = readings != 2.0
        assert not hit[~inside].any()
        np.testing.assert_array_equal(always.read(scan) != 2.0, inside)
        if inside.any():
            assert hit[inside].mean() == pytest.approx(0.25, abs=SIGMAS * np.sqrt(0.19 / inside.sum()))
            assert stats.kstest(readings[hit] / 5.0, "uniform").pvalue > 1e-3
    assert inside.any()


def test_tails_on_an_unchanged_core_are_student_s_own():
    z = (chain("laser.heavy_tails", 2, inverse_nu=0.25, core=1.0, **NO_OUTLIERS).read(flat(40_000, 4)) - 2.0) / 0.001
    assert stats.kstest(z, stats.t(4).cdf).pvalue > 1e-3


def test_outliers_are_as_many_and_as_far_as_asked_anywhere_in_the_fan():
    n, share, reach = 60_000, 0.05, 0.3
    errors = chain("laser.heavy_tails", 2, inverse_nu=0.0, core=0.0, outliers=share, reach=reach).read(flat(n, 4)) - 2.0
    far = np.abs(errors) > 0.01
    expected = share * 2 * stats.norm.sf(0.01 / reach)
    assert far.mean() == pytest.approx(expected, abs=SIGMAS * np.sqrt(expected / n))
    assert stats.kstest(errors[far & (errors > 0)], stats.truncnorm(0.01 / reach, 9, scale=reach).cdf).pvalue > 1e-3
    assert stats.kstest(np.flatnonzero(far) / n, "uniform").pvalue > 1e-3, "no bursts"
    assert stats.kstest(errors[~far] / 0.001, "norm").pvalue > 1e-3, "the rest as it was"


def test_outliers_anywhere_are_even_up_to_the_most_that_is_read():
    n, share = 60_000, 0.05
    scan = replace(flat(n, 4), farthest=8.0)
    values = {"inverse_nu": 0.0, "core": 0.0, "outliers": share, "reach": 0.1, "anywhere": 1.0}
    readings = chain("laser.heavy_tails", 2, **values).read(scan)
    far = np.abs(readings - 2.0) > 0.01
    assert far.mean() == pytest.approx(share, abs=SIGMAS * np.sqrt(share / n))
    assert stats.kstest(readings[far] / 8.0, "uniform").pvalue > 1e-3
    assert stats.kstest((readings[~far] - 2.0) / 0.001, "norm").pvalue > 1e-3, "the rest as it was"

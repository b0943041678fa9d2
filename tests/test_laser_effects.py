# SPDX-License-Identifier: BSD-3-Clause
"""Each effect on the laser against its formula by hand, or its distribution against scipy's."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from kurumaisu import effects
from kurumaisu.params import EffectSetting

N = 7
RANGES = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, np.inf])
HIT = np.isfinite(RANGES)
BEARINGS = np.linspace(-1.5, 1.5, N)
INCIDENCE = np.deg2rad([0.0, 30.0, 60.0, 80.0, 89.0, 0.0, 0.0])
NULLS = {effect.id: {p.name: p.null for p in effect.parameters} for effect in effects.ALL}
READING = [effect for effect in effects.LASER if issubclass(effect, effects.ReadingEffect)]
PACK = 20_000  # beams of a scan for statistics
ALPHA = 1e-4  # of a test of a distribution; the seeds are fixed


def echoes(ranges=RANGES, stamp=0.0, seed=0, **more):
    n = len(ranges)
    it = effects.Echoes(
        stamp=stamp,
        bearings=np.linspace(-1.5, 1.5, n),
        ranges=np.asarray(ranges, dtype=float),
        incidence=np.zeros(n),
        returns=np.ones(n),
        mean=1.004587 * np.asarray(ranges) + 0.058826,
        sd=np.full(n, 0.002),
        noise=np.random.default_rng(seed).standard_normal(n),
        readings=np.asarray(ranges, dtype=float),
    )
    return replace(it, **more)


def chain(name, seed=1, **values):
    setting = EffectSetting(name, {**NULLS[name], **values})
    return effects.build_laser((setting,), np.random.default_rng(seed))


def read(name, it=None, **values):
    return chain(name, **values).read(echoes() if it is None else it)


def silent(**more):
    return echoes(sd=np.zeros(N), **more)


def bias(name, it, **values):
    """What an effect adds to readings without noise, of the beams that met something."""
    return read(name, it, **values)[HIT] - it.mean[HIT]


def test_biases_at_chosen_values():
    r, a = RANGES[HIT], INCIDENCE[HIT]
    footprint = 1 / np.cos(np.minimum(a, np.deg2rad(80))) - 1
    returns = np.array([1.0, 0.5, 0.0, 2.0, 1.0, 1.0, 1.0])
    phi = BEARINGS[HIT]
    expected = [
        (bias("laser.offset", silent(), offset=0.01), 0.01),
        (bias("laser.scale", silent(), scale=0.01), 0.01 * r),
        (bias("laser.quadratic", silent(), quadratic=0.002), 0.002 * r**2),
        (bias("laser.warmup", silent(stamp=600.0), amplitude=0.01, tau=600.0), 0.01 / np.e),
        (bias("laser.warmup", silent(stamp=600.0), amplitude=0.01, tau=600.0, cold=1.0), 0.01 / np.e - 0.01),
        (bias("laser.temperature", silent(stamp=150.0), coefficient=5e-4, swing=8.0, period=600.0), 0.004),
        (bias("laser.temperature", silent(stamp=450.0), coefficient=5e-4, swing=8.0, period=600.0), -0.004),
        (bias("laser.cyclic", silent(), amplitude=0.003, wavelength=2.0), 0.003 * np.array([1, 0, -1, 0, 0, 0])),
        (bias("laser.cyclic", silent(), amplitude=0.003, wavelength=2.0, phase=np.pi), [-0.003, 0, 0.003, 0, 0, 0]),
        (bias("laser.incidence_bias", silent(incidence=INCIDENCE), k=0.003), 0.003 * footprint),
        (
            bias("laser.incidence_bias", silent(incidence=INCIDENCE), k=0.003, tangent=1.0),
            0.003 * np.tan(np.minimum(INCIDENCE[HIT], np.deg2rad(80))),
        ),
        (bias("laser.reflectance", silent(returns=returns), bias=0.02), [0.0, 0.01, 0.02, -0.02, 0.0, 0.0]),
        (bias("laser.beam_bias", silent(), amplitude=0.003, phase=0.5), 0.003 * np.cos(phi - 0.5)),
    ]
    assert footprint[2] == pytest.approx(1.0)  # at 60 degrees
    for added, formula in expected:
        np.testing.assert_allclose(added, np.broadcast_to(formula, added.shape), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "values", "more", "sd"),
    [
        ("laser.range_noise", {"share": 0.5}, {}, 0.003),
        ("laser.range_noise", {"share": -1.0, "slope": 0.001}, {}, 0.001 * np.maximum(RANGES[HIT] - 2, 0)),
        ("laser.range_noise", {"share": -1.0, "slope": -0.001}, {}, 0.001 * np.maximum(2 - RANGES[HIT], 0)),
        ("laser.incidence_noise", {"gain": 0.5}, {"incidence": np.full(N, np.pi / 3)}, 0.003),
        ("laser.reflectance", {"noise": 1.0}, {"returns": np.full(N, 0.5)}, 0.003),
        ("laser.reflectance", {"noise": 1.0}, {"returns": np.full(N, 3.0)}, 0.0),
    ],
)
def test_spreads_at_chosen_values(name, values, more, sd):
    it = echoes(noise=np.ones(N), **more)
    np.testing.assert_allclose(bias(name, it, **values), np.broadcast_to(sd, HIT.sum()), atol=1e-12)


@pytest.mark.parametrize("effect", READING, ids=lambda effect: effect.id)
@given(seed=st.integers(0, 1000), stamp=st.floats(0, 1e4))
@settings(max_examples=20)
def test_null_is_absent(effect, seed, stamp):
    rng = np.random.default_rng(seed)
    ranges = np.where(rng.random(50) < 0.2, np.inf, rng.uniform(0, 6, 50))
    it = echoes(ranges, stamp, seed, incidence=rng.uniform(0, 1.5, 50), returns=rng.uniform(0, 2, 50))
    plain = effects.LaserChain(()).read(it)
    np.testing.assert_array_equal(read(effect.id, it), plain)
    np.testing.assert_array_equal(np.isinf(plain), np.isinf(ranges))


@pytest.mark.parametrize("effect", READING, ids=lambda effect: effect.id)
def test_typical_is_seen_again_with_the_same_seed_and_leaves_what_it_got(effect):
    ranges = np.tile([1.0, 1.0, 3.5, 3.5, np.inf], 40)
    typical = {p.name: p.null + p.scale for p in effect.parameters}
    scans = [echoes(ranges, 0.1 * k, k, incidence=np.full(200, 1.0), returns=np.full(200, 0.5)) for k in range(3)]
    before = [[np.array(getattr(it, field.name)) for field in fields(it)] for it in scans]
    first, again = (chain(effect.id, **typical) for _ in range(2))
    readings = [first.read(it) for it in scans]
    np.testing.assert_array_equal([again.read(it) for it in scans], readings)
    plain = [effects.LaserChain(()).read(it) for it in scans]
    assert not np.array_equal(readings, plain, equal_nan=True)
    for it, values in zip(scans, before, strict=True):
        for field, value in zip(fields(it), values, strict=True):
            np.testing.assert_array_equal(getattr(it, field.name), value)


def normal(values, sd):
    assert stats.kstest(values / sd, "norm").pvalue > ALPHA


def pack(**more):
    return echoes(np.full(PACK, 2.0), **more)


def test_each_beam_has_a_bias_that_stays():
    unit = chain("laser.beam_bias", sd=0.001)
    it = pack(sd=np.zeros(PACK))
    first, second = (unit.read(it) - it.mean for _ in range(2))
    np.testing.assert_array_equal(first, second)
    normal(first, 0.001)


def test_common_mode_is_an_autoregression_of_the_scans():
    unit = chain("laser.common_mode", sd=0.001, rho=0.7)
    it = silent()
    scans = np.array([unit.read(it)[HIT] - it.mean[HIT] for _ in range(6000)])
    assert np.ptp(scans, axis=1).max() < 1e-12  # all beams alike
    s = scans[:, 0]
    normal((s[1:] - 0.7 * s[:-1]) / np.sqrt(1 - 0.7**2), 0.001)
    starts = [bias("laser.common_mode", it, seed=seed, sd=0.001, rho=0.99)[0] for seed in range(400)]
    normal(np.array(starts), 0.001)  # stationary from the first


def test_neighbours_err_together():
    it = pack()
    errors = (read("laser.beam_correlation", it, rho=0.55) - it.mean) / 0.002
    innovations = (errors[1:] - 0.55 * errors[:-1]) / np.sqrt(1 - 0.55**2)
    normal(innovations, 1.0)
    for lag, rho in ((1, 0.55), (2, 0.3025), (5, 0.0503)):
        assert np.corrcoef(errors[:-lag], errors[lag:])[0, 1] == pytest.approx(rho, abs=5 / np.sqrt(PACK))


def test_tails_are_those_of_student():
    it = pack()
    errors = (read("laser.heavy_tails", it, inverse_nu=0.25) - it.mean) / 0.002
    assert stats.kstest(errors / np.sqrt(0.5), "t", args=(4,)).pvalue > ALPHA  # sd of t_4 is sqrt(2)
    assert stats.kstest(errors, "norm").pvalue < ALPHA


def test_neighbours_on_one_oblique_wall_are_not_mixed():
    """Beams 2.9 degrees apart on a wall a metre away: the farthest neighbours are half a metre apart in range."""
    bearings = np.linspace(-1.3, 1.3, 53)
    wall = echoes(1 / np.cos(bearings), bearings=bearings, incidence=np.abs(bearings))
    assert np.abs(np.diff(wall.ranges)).max() > 0.5
    np.testing.assert_array_equal(
        read("laser.mixed_pixels", wall, probability=1.0), read("laser.mixed_pixels", wall, probability=0.0)
    )
    box = replace(wall, ranges=np.where(np.abs(bearings) < 0.2, 0.5, wall.ranges), incidence=0 * bearings)
    mixed = read("laser.mixed_pixels", box, probability=1.0) != read("laser.mixed_pixels", box, probability=0.0)
    assert set(np.flatnonzero(np.abs(np.diff(box.ranges)) > 0.3)) <= set(np.flatnonzero(mixed))


@pytest.mark.parametrize("effect", READING, ids=lambda effect: effect.id)
def test_many_scans_at_once_are_read_as_one_by_one(effect):
    first = effect.parameters[0]
    values = {first.name: first.null + first.scale}
    rng = np.random.default_rng(4)
    scans = [
        echoes(rng.uniform(0.5, 3.5, N), 5.0 * i, i, incidence=INCIDENCE, returns=rng.uniform(0.2, 1.0, N))
        for i in range(6)
    ]
    together = {
        one.name: np.stack([getattr(scan, one.name) for scan in scans])
        for one in fields(scans[0])
        if one.name not in ("stamp", "bearings", "origins", "known")
    }
    every = replace(scans[0], stamp=np.array([[scan.stamp] for scan in scans]), **together)
    alone = chain(effect.id, **values)
    np.testing.assert_array_equal(chain(effect.id, **values).read(every), [alone.read(scan) for scan in scans])


def test_mixed_pixels_lie_between_both_sides_of_a_jump():
    ranges = np.tile([1.0] * 5 + [3.0] * 5 + [np.inf] * 2, 1000)
    it = echoes(ranges, sd=np.zeros(len(ranges)), mean=ranges)
    readings = read("laser.mixed_pixels", it, probability=0.4, jump=0.5).reshape(1000, 12)
    rest = [0, 1, 2, 3, 6, 7, 8, 9, 10, 11]
    np.testing.assert_array_equal(readings[:, rest], ranges.reshape(1000, 12)[:, rest])
    for side, away in ((readings[:, 4], readings[:, 4] - 1), (readings[:, 5], 3 - readings[:, 5])):
        mixed = away != 0
        assert stats.binomtest(int(mixed.sum()), 1000, 0.4).pvalue > ALPHA
        assert stats.kstest(away[mixed] / 2, "uniform").pvalue > ALPHA
        assert ((side >= 1) & (side <= 3)).all()
    np.testing.assert_array_equal(read("laser.mixed_pixels", it, probability=1.0, jump=2.5), ranges)


@pytest.mark.parametrize(
    ("values", "chance"),
    [
        ({"probability": 0.1}, 0.1),
        ({"per_metre": 0.1}, 0.2),
        ({"oblique": 0.5}, 0.25),
        ({"dark": 0.4}, 0.3),
        ({"probability": 0.1, "dark": 0.4}, 0.4),
        ({"probability": 1.0, "dark": 0.4}, 1.0),
    ],
)
def test_dropouts_are_as_frequent_as_asked(values, chance):
    it = pack(incidence=np.full(PACK, np.pi / 3), returns=np.full(PACK, 0.25))
    lost = np.isnan(read("laser.dropout", it, **values))
    assert stats.binomtest(int(lost.sum()), PACK, chance).pvalue > ALPHA
    assert np.isinf(read("laser.dropout", probability=1.0)[~HIT]).all()  # nothing there to lose


def test_saturation_and_steps():
    it = silent(mean=RANGES)
    np.testing.assert_allclose(read("laser.saturation", it, near=0.8), [0.8, 1, 1.5, 2, 3, 4, np.inf])
    np.testing.assert_allclose(read("laser.saturation", it, inverse_far=0.4), [0.5, 1, 1.5, 2, 2.5, 2.5, np.inf])
    np.testing.assert_allclose(read("laser.quantisation", it, step=0.4), [0.4, 0.8, 1.6, 2, 3.2, 4, np.inf])


def test_crosstalk_comes_in_a_sector_that_drifts_round():
    it = echoes(np.full(PACK, 2.0), stamp=1000.0, sd=np.zeros(PACK))
    readings = read("laser.crosstalk", it, probability=0.3, width=0.5, drift=2 * np.pi / 1000 * 1.1, reach=5.0)
    wrong = readings != it.mean
    sector = np.abs(it.bearings - 0.2 * np.pi) < 0.25  # 1.1 turns in 1000 s
    assert not wrong[~sector].any()
    assert stats.binomtest(int(wrong.sum()), int(sector.sum()), 0.3).pvalue > ALPHA
    assert stats.kstest(readings[wrong] / 5.0, "uniform").pvalue > ALPHA


def test_noise_of_one_effect_does_not_depend_on_which_others_there_are():
    offset = EffectSetting("laser.offset", {"offset": 0.1})
    both = [EffectSetting("laser.common_mode", {"sd": 0.001, "rho": 0.5}), offset]
    alone, beside = (effects.build_laser(tuple(some), np.random.default_rng(3)) for some in (both[:1], both[::-1]))
    np.testing.assert_allclose(beside.read(echoes())[HIT], alone.read(echoes())[HIT] + 0.1)


def test_every_effect_on_the_laser_that_is_asked_for_exists():
    ids = """offset scale quadratic warmup temperature cyclic incidence_bias incidence_noise reflectance mixed_pixels
        beam_bias common_mode beam_correlation heavy_tails dropout quantisation range_noise mount_x mount_y mount_yaw
        tilt latency clock_skew sweep crosstalk saturation"""
    assert sorted(effect.id for effect in effects.LASER) == sorted(f"laser.{name}" for name in ids.split())
    assert [effect.id for effect in effects.WORLD] == ["world.map_error"]

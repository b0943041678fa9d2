# SPDX-License-Identifier: BSD-3-Clause
"""Every effect on the base against a second implementation, oracle_base.py, for drawn parameters and drives."""

import cmath
import math

import numpy as np
import oracle_base
import pytest
from scipy import stats

from kurumaisu import effects
from kurumaisu.params import load_model, shipped

DT = 0.02
STEPS = 160
MODEL = load_model(shipped("launch/md100.yaml"))
DRAWS = range(5)  # the last two of parameters anywhere within their bounds
TESTED = [*oracle_base.RATES, *oracle_base.VOLTS, "base.process_noise"]
TESTED += ["base.marker_x", "base.marker_y", "base.marker_yaw", "base.clock_scale"]


def make(name, values, seed=0):
    context = effects.Context(MODEL.translation, MODEL.steering, np.random.default_rng(seed))
    return effects.by_id(name)(values, context)


def drawn(name, rng, anywhere=False):
    """Parameters up to three times the typical size from where they do nothing, or anywhere within their bounds."""

    def draw(p):
        if anywhere:
            return float(rng.uniform(p.lower, p.upper))
        return float(np.clip(p.null + p.scale * rng.uniform(-3, 3), p.lower, p.upper))

    return {p.name: draw(p) for p in effects.by_id(name).parameters}


def drive(rng):
    """Like a joystick's: both signs, standing, one axis alone, steps of any length, none on the grid of anything."""
    v, w = [], []
    while len(v) < STEPS:
        rates = rng.uniform(-1.2, 1.2, 2) * (rng.random(2) > 0.3)
        count = int(rng.integers(1, 30))
        v += [float(rates[0])] * count
        w += [float(rates[1])] * count
    return oracle_base.Drive(DT, v[:STEPS], w[:STEPS], float(rng.uniform(-3, 3)))


@pytest.mark.parametrize("name", oracle_base.RATES)
def test_rates(name):
    for seed in DRAWS:
        rng = np.random.default_rng([seed, 1])
        values, run = drawn(name, rng, seed > 2), drive(rng)
        motion = effects.Motion(DT, np.array(run.v), np.array(run.w), heading=run.heading)
        out = make(name, values).apply(motion)
        u = np.zeros(STEPS) if out.u is None else out.u
        expected = np.array(oracle_base.RATES[name](values, run), dtype=float)
        exact = name != "base.accel_limit"  # which the oracle does in a thousand parts
        np.testing.assert_allclose(
            np.array([out.v, u, out.w]), expected, atol=1e-8 if exact else 1e-5, err_msg=str(values)
        )


@pytest.mark.parametrize("name", oracle_base.RATES)
def test_the_oracle_is_no_identity(name):
    """Else the comparison above could not fail."""
    most = 0.0
    for seed in DRAWS:
        rng = np.random.default_rng([seed, 1])
        values, run = drawn(name, rng), drive(rng)
        v, u, w = np.array(oracle_base.RATES[name](values, run), dtype=float)
        most = max(most, np.abs([v - run.v, u, w - run.w]).max())
    assert most > 1e-3


@pytest.mark.parametrize("name", oracle_base.VOLTS)
def test_volts(name):
    for seed in DRAWS:
        rng = np.random.default_rng([seed, 2])
        values, run = drawn(name, rng, seed > 2), drive(rng)
        if name == "base.steering_law":
            values = {"flip": float(rng.choice([0.0, 0.3, 1.0])), "meant": float(rng.integers(2))}
        v_f = [oracle_base.volts("translation", v) for v in run.v]
        v_s = [oracle_base.volts("steering", w) for w in run.w]
        signs = [float(np.sign(w)) for w in run.w]
        arrays = effects.Volts(*map(np.array, (v_f, v_s, np.sign(run.v), signs)))
        out = make(name, values).apply(arrays)
        expected = oracle_base.VOLTS[name](values, v_f, v_s, signs)
        np.testing.assert_allclose(np.array([out.v_f, out.v_s]), np.array([*expected]), atol=1e-12, err_msg=str(values))


def circle(t, v=0.5, w=0.4, start=(1.0, 2.0, 0.3)):
    """Where base_link is, on the arc."""
    x, y, heading = start
    turned = heading + w * t
    return (
        x + v / w * (math.sin(turned) - math.sin(heading)),
        y - v / w * (math.cos(turned) - math.cos(heading)),
        turned,
    )


@pytest.mark.parametrize(
    ("name", "key", "at"), [("base.marker_x", "x", (0.2, 0.0)), ("base.marker_y", "y", (0.0, -0.3))]
)
def test_a_marker_goes_its_own_way(name, key, at):
    """The way of a point fixed to the chair, and its velocity by differences."""

    def marker(t):
        x, y, heading = circle(t)
        ahead, left = at
        return (
            x + ahead * math.cos(heading) - left * math.sin(heading),
            y + ahead * math.sin(heading) + left * math.cos(heading),
        )

    t, h = 1.3, 1e-5
    x, y, heading = circle(t)
    truth = effects.Reference(np.array(t), np.array([x, y, heading]), np.array([0.5, 0.0, 0.4]))
    seen = make(name, {key: sum(at)}).apply(truth)
    np.testing.assert_allclose(seen.poses, [*marker(t), heading], atol=1e-12)
    (x0, y0), (x1, y1) = marker(t - h), marker(t + h)
    east, north = (x1 - x0) / (2 * h), (y1 - y0) / (2 * h)
    forward = east * math.cos(heading) + north * math.sin(heading)
    leftward = north * math.cos(heading) - east * math.sin(heading)
    np.testing.assert_allclose(seen.rates, [forward, leftward, 0.4], atol=1e-8)
    assert float(seen.times) == t


@pytest.mark.parametrize("yaw", [0.4, -0.03, -1.0])
def test_a_turned_marker_goes_the_same_way_askew(yaw):
    """Its position is base_link's; its rates are what two of its poses, close together, say in its own frame."""
    t, h = 1.3, 1e-5
    times = np.array([t - h, t, t + h])
    truth = effects.Reference(times, np.array([circle(each) for each in times]), np.tile([0.5, 0.0, 0.4], (3, 1)))
    seen = make("base.marker_yaw", {"yaw": yaw}).apply(truth)
    np.testing.assert_allclose(seen.poses, [[*circle(each)[:2], circle(each)[2] + yaw] for each in times], atol=1e-12)
    (before, here, after) = seen.poses
    velocity = complex(*(after - before)[:2]) / (2 * h) / cmath.exp(1j * here[2])
    turning = (after - before)[2] / (2 * h)
    np.testing.assert_allclose(seen.rates[1], [velocity.real, velocity.imag, turning], atol=1e-8)
    np.testing.assert_array_equal(seen.times, times)


def test_a_turned_marker_sees_what_slips_sideways():
    """A chair that slides to its left goes straight ahead for a marker that looks to the left by as much."""
    truth = effects.Reference(np.zeros(1), np.zeros((1, 3)), np.array([[0.3, 0.4, 0.1]]))
    seen = make("base.marker_yaw", {"yaw": math.atan2(0.4, 0.3)}).apply(truth)
    np.testing.assert_allclose(seen.rates, [[0.5, 0.0, 0.1]], atol=1e-12)


def test_a_fast_clock_sees_slow_rates():
    """The same poses, at other times: rates are what somebody with that clock makes of two of them."""
    scale, times = 0.05, np.array([2.0, 2.5])
    poses = np.array([circle(t) for t in times])
    seen = make("base.clock_scale", {"scale": scale, "through": 0.0}).apply(
        effects.Reference(times, poses, np.tile([0.5, 0.0, 0.4], (2, 1)))
    )
    np.testing.assert_array_equal(seen.poses, poses)
    np.testing.assert_allclose(seen.times, [2.1, 2.625])
    turned = (seen.poses[1, 2] - seen.poses[0, 2]) / (seen.times[1] - seen.times[0])
    np.testing.assert_allclose(seen.rates[:, 2], turned, atol=1e-12)
    np.testing.assert_allclose(seen.rates[:, 0], 0.5 * turned / 0.4, atol=1e-12)


def test_noise_of_the_rates_is_ornstein_uhlenbeck_while_moving():
    """Of 400 drives the same moment: independent draws, so errors are those of textbooks; seed 11."""
    count, steps, tau = 400, 200, 0.25
    values = {"sd_v": 0.03, "sd_w": 0.07, "tau": tau, "growth": 0.0}
    v, w = np.full(steps, 0.5), np.full(steps, -0.3)
    v[120:130] = w[120:130] = 0.0
    motion = effects.Motion(DT, v, w)
    runs = [make("base.process_noise", values, 1000 + i).apply(motion) for i in range(count)]
    n_v, n_w = np.array([run.v - v for run in runs]), np.array([run.w - w for run in runs])
    assert (n_v[:, 120:130] == 0).all()
    assert (n_w[:, 120:130] == 0).all()
    for noise, sd in ((n_v, 0.03), (n_w, 0.07)):
        late, later = noise[:, 150], noise[:, 150 + round(tau / DT)]
        assert stats.kstest(late / sd, "norm").pvalue > 1e-3
        expected = math.exp(-round(tau / DT) * DT / tau)
        spread = (1 - expected**2) / math.sqrt(count)
        assert np.corrcoef(late, later)[0, 1] == pytest.approx(expected, abs=4 * spread)
        grown = np.array([noise[:, k].var() for k in (0, 5, 20)]) / sd**2  # from rest: 1 - exp(-2 t / tau)
        ends = 1 - np.exp(-2 * DT * np.array([1, 6, 21]) / tau)
        np.testing.assert_allclose(grown, ends, atol=0, rtol=4 * math.sqrt(2 / count))
    assert abs(np.corrcoef(n_v[:, 150], n_w[:, 150])[0, 1]) < 4 / math.sqrt(count)


def test_noise_that_grows_is_the_same_noise_louder():
    """At 0.5 m/s and -0.3 rad/s by 1 + growth, at 0.1 m/s by an eighth of it."""
    v, w = np.repeat([0.5, 0.1], 50), np.repeat([-0.3, 0.0], 50)
    steady, grown = (
        make("base.process_noise", {"sd_v": 0.03, "sd_w": 0.07, "tau": 0.25, "growth": growth}, 3).apply(
            effects.Motion(DT, v, w)
        )
        for growth in (0.0, 0.6)
    )
    louder = np.repeat([1.6, 1.075], 50)
    np.testing.assert_allclose(grown.v - v, louder * (steady.v - v), atol=1e-15)
    np.testing.assert_allclose(grown.w - w, louder * (steady.w - w), atol=1e-15)

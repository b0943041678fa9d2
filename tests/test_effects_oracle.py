# SPDX-License-Identifier: BSD-3-Clause
"""No effect without an oracle; and one for the curves that the critic puts in where nothing of the catalogue acts."""

import math
from bisect import bisect_right

import numpy as np
import pytest
import test_effects_oracle_base
import test_effects_oracle_laser
import test_effects_oracle_rays

from kurumaisu import effects
from kurumaisu.params import load_model, shipped

DT = 0.02
MODEL = load_model(shipped("launch/md100.yaml"))
TRACK = 0.55  # [m]
CURVE = {"knot_0": -0.35, "knot_1": 0.05, "knot_2": 0.4, "value_0": 0.08, "value_1": -0.03, "value_2": 0.05}
WAVE = {"period": 0.9, "level": 0.01, "cos_1": 0.03, "cos_2": -0.02, "sin_1": 0.04, "sin_2": 0.015}


def test_every_effect_of_the_catalogue_has_an_oracle():
    parts = test_effects_oracle_base, test_effects_oracle_laser, test_effects_oracle_rays
    tested = [name for part in parts for name in part.TESTED]
    assert sorted(tested) == sorted(effect.id for effect in effects.ALL)


def line(x):
    """The curve between knots by the rule of three."""
    knots, values = [-0.35, 0.05, 0.4], [0.08, -0.03, 0.05]
    after = bisect_right(knots, x)
    if after in (0, 3):
        return values[0 if after == 0 else -1]
    share = (x - knots[after - 1]) / (knots[after] - knots[after - 1])
    return values[after - 1] * (1 - share) + values[after] * share


def wave(x):
    """Fourier's terms as real parts of turning pointers."""
    turn = 2 * math.pi * x / 0.9
    pointers = (0.03 - 0.04j) * complex(math.cos(turn), math.sin(turn))
    return 0.01 + (pointers + (-0.02 - 0.015j) * complex(math.cos(2 * turn), math.sin(2 * turn))).real


def watched(v, w, u, heading):
    """Each covariate in each step, by somebody who watches the drive."""
    rows, x, y, t = [], 0.0, 0.0, 0.0
    since_command, since_reversal, way, asked, distance = math.inf, math.inf, 0, (0.0, 0.0), 0.0
    since_rest = math.inf
    behind = [0.0, 0.0]  # the rates of a chair with a lag of 0.2 s
    for speed, turn, aside in zip(v, w, u, strict=True):
        if (speed, turn) != asked:
            asked, since_command = (speed, turn), 0.0
        rests = speed == turn == 0
        since_rest = 0.0 if rests else since_rest
        direction = (speed > 0) - (speed < 0)
        if direction and direction != way:
            since_reversal, way = (0.0 if way else since_reversal), direction
        late = [rate + (old - rate) * math.exp(-DT / 0.2) for rate, old in zip((speed, turn), behind, strict=True)]
        changes, behind = [(new - old) / DT for new, old in zip(late, behind, strict=True)], late
        middle = heading + turn * DT / 2
        east = speed * math.cos(middle) - aside * math.sin(middle)
        north = speed * math.sin(middle) + aside * math.cos(middle)
        rows.append(
            {
                "v": speed,
                "abs_v": abs(speed),
                "w": turn,
                "abs_w": abs(turn),
                "v_times_w": speed * turn,
                "acceleration": changes[0],
                "yaw_acceleration": changes[1],
                "wheel_left": speed - turn * TRACK / 2,
                "wheel_right": speed + turn * TRACK / 2,
                "time": t + DT / 2,
                "since_command": since_command + DT / 2,
                "since_rest": 0.0 if rests else since_rest + DT / 2,
                "since_reversal": since_reversal + abs(speed) * DT / 2,
                "heading": middle,
                "distance": distance + abs(speed) * DT / 2,
                "x": x + east * DT / 2,
                "y": y + north * DT / 2,
                "moving": 1.0,
                "rust": 0.5,
            }
        )
        x, y, t, heading = x + east * DT, y + north * DT, t + DT, heading + turn * DT
        since_command += DT
        since_rest += 0.0 if rests else DT
        since_reversal += abs(speed) * DT
        distance += abs(speed) * DT
    return rows


def drive(seed):
    rng = np.random.default_rng(seed)
    v, w = np.repeat(rng.uniform(-0.7, 0.7, (2, 14)) * (rng.random((2, 14)) > 0.3), 9, axis=1)
    return v, w, np.repeat(rng.uniform(-0.1, 0.1, 14), 9)


COVARIATES = [*effects.COVARIATES, "rust"]


@pytest.mark.parametrize("covariate", COVARIATES)
@pytest.mark.parametrize("channel", effects.CHANNELS)
def test_curves(channel, covariate):
    values = dict(WAVE if covariate in effects.PERIODIC else CURVE)
    constant = effects.constant_of(covariate)
    if covariate not in effects.PERIODIC and constant:
        values[constant] = TRACK if constant == "track" else 0.5
    name = effects.smooth_id(channel, covariate)
    for seed in range(2):
        v, w, u = drive(seed)
        effect = effects.by_id(name)(values, effects.Context(MODEL.translation, MODEL.steering, None))
        out = effect.apply(effects.Motion(DT, v, w, u, heading=0.7))
        shape = wave if covariate in effects.PERIODIC else line
        rows = watched(v.tolist(), w.tolist(), u.tolist(), 0.7)
        added = np.array([shape(row[covariate]) for row in rows]) * ((v != 0) | (w != 0))
        expected = {"v": v, "w": w, "lateral": u}
        if channel in expected:
            expected[channel] = expected[channel] + added
        elif channel == "speed":
            expected["v"] = expected["v"] + added * np.sign(expected["v"])
        elif channel == "curvature":
            expected["w"] = expected["w"] + added * expected["v"]
        else:  # v_gain, w_gain: a share of the rate
            rate = channel.removesuffix("_gain")
            expected[rate] = expected[rate] + added * expected[rate]
        np.testing.assert_allclose(out.v, expected["v"], atol=1e-12)
        np.testing.assert_allclose(out.w, expected["w"], atol=1e-12)
        np.testing.assert_allclose(out.u, expected["lateral"], atol=1e-12)
        assert np.abs(added).max() > 0.01


@pytest.mark.parametrize("covariate", ["v_f", "v_s"])
def test_curves_over_voltages(covariate):
    """The voltage is known to who simulates."""
    v, w, _ = drive(3)
    given = np.random.default_rng(4).uniform(-0.7, 0.7, len(v))
    effect = effects.by_id(f"smooth.v.{covariate}")(WAVE, effects.Context(MODEL.translation, MODEL.steering, None))
    out = effect.apply(effects.Motion(DT, v, w, known={covariate: given}))
    expected = v + np.array([wave(x) for x in given.tolist()]) * ((v != 0) | (w != 0))
    np.testing.assert_allclose(out.v, expected, atol=1e-12)

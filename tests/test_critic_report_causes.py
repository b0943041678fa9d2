# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of causes: drawn in the channel in which they show, over what they follow, before and after."""

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import misfit
from kurumaisu.critic.judge.misfit import overlays
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.noise.base_noise import START
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import EffectSetting, driven_as, load_model, shipped, shipped_robot

MODEL = load_model(shipped("launch/md100.yaml"))
COMMANDED = driven_as(MODEL, shipped_robot("velocity"))


def driven(slip, gain, seconds=60.0, seed=4):
    """Return a drive whose chair drifts by -slip v w and drives (1 + gain) v, integrated here; rates and poses."""
    rng = np.random.default_rng(seed)
    count = round(seconds / GRID)
    v = np.repeat(rng.uniform(-0.6, 0.8, count // 200), 200)
    w = np.repeat(rng.uniform(-0.8, 0.8, count // 200), 200)
    theta = np.concatenate([[0.0], np.cumsum(w) * GRID])
    middle = theta[:-1] + w * GRID / 2
    forward, sideways = (1 + gain) * v, -slip * v * w
    x = np.concatenate([[0.0], np.cumsum(forward * np.cos(middle) - sideways * np.sin(middle)) * GRID])
    y = np.concatenate([[0.0], np.cumsum(forward * np.sin(middle) + sideways * np.cos(middle)) * GRID])
    noise = rng.normal(0.0, [0.002, 0.002, 0.001], (count + 1, 3))
    poses = np.column_stack([x, y, theta]) + noise
    return v, w, poses[::10], GRID * np.arange(0, count + 1, 10)


def picture_of(name, parameters, **hidden):
    v, w, poses, times = driven(**{"slip": 0.0, "gain": 0.0, **hidden})
    problem = Problem([Drive("a", "command", 0.0, v, w, times, poses)], COMMANDED, START)
    (figure,) = misfit.figures(problem, [EffectSetting(name, parameters)], [name])
    return figure


def test_a_sideways_effect_is_drawn_sideways_over_the_product_of_the_rates():
    figure = picture_of("base.lateral_slip", {"c": 0.1}, slip=0.1)
    assert figure.channel == "sideways speed"
    assert "product" in figure.covariate_name
    ends = [0, -1]
    np.testing.assert_allclose(figure.bins.mean[ends], -0.1 * figure.bins.centre[ends], atol=0.01)
    assert np.abs(figure.after.mean).max() < 0.35 * np.abs(figure.bins.mean).max()


def test_a_gain_is_drawn_forward_over_the_speed_asked_for():
    figure = picture_of("base.gain_v", {"gain": 0.1}, gain=0.1)
    assert (figure.channel, figure.covariate_name) == ("forward speed", "commanded forward speed")
    np.testing.assert_allclose(figure.bins.mean, 0.1 * figure.bins.centre, atol=0.01)
    assert np.abs(figure.after.mean).max() < 0.015


def test_an_effect_that_is_not_there_leaves_its_mark_after_rather_than_before():
    figure = picture_of("base.gain_v", {"gain": 0.1})
    assert np.abs(figure.bins.mean).max() < 0.015
    np.testing.assert_allclose(figure.after.mean, -0.1 * figure.after.centre, atol=0.01)


@pytest.mark.parametrize("gain", [0.1, 0.0])
def test_a_path_begins_again_at_the_measured_pose(gain):
    v, w, poses, times = driven(0.0, gain)
    rates = GRID * np.arange(len(v))
    command = Series(rates, np.column_stack([v, w]), ("v", "w"))
    run = Run("a", command=command, pose=Series(times, poses, ("x", "y", "theta")))
    (drawn,) = overlays(Recording("r", (run,), ("a",)), COMMANDED, [EffectSetting("base.gain_v", {"gain": gain})])
    starts = np.flatnonzero(np.isnan(drawn.baseline[:, 0])) + 1
    assert len(starts) == 5
    for start, at in zip(starts, (10, 20, 30, 40, 50), strict=True):
        np.testing.assert_allclose(drawn.baseline[start], poses[np.searchsorted(times, at - 1e-6), :2])
    assert drawn.off_extended < 0.05
    assert (drawn.off > 0.1) == (gain > 0)


@pytest.mark.parametrize(("effect", "size"), [("laser.scale", 0.006), (None, 0.0)])
def test_readings_are_drawn_over_the_range_that_a_wrong_scale_follows(tmp_path, effect, size):
    told = recording(tmp_path, effect, size, 5, scans=30)
    finding = criticise_scans(told, MODEL, lambda _: None, frozenset({"laser.scale", "laser.incidence_bias"}))
    assert [each.explained_by for each in finding.pictures.misfits] == ([effect] if effect else [])
    assert [row.name for row in finding.pictures.noise]
    for figure in finding.pictures.misfits:
        assert (figure.channel, figure.covariate_name) == ("range", "range")
        slope = np.polyfit(figure.bins.centre, figure.bins.mean, 1)[0]
        assert slope == pytest.approx(size, rel=0.15)
        assert np.abs(figure.after.mean).max() < 0.002


def test_scatter_is_compared_before_and_after(tmp_path):
    told = recording(tmp_path, "laser.range_noise", 0.5, 6, scans=30)
    finding = criticise_scans(told, MODEL, lambda _: None, frozenset({"laser.range_noise"}))
    (comparison,) = finding.pictures.comparisons
    assert len(comparison.names) == len(comparison.measured)
    before = np.abs(comparison.measured - comparison.baseline) / comparison.sd
    after = np.abs(comparison.measured - comparison.extended) / comparison.sd
    spread = [name.startswith("spread, ") for name in comparison.names]
    assert before[spread].min() > 3
    assert np.median(after[spread]) < 3

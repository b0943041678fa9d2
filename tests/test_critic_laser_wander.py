# SPDX-License-Identifier: BSD-3-Clause
"""A reference that wanders errs alike for seconds: so many scans are not so many independent witnesses."""

from dataclasses import replace

import laser_scene
import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SDS = np.array([0.006, 0.006, 0.004])


def wandering(data, share, tau, seed):
    """Return a recording whose reference errs by SDS, a share of the variance of which lasts for tau [s]."""
    rng = np.random.default_rng(seed)
    run = data.runs[0]
    steps = len(run.pose.t)
    rho = np.exp(-float(np.median(np.diff(run.pose.t))) / tau)
    slow = rng.standard_normal((steps, 3))
    for i in range(1, steps):
        slow[i] = rho * slow[i - 1] + np.sqrt(1 - rho**2) * slow[i]
    values = run.pose.values.copy()
    values[:, :3] += SDS * (np.sqrt(share) * slow + np.sqrt(1 - share) * rng.standard_normal((steps, 3)))
    return replace(data, runs=(replace(run, pose=replace(run.pose, values=values)),), truth=(SDS[0], SDS[2]))


@pytest.mark.parametrize(("share", "low", "high"), [(0.0, 0.0, 0.1), (0.6, 0.12, 0.95)])
def test_how_much_of_the_references_errors_lasts_is_seen(tmp_path, share, low, high):
    data = wandering(sparse(recording(tmp_path, None, 0.0, 13, scans=150)), share, 4.0, 13)
    noise = Assembly(gather(data, MODEL)).settle(data.truth).scan_noise
    assert low <= noise.lasting**2 / (1 + noise.lasting**2) <= high


@pytest.mark.parametrize("seed", [11, 14])
def test_a_reference_that_wanders_is_no_mounting(tmp_path, seed):
    data = wandering(sparse(recording(tmp_path, None, 0.0, seed, scans=150)), 0.6, 4.0, seed)
    finding = criticise_scans(data, MODEL, lambda _: None)
    assert (finding.causes, finding.confounded, finding.unknown) == ((), (), ())


def with_walls_off(folder, effect, size, monkeypatch):
    """Return a recording in a room whose walls are 1 cm off in its map."""
    drawn, rng = laser_scene.BOXES, np.random.default_rng(5)
    there = tuple((name, *(np.array([x, y]) + 0.01 * rng.standard_normal(2)), *more) for name, x, y, *more in drawn)
    monkeypatch.setattr(laser_scene, "BOXES", there)
    data = recording(folder, effect, size, 5, scans=100)
    monkeypatch.setattr(laser_scene, "BOXES", drawn)
    laser_scene.write_world(data.world)
    return data


def test_walls_that_are_off_are_neither_a_common_mode_nor_the_references_errors(tmp_path, monkeypatch):
    data = with_walls_off(tmp_path, None, 0.0, monkeypatch)
    finding = criticise_scans(data, MODEL, lambda _: None, frozenset({"world.map_error", "laser.common_mode"}))
    assert [cause.id for cause in finding.causes] == ["world.map_error"]
    (common,) = (one for one in finding.pictures.noise if one.name == "laser: error common to a whole scan")
    assert common.estimate < 0.002


def test_walls_that_are_off_hide_nothing_smaller(tmp_path, monkeypatch):
    data = with_walls_off(tmp_path, "laser.temperature", 0.004, monkeypatch)
    asked = frozenset({"world.map_error", "laser.temperature", "laser.offset", "laser.warmup", "laser.scale"})
    finding = criticise_scans(data, MODEL, lambda _: None, asked)
    assert {cause.id for cause in finding.causes} == {"world.map_error", "laser.temperature"}

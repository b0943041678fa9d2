# SPDX-License-Identifier: BSD-3-Clause
"""Scans of which every fifth beam was kept take as long as whole ones; those of a sensor with fewer beams need not."""

from dataclasses import replace

import laser_scene
import numpy as np
import pytest

from kurumaisu.critic.ranges.scans.gathering import laser_of, with_sweep_time
from kurumaisu.critic.values.recording import LaserMount, Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
KEPT = 5


def thinned(folder, effect=None, size=0.0):
    """A drive through a room with every fifth beam of each scan."""
    whole = laser_scene.recording(folder, effect, size, 3, scans=40)
    (run,) = whole.runs
    few = Series(run.scan.t, run.scan.values[:, ::KEPT], run.scan.columns[::KEPT])
    fan = LaserMount(0.3, 0.0, 0.0, laser_scene.FIRST, KEPT * laser_scene.INCREMENT, few.values.shape[1])
    return replace(whole, runs=(replace(run, scan=few),), laser=fan)


@pytest.mark.parametrize(("effect", "size"), [(None, 0.0), ("laser.latency", 0.04), ("laser.offset", 0.02)])
@pytest.mark.parametrize("kept", [True, False])
def test_the_readings_tell_whether_beams_were_left_out(tmp_path, monkeypatch, kept, effect, size):
    usual = MODEL.laser.time_increment
    monkeypatch.setattr(laser_scene, "BEAM_TIME", usual if kept else usual / KEPT)
    found = with_sweep_time(thinned(tmp_path, effect, size), MODEL)
    assert found.laser.time_increment == pytest.approx(KEPT * usual if kept else usual, rel=1e-4)
    assert laser_of(MODEL.laser, found.laser, found.runs).time_increment == found.laser.time_increment


def test_what_the_recording_says_holds(tmp_path):
    told = thinned(tmp_path)
    told = replace(told, laser=replace(told.laser, time_increment=1e-4))
    assert with_sweep_time(told, MODEL) is told


def test_a_whole_fan_is_the_models(tmp_path):
    whole = laser_scene.recording(tmp_path, None, 0.0, 3, scans=10)
    assert with_sweep_time(whole, MODEL) is whole


def test_scans_at_rest_tell_nothing(tmp_path):
    told = thinned(tmp_path)
    (run,) = told.runs
    still = replace(run, pose=Series(run.pose.t, np.tile(run.pose.values[:1], (len(run.pose.t), 1)), run.pose.columns))
    assert with_sweep_time(replace(told, runs=(still,)), MODEL).laser.time_increment == MODEL.laser.time_increment

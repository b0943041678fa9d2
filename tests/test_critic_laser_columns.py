# SPDX-License-Identifier: BSD-3-Clause
"""How the mean readings follow a parameter, found by trying, whatever a room is like."""

import laser_scene
import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.signals.effect_columns import EffectColumns
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
POSTS = tuple(
    (f"post_{x:.1f}_{y}", x, y, 0.05, 0.05, 0, 1.0) for y in (0.35, 4.65) for x in np.arange(0.4, 5.8, 0.4).tolist()
)


@pytest.mark.parametrize("seed", [1, 2])
def test_beams_that_pass_edges_do_not_make_a_turn_of_the_fan_a_square(tmp_path, monkeypatch, seed):
    """They are off by as much either way, and by more than all others."""
    monkeypatch.setattr(laser_scene, "BOXES", (*laser_scene.BOXES, *POSTS))
    columns = EffectColumns(gather(laser_scene.recording(tmp_path, None, 0.0, seed, scans=12), MODEL))
    for name in ("mount_yaw", "latency", "clock_skew"):
        acting, squares, _ = columns.sort(effects.by_id(f"laser.{name}"))
        assert (len(acting), squares) == (1, [])
    assert [p.name for p in columns.sort(effects.by_id("laser.tilt"))[1]] == ["pitch", "roll"]

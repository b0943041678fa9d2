# SPDX-License-Identifier: BSD-3-Clause
"""Which beams have an edge beside them: of a fan whose beams are far apart as of a fine one."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu.critic.ranges.scans.beams import hits_of, predict
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


def usable(data):
    shots = gather(data, MODEL)
    seen = hits_of(shots, (), 0)
    return usable_beams(shots, seen, predict(shots, (), seen, 0)), seen


@pytest.mark.parametrize("every", [6, 14])
def test_a_coarse_fan_keeps_the_beams_that_a_fine_one_keeps(tmp_path, every):
    data = recording(tmp_path, None, 0.0, 3, scans=20)
    fine, coarse = usable(data)[0][:, ::every], usable(sparse(data, every))[0]
    assert fine.mean() > 0.4
    assert (fine[:, 1:-1] == coarse[:, 1:-1]).mean() > 0.95


@pytest.mark.parametrize("every", [6, 21])
def test_readings_of_a_coarse_fan_scatter_as_they_do(tmp_path, every):
    """Six errors of poses are fitted to some ten readings of a scan, and leave little of their noise."""
    made = Assembly(gather(sparse(recording(tmp_path, None, 0.0, 5, scans=120), every), MODEL))
    noise = made.settle((0.003, 0.003)).beam_noise
    share = (noise.sd / made.first.sd)[noise.valid]
    assert 0.9 < np.median(share) < 1.1
    assert share.min() > 0.7


def test_a_thin_wall_seen_from_its_end_has_edges_though_every_beam_misses_it(tmp_path):
    data = sparse(recording(tmp_path, None, 0.0, 3, scans=20), 14)
    before, seen = usable(data)
    scan, beam = next((k, j) for k, j in zip(*np.nonzero(before), strict=True) if seen.level[k, j] > 2)
    x, y, heading = seen.origins[scan, beam]
    aim = heading + seen.beams[scan].bearings[beam] + 0.01
    middle = np.array([x, y]) + 1.2 * np.array([np.cos(aim), np.sin(aim)])
    world = tmp_path / "thin.world"
    thin = f"m ( pose [{middle[0]} {middle[1]} 0 {np.degrees(aim)}] size [0.3 0.004 1.0] )\n"
    world.write_text(data.world.read_text() + thin)
    after, seen = usable(replace(data, world=world))
    assert seen.level[scan, beam] > 2, "the beam passes it"
    assert not after[scan, beam]


@pytest.mark.parametrize(("stands", "counted"), [(False, 0), (True, 1)])
def test_a_scan_beyond_the_last_pose_counts_where_the_chair_stands(tmp_path, stands, counted):
    """Held where the last pose has it, a chair that drives on would be elsewhere."""
    data = recording(tmp_path, None, 0.0, 3, scans=20)
    (run,) = data.runs
    last = float(run.scan.t[-2]) + 0.35
    kept = run.pose.t < last
    poses = run.pose.values[kept]
    if stands:
        poses[run.pose.t[kept] > last - 1.0] = poses[-1]
    pose = Series(run.pose.t[kept], poses, run.pose.columns)
    cut = replace(data, runs=(replace(run, pose=pose),))
    shots = gather(cut, MODEL)
    assert (shots.stamps > last).sum() == counted
    assert (shots.stamps < last - 0.1).sum() == 19

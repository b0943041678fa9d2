# SPDX-License-Identifier: BSD-3-Clause
"""A map of pixels whose walls stand askew to them: of a real room, or of a simulator whose rays end at the pixels."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import BOXES, recording, sparse
from PIL import Image

from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.scans.beams import deviations, hits_of, predict
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
TURN = np.radians(17.0)
ROTATION = np.array([[np.cos(TURN), -np.sin(TURN)], [np.sin(TURN), np.cos(TURN)]])


def pixels_of(pixel):
    """Return pixels whose middles lie in a wall of the turned room, row 0 at the bottom, and where they begin."""
    low, high = np.array([-2.5, -1.0]), np.array([6.5, 8.0])
    count = np.ceil((high - low) / pixel).astype(int)
    x, y = np.meshgrid(*(low[i] + (np.arange(count[i]) + 0.5) * pixel for i in (0, 1)))
    out = np.zeros(x.shape, dtype=bool)
    for _, *middle, wide, high_, degrees, _ in BOXES:
        a = np.radians(degrees) + TURN
        mx, my = ROTATION @ middle
        u, v = (x - mx) * np.cos(a) + (y - my) * np.sin(a), (y - my) * np.cos(a) - (x - mx) * np.sin(a)
        out |= (np.abs(u) < wide / 2) & (np.abs(v) < high_ / 2)
    return out, low


def drawn(data, folder, pixel):
    """Return a recording with all turned, and a map of pixels."""
    walls, low = pixels_of(pixel)
    rows, columns = np.flatnonzero(walls.any(axis=1)), np.flatnonzero(walls.any(axis=0))
    inner = walls[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    Image.fromarray(np.where(inner[::-1], 0, 255).astype(np.uint8)).save(folder / "room.png")
    size = np.array(inner.shape[::-1]) * pixel
    middle = low + np.array([columns[0], rows[0]]) * pixel + size / 2
    place = f"size [{size[0]:.9f} {size[1]:.9f} 1] pose [{middle[0]:.9f} {middle[1]:.9f} 0 0]"
    return turned(data, folder, f'm ( bitmap "room.png" {place} )')


def turned(data, folder, walls):
    path = folder / "askew.world"
    path.write_text(f"define m model ( gui_move 0 boundary 0 )\n{walls}\n")
    (run,) = data.runs
    poses = np.column_stack([run.pose.values[:, :2] @ ROTATION.T, run.pose.values[:, 2] + TURN])
    return replace(data, world=path, runs=(replace(run, pose=Series(run.pose.t, poses, run.pose.columns)),))


def of_pixels(data, folder, pixel, spread=1.0):
    """Return the same as a simulator has it whose rays end at the pixels."""
    true = drawn(data, folder, pixel)
    shots = gather(true, MODEL)
    shots = replace(shots, walls=shots.walls.drawn)
    seen = hits_of(shots, (), 0)
    mean = predict(shots, (), seen, 0)
    rng = np.random.default_rng(5)
    read = np.round(mean + spread * deviations(shots, seen, mean) * rng.standard_normal(mean.shape), 3)
    (run,) = true.runs
    rows = np.searchsorted(run.scan.t, shots.stamps - 1e-9)
    poses = run.pose.values + 0.003 * rng.standard_normal(run.pose.values.shape)
    scan = Series(run.scan.t[rows], read, run.scan.columns)
    return replace(true, truth=(0.003, 0.003), runs=(replace(run, scan=scan, pose=replace(run.pose, values=poses)),))


@pytest.mark.parametrize("pixel", [0.05, 0.004])
def test_walls_are_straight_whose_readings_have_no_stairs(tmp_path, pixel):
    made = sparse(recording(tmp_path, None, 0.0, 3, scans=30))
    assert len(gather(drawn(made, tmp_path, pixel), MODEL).walls.segments) < 60


@pytest.mark.parametrize("pixel", [0.05, 0.01])
def test_walls_are_stairs_whose_readings_have_them(tmp_path, pixel, monkeypatch):
    exact = sparse(recording(tmp_path, None, 0.0, 3, scans=30, truth=1e-6))
    with monkeypatch.context() as patch:
        patch.setattr("kurumaisu.critic.ranges.scans.gathering.with_likelier_walls", lambda shots: shots)
        made = of_pixels(exact, tmp_path, pixel)
    assert len(gather(made, MODEL).walls.segments) > 400
    found = criticise_scans(made, MODEL, lambda _: None)
    assert "draw such walls as polygons" in found.refused


@pytest.mark.parametrize(("effect", "named"), [(None, set()), ("laser.range_noise", {"laser.range_noise"})])
def test_stairs_that_are_lost_in_the_noise_are_no_noise_of_the_laser(tmp_path, monkeypatch, effect, named):
    """Walls are straight then, and readings are expected to scatter as much farther as the stairs make them."""
    exact = sparse(recording(tmp_path, None, 0.0, 3, scans=60, truth=1e-6))
    with monkeypatch.context() as patch:
        patch.setattr("kurumaisu.critic.ranges.scans.gathering.with_likelier_walls", lambda shots: shots)
        made = of_pixels(exact, tmp_path, 0.003, spread=1.0 if effect is None else 1.4)
    found = criticise_scans(made, MODEL, lambda _: None)
    assert found.refused is None
    assert {cause.id for cause in found.causes} == named


def test_a_wrong_mounting_is_found_in_a_map_of_coarse_pixels(tmp_path):
    made = sparse(recording(tmp_path, "laser.mount_x", 0.02, 4, scans=60))
    found = criticise_scans(drawn(made, tmp_path, 0.05), MODEL, lambda _: None)
    causes = {cause.id: cause for cause in found.causes}
    assert set(causes) - {"world.map_error"} == {"laser.mount_x"}
    x = causes["laser.mount_x"].parameters["x"]
    assert x.lo90 - 0.002 < 0.02 < x.hi90 + 0.002


def test_where_all_beams_meet_edges_the_scans_say_so(tmp_path):
    walls, low = pixels_of(0.05)
    blocks = []
    for row in range(len(walls)):  # one block for each run of pixels: polygons, which nobody straightens
        ends = np.flatnonzero(np.diff(np.r_[0, walls[row].astype(int), 0]))
        for a, b in zip(ends[::2], ends[1::2], strict=True):
            x, y = low[0] + 0.05 * (a + b) / 2, low[1] + 0.05 * (row + 0.5)
            blocks.append(f"m ( boundary 1 size [{0.05 * (b - a):.6f} 0.05 1] pose [{x:.6f} {y:.6f} 0 0] )")
    made = sparse(recording(tmp_path, None, 0.0, 3, scans=40))
    found = criticise_scans(turned(made, tmp_path, "\n".join(blocks)), MODEL, lambda _: None)
    assert found.refused is None or "away from edges" in found.refused

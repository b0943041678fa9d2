# SPDX-License-Identifier: BSD-3-Clause
"""A round in the simulated building: drive, record, map, and compare with the truth."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from kurumaisu import geometry, slam_score
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.data.reference import map_run, scan_log
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.demo.processes import roslaunch
from kurumaisu.errors import Error
from kurumaisu.maps import Grid, grid_pair, picture
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import load_world

_DEADLINE = 200.0  # [s] of wall time for the drive


def run(folder: Path, seed: int, *, gui: bool) -> None:
    """Do it all and print the figures. Raise Error when the drive fails."""
    folder.mkdir(parents=True, exist_ok=True)
    bag = folder / "round.bag"
    bag.unlink(missing_ok=True)
    arguments = ["kurumaisu", "round.launch", f"bag:={bag}", f"seed:={seed}", f"gui:={str(gui).lower()}"]
    roslaunch(arguments, folder / "roslaunch.log", _DEADLINE, "driving")
    recording = read_recording(bag)
    (drive,) = recording.runs
    if drive.odom is None or drive.pose is None:
        raise Error(f"{bag}: has no odometry or no ground truth")

    log = scan_log(recording, drive)
    result = map_run(log, seed, lambda words: print(f"  {words}", file=sys.stderr, flush=True))
    truth = geometry.interpolate(drive.pose.t, drive.pose.values, result.trajectory[:, 0])
    world_from_map = slam_score.align(result.trajectory[:, 1:], truth)
    _print_figures(drive, result.trajectory, truth, result.grid, world_from_map)
    map_from_world = geometry.between(world_from_map, np.zeros(3))
    seen = np.column_stack([result.trajectory[:, 0], geometry.compose(np.tile(map_from_world, (len(truth), 1)), truth)])
    drawn = picture(result.grid, result.trajectory, seen, "true path")
    write_whole({**grid_pair(result.grid, folder / "map"), folder / "map.png": drawn})


def _print_figures(
    drive: Run, trajectory: FloatArray, truth: FloatArray, grid: Grid, world_from_map: FloatArray
) -> None:
    assert isinstance(drive.odom, Series)
    way = np.hypot(*np.diff(truth[:, :2], axis=0).T).sum()
    print(f"{len(trajectory)} scans, {trajectory[-1, 0] - trajectory[0, 0]:.0f} s, {way:.0f} m driven")
    odom = geometry.interpolate(drive.odom.t, drive.odom.values[:, :3], trajectory[:, 0])
    for name, path in (("odometry", odom), ("particle filter", trajectory[:, 1:])):
        position, heading = slam_score.trajectory_error(path, truth)
        print(f"  path by {name:16} rms error {position:.3f} m, {np.degrees(heading):.2f} deg")
    distance = slam_score.map_error(grid, world_from_map, load_world(shipped("worlds/building.world")).segments)
    print(
        f"  map: {len(distance)} wall cells of {grid.resolution:g} m; distance to the true walls "
        f"median {np.median(distance):.3f} m, 95 % below {np.quantile(distance, 0.95):.3f} m"
    )

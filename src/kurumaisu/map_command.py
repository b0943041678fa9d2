# SPDX-License-Identifier: BSD-3-Clause
"""The command `map`: a recording in, a map and a picture of it out."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from kurumaisu import slam
from kurumaisu.critic.reading import read_recording
from kurumaisu.critic.reference import scan_log
from kurumaisu.errors import Error, one_line
from kurumaisu.maps import draw_map, save_map
from kurumaisu.params import shipped


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0, or 2 for bad input, which is told on stderr."""
    parser = argparse.ArgumentParser(prog="map", description="Make a map from a recording of scans and odometry.")
    parser.add_argument("log", type=Path, metavar="LOG", help="an MRPT rawlog, a bag, or a folder as critic reads it")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/map"), metavar="FOLDER")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the particle filter (1)")
    parser.add_argument("--settings", type=Path, metavar="FILE", help="as launch/mapping_node.yaml, the default")
    options = parser.parse_args(arguments)
    try:
        if not 0 <= options.seed < 2**32:
            raise Error(f"--seed: must be 0 to 4294967295: {options.seed}")
        settings = slam.load_mapping_settings(options.settings or shipped("launch/mapping_node.yaml"))
        report(read_log(options.log), settings, options.seed, options.output)
    except Error as error:
        print(f"map: {one_line(error)}", file=sys.stderr)
        return 2
    return 0


def read_log(path: Path) -> slam.ScanLog:
    """Read the scans and odometry of a recording of one run. Raise Error naming what is wrong with it."""
    if path.suffix != ".bag" and not path.is_dir():
        return slam.read_rawlog(path)
    recording = read_recording(path)
    if len(recording.runs) != 1:
        raise Error(f"{path}: has {len(recording.runs)} runs; a map is made of one")
    return scan_log(recording, recording.runs[0])


def report(log: slam.ScanLog, settings: slam.MapperSettings, seed: int, folder: Path) -> slam.MappingResult:
    """Map a log, write map.pgm, map.yaml, map.png and trajectory.csv, and say on stdout what came out."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    start = time.process_time()
    result = slam.map_scans(settings, log, seed, show_progress)
    seconds = time.process_time() - start
    path = result.trajectory
    save_map(result.grid, folder / "map")
    odometry = np.column_stack([log.times, log.odom])  # its frame is the map's at the first scan
    draw_map(result.grid, path, folder / "map.png", odometry, "odometry")
    np.savetxt(folder / "trajectory.csv", path, fmt="%.6f", delimiter=",", header="t,x,y,theta", comments="")
    way = np.hypot(np.diff(path[:, 1]), np.diff(path[:, 2])).sum()
    left, right, bottom, top = result.grid.extent
    print(
        f"{log.name}: {len(path)} scans, {path[-1, 0] - path[0, 0]:.1f} s, {way:.1f} m driven, seed {seed}\n"
        f"map: {right - left:.1f} x {top - bottom:.1f} m at {result.grid.resolution:g} m\n"
        f"work: {1000 * seconds / len(path):.1f} ms of processor time per scan\n"
        f"written: map.pgm, map.yaml, map.png, trajectory.csv in {folder}"
    )
    return result


def show_progress(done: int, total: int) -> None:
    """Show how far it is on a terminal, and nothing elsewhere."""
    if sys.stderr.isatty() and (done % 20 == 0 or done == total):
        print(f"\rmapping: {100 * done // total} %", end="\n" if done == total else "", file=sys.stderr)

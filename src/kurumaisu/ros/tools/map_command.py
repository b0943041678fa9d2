# SPDX-License-Identifier: BSD-3-Clause
"""The command `map`: a recording in, a map and a picture of it out."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kurumaisu import program, slam, slam_score
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.data.reference import scan_log
from kurumaisu.errors import Error, failed
from kurumaisu.geometry import interpolate
from kurumaisu.maps import grid_pair, picture
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

_LEAST_POSES = 3  # to fit two paths to each other


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0, or 1 for bad input, which is told on stderr."""
    parser = program.Parser(prog="map", description="Make a map from a recording of scans and odometry.")
    parser.add_argument("log", type=Path, metavar="LOG", help="an MRPT rawlog, a bag, or a folder as critic reads it")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/map"), metavar="FOLDER")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the particle filter (1)")
    parser.add_argument("--settings", type=Path, metavar="FILE", help="settings (launch/mapping_node.yaml)")
    parser.add_argument("--start", type=Path, metavar="SIMPLEMAP", help="continue from this map")
    parser.add_argument(
        "--at",
        type=float,
        nargs=3,
        default=(0.0, 0.0, 0.0),
        metavar=("X", "Y", "THETA"),
        help="start pose in that map (0 0 0)",
    )
    parser.add_argument(
        "--within",
        type=float,
        nargs=2,
        default=(0.3, 0.2),
        metavar=("DISTANCE", "ANGLE"),
        help="its standard deviations, at most 1 m and 0.5 rad (0.3 0.2)",
    )
    parser.add_argument(
        "--rawlog", type=Path, metavar="FILE", help="write the scans and odometry as MRPT's rawlog, too"
    )
    options = parser.parse_args(arguments)
    if not 0 <= options.seed < 2**32:
        parser.error(f"--seed: must be 0 to 4294967295: {options.seed}")
    try:
        settings = slam.load_mapping_settings(options.settings or shipped("launch/mapping_node.yaml"))
        log, truth = read_log(options.log)
        if options.rawlog is not None:
            slam.write_rawlog(log, options.rawlog)
        distance, angle = options.within
        start = None
        if options.start is not None:
            start = slam.Start(options.start, np.array(options.at), np.array([distance, distance, angle]))
        report(log, truth, settings, options.seed, start, options.output)
    except Error as error:
        return failed("map", error)
    return 0


def read_log(path: Path) -> tuple[slam.ScanLog, FloatArray | None]:
    """Read the scans and odometry of a recording of one run, and the true poses, if it has any.

    The latter as (m, 4) of t, x, y, theta. Raise Error naming what is wrong with it.
    """
    if path.suffix != ".bag" and not path.is_dir():
        return slam.read_rawlog(path), None
    recording = read_recording(path)
    if len(recording.runs) != 1:
        raise Error(f"{path}: has {len(recording.runs)} runs; a map is made from one")
    run = recording.runs[0]
    truth = None if run.pose is None else np.column_stack([run.pose.t, run.pose.values[:, :3]])
    return scan_log(recording, run), truth


def report(
    log: slam.ScanLog,
    truth: FloatArray | None,
    settings: slam.MapperSettings,
    seed: int,
    start: slam.Start | None,
    folder: Path,
) -> slam.MappingResult:
    """Map a log, write the map, a picture and the path to a folder, and say on stdout what came out."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    with TemporaryDirectory() as scratch:
        before = time.process_time()
        result = slam.map_scans(settings, log, seed, show_progress, start, Path(scratch, "map.simplemap"))
        seconds = time.process_time() - before
        simplemap = Path(scratch, "map.simplemap").read_bytes()
    path = result.trajectory
    # odometry's frame is the map's at the first scan
    other = np.column_stack([log.times, log.odom]) if start is None else None
    write_whole(
        {
            **grid_pair(result.grid, folder / "map"),
            folder / "map.simplemap": simplemap,
            folder / "map.png": picture(result.grid, path, other, "odometry"),
            folder / "trajectory.csv": _table(path, "t,x,y,theta"),
            folder / "uncertainty.csv": _table(result.nodes, "t,x,y,theta,xx,xy,yy,xt,yt,tt"),
        }
    )
    way = np.hypot(np.diff(path[:, 1]), np.diff(path[:, 2])).sum()
    left, right, bottom, top = result.grid.extent
    print(
        f"{log.name}: {len(path)} scans, {path[-1, 0] - path[0, 0]:.1f} s, {way:.1f} m driven, seed {seed}\n"
        f"map: {right - left:.1f} x {top - bottom:.1f} m at {result.grid.resolution:g} m\n"
        f"{error_of(path, truth)}"
        f"work: {1000 * seconds / len(path):.1f} ms of processor time per scan\n"
        f"written: map.pgm, map.yaml, map.simplemap, map.png, trajectory.csv, uncertainty.csv in {folder}"
    )
    return result


def error_of(path: FloatArray, truth: FloatArray | None) -> str:
    """Return a line on how far a path (n, 4) is from the true one (m, 4), or nothing where there is none.

    After the rigid motion that fits them best: the map's frame is its own.
    """
    if truth is None:
        return ""
    inside = (path[:, 0] >= truth[0, 0]) & (path[:, 0] <= truth[-1, 0])
    if inside.sum() < _LEAST_POSES:
        return "error: the recording has a true pose, but at other times\n"
    at = interpolate(truth[:, 0], truth[:, 1:], path[inside, 0])
    position, heading = slam_score.trajectory_error(path[inside, 1:], at)
    return f"error: {position:.3f} m, {np.degrees(heading):.2f} degrees (RMS, {inside.sum()} scans)\n"


def _table(table: FloatArray, header: str) -> str:
    text = io.StringIO()
    formats = ["%.6f"] * 4 + ["%.9g"] * (table.shape[1] - 4)
    np.savetxt(text, table, fmt=formats, delimiter=",", header=header, comments="")
    return text.getvalue()


def show_progress(done: int, total: int) -> None:
    """Show how far it is on a terminal, and nothing elsewhere."""
    if sys.stderr.isatty() and (done % 20 == 0 or done == total):
        print(f"\rmapping: {100 * done // total} %", end="\n" if done == total else "", file=sys.stderr)

# SPDX-License-Identifier: BSD-3-Clause
"""Clearpath Warthog: the track that a skidding robot seems to have."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bounded_files import MOST_TABLE, read_text
from kurumaisu.real.by_hand import least_squares
from kurumaisu.real.criticise import criticise, recording, there
from kurumaisu.types import BoolArray, FloatArray

RADIUS = 0.30  # [m] of the wheels, nominal; what it really is, is asked
TRACK = 1.50  # [m] between the wheels, nominal
_COUNTS = "calib"  # state in which commands mean something
_GAP, _DRAINED = 0.16, 1.0  # [s] between poses that come as they are measured; after a longer one, until none waits
_IMU = (*"xyz", *(f"acceleration_{axis}" for axis in "xyz"))
_WINDOW = 2.0  # [s] over which wheels and ground are compared by hand
_ROUNDS = 5  # of working out how much of a way its chords cut, by the wheels that come of it


@dataclass(frozen=True)
class Log:
    """The log: t (n,) [s]; commands v, w (n,); wheels (n, 2) left and right [rad/s]; poses (m, 4) by time.

    all_poses: with those that came late; imu (k, 7): by time, rates [rad/s] and accelerations [m/s^2].
    """

    t: FloatArray
    v: FloatArray
    w: FloatArray
    wheels: FloatArray
    counts: FloatArray
    pose: FloatArray
    all_poses: FloatArray
    imu: FloatArray | None = None


def load(data: Path) -> Log:
    """Read the log. Raise Error where it is not there."""
    path = there(data / "norlab_drive/warthog_asphalt_2024_9_20_8h13_raw.csv")
    rows = list(csv.DictReader(io.StringIO(read_text(path, MOST_TABLE), newline="")))

    def column(name: str) -> FloatArray:
        return np.array([float(row[name]) for row in rows])

    stamps = np.array([int(row["ros_time"]) for row in rows])
    t = (stamps - stamps[0]) * 1e-9
    qx, qy, qz, qw = (column(f"icp_quat_{axis}") for axis in "xyzw")
    yaw = np.unwrap(np.arctan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy**2 + qz**2)))
    fresh = np.diff(column("icp_index"), prepend=0.0) != 0  # the file repeats a pose until the next
    poses = np.column_stack([t, column("icp_pos_x"), column("icp_pos_y"), yaw])[fresh]
    return Log(
        t=t,
        v=column("cmd_vel_x"),
        w=column("cmd_vel_omega"),
        wheels=np.column_stack([column("meas_left_vel"), column("meas_right_vel")]),
        counts=np.array([row["calib_state"] == _COUNTS for row in rows]),
        pose=poses[~late(poses[:, 0])],
        all_poses=poses,
        imu=np.column_stack([t, *(column(f"imu_{name}") for name in _IMU)])[1:],  # the first row has none yet
    )


def late(t: FloatArray) -> BoolArray:
    """Return which poses may have waited, by the times of their rows (n,) [s].

    A pose has no stamp of its own but that of the row it was written to. Where the matching of scans falls behind, no
    pose comes for up to 0.65 s, and then several at once, each as old as its place in the queue.
    """
    gaps = np.diff(t, prepend=t[0])
    stalls = t[gaps > _GAP]
    last = np.searchsorted(stalls, t, side="right") - 1
    return np.asarray((last >= 0) & (t - stalls[np.maximum(last, 0)] < _DRAINED))


def odometry(log: Log, radius: float, track: float) -> FloatArray:
    """Return rows (n, 6) of t, x, y, theta, v, w of dead reckoning with wheels."""
    v = radius * log.wheels.mean(axis=1)
    w = radius * (log.wheels[:, 1] - log.wheels[:, 0]) / track
    dt = np.diff(log.t)
    theta = np.r_[0.0, np.cumsum(0.5 * (w[1:] + w[:-1]) * dt)]
    course = 0.5 * (theta[1:] + theta[:-1])
    way = 0.5 * (v[1:] + v[:-1]) * dt
    x, y = np.r_[0.0, np.cumsum(way * np.cos(course))], np.r_[0.0, np.cumsum(way * np.sin(course))]
    return np.column_stack([log.t, x, y, theta, v, w])


def between(table: FloatArray, start: float, end: float) -> FloatArray:
    """Return the rows of a table within a time."""
    return table[(table[:, 0] >= start) & (table[:, 0] <= end)]


def wheels_against_ground(log: Log, start: float, end: float) -> tuple[float, float, str]:
    """Return the effective radius and track [m] of a stretch, by least squares over windows, and both in words.

    Poses come rarely at times, and a chord cuts the bends of the way between two of them: see _cut.
    """
    poses = between(log.pose, start, end)
    kept = [0]
    for i in range(len(poses)):
        kept += [i] if poses[i, 0] - poses[kept[-1], 0] >= _WINDOW else []
    at, ahead, turn = poses[kept, 0], _ways(poses[kept, 1:]), np.diff(poses[kept, 3])
    turned = np.vstack([np.zeros(2), np.cumsum(0.5 * (log.wheels[1:] + log.wheels[:-1]) * np.diff(log.t)[:, None], 0)])
    spun = np.diff(np.column_stack([np.interp(at, log.t, turned[:, i]) for i in range(2)]), axis=0)
    moving = np.abs(spun).sum(axis=1) > 0.5
    mean, difference = spun.mean(axis=1)[moving], np.diff(spun, axis=1)[moving, 0]
    around = least_squares(np.column_stack([difference, mean]), turn[moving])
    radius, track = RADIUS, TRACK
    for _ in range(_ROUNDS):
        whole = ahead[moving] + _cut(log, at, radius, track)[moving]
        along = least_squares(np.column_stack([mean, difference]), whole)
        radius, track = float(along.at[0]), float(along.at[0] / around.at[0])
    error = track * np.hypot(along.sd[0] / along.at[0], around.sd[0] / around.at[0])
    words = (
        f"{moving.sum()} stretches of {_WINDOW:g} s and more: effective radius {along.told(0)} m (nominal {RADIUS}), "
        f"apparent track {track:.3f} +- {error:.3f} m (nominal {TRACK}): turns are {around.at[0] * TRACK / RADIUS:.3f} "
        f"of what nominal wheels say"
    )
    return radius, track, words


def _ways(poses: FloatArray) -> FloatArray:
    """Return the lengths [m], (n,), of arcs between poses (n + 1, 3) of x, y, heading."""
    x, y, yaw = poses.T
    course = 0.5 * (yaw[1:] + yaw[:-1])
    chords = np.diff(x) * np.cos(course) + np.diff(y) * np.sin(course)
    return np.asarray(chords / np.sinc(np.diff(yaw) / (2 * np.pi)))


def _cut(log: Log, at: FloatArray, radius: float, track: float) -> FloatArray:
    """Return by how much the ways of a robot with such wheels are longer than arcs between its poses at times [m]."""
    path = odometry(log, radius, track)
    poses = np.column_stack([np.interp(at, log.t, path[:, i]) for i in (1, 2, 3)])
    gone = np.r_[0.0, np.cumsum(0.5 * (path[1:, 4] + path[:-1, 4]) * np.diff(log.t))]
    return np.asarray(np.diff(np.interp(at, log.t, gone)) - _ways(poses))


def lateness(log: Log, poses: FloatArray, radius: float) -> FloatArray:
    """Return how late poses come (n,) [s]: when the wheels had gone as far, nan below 0.5 m/s; median taken out."""
    speed = radius * log.wheels.mean(axis=1)
    gone = np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(log.t))]
    course = 0.5 * (poses[1:, 3] + poses[:-1, 3])
    steps = np.diff(poses[:, 1]) * np.cos(course) + np.diff(poses[:, 2]) * np.sin(course)
    behind = np.interp(poses[:, 0], log.t, gone) - np.r_[0.0, np.cumsum(steps)]
    behind -= np.array([np.median(behind[max(0, i - 50) : i + 50]) for i in range(len(behind))])
    now = np.interp(poses[:, 0], log.t, speed)
    return np.asarray(behind / np.where(np.abs(now) > 0.5, now, np.nan))


def run(data: Path, output: Path) -> None:
    """Print what the wheels say of the ground, by hand and by the critic."""
    log = load(data)
    print("## By hand: wheels against the ground (lidar poses)")
    for words, poses in (("all", log.all_poses), ("those kept", log.pose)):
        some = between(poses, 134.0, 218.0)
        found = lateness(log, some, 0.286)
        quantiles = " ".join(f"{q:+.2f}" for q in np.nanquantile(found, [0.05, 0.25, 0.5, 0.75, 0.95, 1.0]))
        print(f"poses, {words} ({len(some)}): late by {quantiles} s (quantiles .05 .25 .5 .75 .95 1)")
    print(f"driven by a person, 134-218 s: {wheels_against_ground(log, 134.0, 218.0)[2]}")
    print(f"driven by commands, 405-430 s: {wheels_against_ground(log, 405.0, 430.0)[2]}")
    criticise(_wheels(log, output / "wheels"), output / "wheels", "wheels against the ground")
    assert log.imu is not None
    turned = recording_of_gyro(log, log.imu, output / "gyro")
    criticise(turned, output / "gyro", "wheels against the gyro, without any pose")


def _wheels(log: Log, folder: Path) -> Path:
    """Write nominal odometry and lidar poses of both times that the robot moved for long."""
    return _beside_odometry(log, folder, "pose", log.pose)


def recording_of_gyro(log: Log, imu: FloatArray, folder: Path) -> Path:
    """Write nominal odometry and the imu of both times that the robot moved for long; return where."""
    return _beside_odometry(log, folder, "imu", imu)


def _beside_odometry(log: Log, folder: Path, name: str, rows: FloatArray) -> Path:
    nominal = odometry(log, RADIUS, TRACK)
    spans = {"manual": (134.0, 218.0), "commanded": (405.0, 431.0)}
    return recording(
        folder,
        {drive: {"odom": between(nominal, *span), name: between(rows, *span)} for drive, span in spans.items()},
        robot={"kind": "skid_steer", "radius": RADIUS, "track": TRACK},
    )

# SPDX-License-Identifier: BSD-3-Clause
"""SENA, a robotic wheelchair of the University of Malaga: odometry and a SICK, and no other reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.real.criticise import criticise, there
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray

FOLDER = Path("/usr/share/mrpt/datasets")
LOG = "2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"


def run(data: Path, output: Path, log: str = LOG) -> None:
    """Print what can be said of a rawlog of MRPT's own; data is not needed."""
    path = there(FOLDER / log)
    recording = read_recording(path)
    drive, laser = recording.runs[0], recording.laser
    assert drive.scan is not None
    assert drive.odom is not None
    assert laser is not None
    steps = geometry.between(drive.odom.values[:-1, :3], drive.odom.values[1:, :3])
    print("## By hand")
    print(
        f"{len(drive.scan.t)} scans in {drive.scan.t[-1] - drive.scan.t[0]:.1f} s, "
        f"{np.hypot(*steps[:, :2].T).sum():.1f} m, {np.degrees(np.abs(steps[:, 2]).sum()):.0f} deg of turns, "
        f"fastest {np.abs(drive.odom.column('v')).max():.2f} m/s"
    )
    heading = wall_headings(drive.scan.values, laser.angle_min + laser.angle_increment * np.arange(laser.beams))
    print(against_walls(heading, drive.odom.values[:, 2]))
    criticise(path, output, "odometry against its own scans")


def wall_headings(ranges: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the direction (n,) [rad], modulo a quarter turn, in which most walls of each scan run, nan where unclear.

    A campus is built at right angles, so walls tell the heading over any time, whatever the odometry says.
    """
    out = np.full(len(ranges), np.nan)
    for i, row in enumerate(ranges):
        x, y = (np.where(np.isfinite(row), row, np.nan) * part for part in (np.cos(angles), np.sin(angles)))
        dx, dy = x[6:] - x[:-6], y[6:] - y[:-6]
        length = np.hypot(dx, dy)
        good = np.isfinite(length) & (length > 0.02) & (length < 0.6)
        mean = np.sum((length * np.exp(4j * np.arctan2(dy, dx)))[good])
        if good.sum() > 60 and abs(mean) > 0.35 * length[good].sum():
            out[i] = -np.angle(mean) / 4  # walls that turn clockwise in the scan: the robot turns the other way
    return out


def against_walls(walls: FloatArray, odom: FloatArray) -> str:
    """Return in words how the odometry's heading drifts against the walls."""
    quarter = np.pi / 2
    apart = odom - walls
    known = np.flatnonzero(np.isfinite(apart))
    drift = np.unwrap(apart[known], period=quarter)
    first, last = np.median(drift[:10]), np.median(drift[-10:])
    made = float(odom[known[-10:]].mean() - odom[known[:10]].mean())
    if abs(made) < np.pi:
        return f"walls against odometry: {np.degrees(made):+.0f} deg of turning are too little for it"
    steps = SIGMA_PER_MAD * float(np.median(np.abs(np.diff(drift))))
    half = int(np.argmax(np.abs(odom[known] - odom[known[0]]) > abs(made) / 2))
    middle = float(np.median(drift[max(half - 5, 0) : half + 5]))
    return (
        f"heading of odometry less that of walls, {len(known)} scans: {np.degrees(last - first):+.1f} deg by the end, "
        f"while it says {np.degrees(made):+.0f} deg: turns are {1 - (last - first) / made:.3f} of what it says "
        f"({1 - 2 * (middle - first) / made:.2f} in its first half, {1 - 2 * (last - middle) / made:.2f} in its "
        f"second; one scan against the next: {np.degrees(steps):.1f} deg)"
    )

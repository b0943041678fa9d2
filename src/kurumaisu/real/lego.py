# SPDX-License-Identifier: BSD-3-Clause
"""A LEGO robot: odometry from ticks against an overhead camera that sees positions only, and against its own scans."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.params import robot_of
from kurumaisu.real.by_hand import Line
from kurumaisu.real.criticise import criticise, strangers
from kurumaisu.settings import Section
from kurumaisu.types import FloatArray

RADIUS, TRACK = 0.03, 0.15  # [m] as its software has them
_OUTLIER = 0.02  # [m] from which a position loses weight


def run(data: Path, output: Path) -> None:
    """Print what the odometry misses of the camera's path, by hand and by the critic, and by the critic from scans."""
    folder = strangers(data, "lego_camera")
    print("## By hand: the path by odometry, its way and its turns scaled, against the camera's")
    for name, start, end in (("all", 0.0, 1.0), ("first half", 0.0, 0.5), ("second half", 0.5, 1.0)):
        line = path_fit(folder, start, end)
        print(f"{name}: way {line.told(0, 3)}, turns {line.told(1, 3)} of what it says, rms {1e3 * line.rms:.0f} mm")
    robot = robot_of(Section({"robot": {"kind": "diff_drive", "radius": RADIUS, "track": TRACK}}, "the LEGO robot"))
    criticise(folder, output / "camera", "odometry against the camera", robot)
    criticise(strangers(data, "lego_scan"), output / "scan", "odometry against its own scans", robot)


def path_fit(folder: Path, start: float, end: float) -> Line:
    """Return the scale of the way and of the turns, turn per metre [rad/m], and the first pose, by least squares.

    start, end: which shares of the time count. Raise Error as read_recording does.
    """
    (drive,) = read_recording(folder).runs
    assert drive.odom is not None
    assert drive.pose is not None
    t, (x, y, theta) = drive.odom.t, drive.odom.values[:, :3].T
    turns = np.diff(np.unwrap(theta))
    middle = theta[:-1] + turns / 2
    ways = np.diff(x) * np.cos(middle) + np.diff(y) * np.sin(middle)
    at, seen = drive.pose.t, drive.pose.values[:, :2]
    share = (at - at[0]) / (at[-1] - at[0])
    at, seen = at[(share >= start) & (share <= end)], seen[(share >= start) & (share <= end)]

    def left(q: FloatArray) -> FloatArray:
        heading = q[5] + np.append(0.0, np.cumsum(q[1] * turns + q[2] * ways))
        mean = 0.5 * (heading[1:] + heading[:-1])
        x, y = (np.append(0.0, np.cumsum(q[0] * ways * part)) for part in (np.cos(mean), np.sin(mean)))
        return np.append(np.interp(at, t, q[3] + x) - seen[:, 0], np.interp(at, t, q[4] + y) - seen[:, 1])

    begins = [np.array([1.0, 1.0, 0.0, *seen[0], heading]) for heading in np.arange(0.0, 6.0, 0.75)]
    best = min(
        (least_squares(left, begin, loss="soft_l1", f_scale=_OUTLIER) for begin in begins),
        key=lambda fit: float(fit.cost),
    )
    variance = 2 * best.cost / (2 * len(at) - len(best.x))
    sd = np.sqrt(variance * np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    return Line(best.x, sd, float(np.sqrt(np.mean(left(best.x) ** 2))))

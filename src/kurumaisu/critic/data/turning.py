# SPDX-License-Identifier: BSD-3-Clause
"""A reference where only an inertial sensor measured how a robot turned; how far it went its odometry says, at most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.base.drive import driven
from kurumaisu.critic.data.odometry import along, rates_between
from kurumaisu.critic.imu.yaw_rate import heading
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.types import FloatArray

# Errors of such a reference: its places say nothing [m], or as much as wheels and stamps of rows do; its headings
# err by less than stamps are off [rad].
_NOWHERE, _WAY_SD, _HEADING_SD = 1.0e3, 5.0e-3, 1.0e-3
_APART = 0.02  # [s] between rows, at least
_GAP = 0.5  # [s] without a row in which a turn is not known
_SOURCE = "headings by the imu, along the way of {}, {} (no pose was measured)"
_CHECKS = {True: "in which slip of the wheels does not show", False: "which nothing checks"}


def turning_only(recording: Recording) -> bool:
    """Tell whether turning is all that was measured: no run has poses or scans, and each that was driven has an imu."""
    runs = [run for run in recording.runs if run.queries is None]
    bare = all(run.pose is None and run.scan is None for run in recording.runs)
    return bare and bool(runs) and all(run.imu is not None and driven(run) for run in runs)


def with_turning(recording: Recording) -> Recording:
    """Return a recording with headings by the imu for its reference.

    Its places are those of the odometry, to which commands or voltages are compared; where there are no such two, they
    say nothing.
    """
    known = [run for run in recording.runs if run.queries is None]
    placed = all(run.odom is not None and (run.command is not None or run.voltage is not None) for run in known)
    runs = tuple(run if run.queries is not None else _turned(run, placed=placed) for run in recording.runs)
    truth = (_WAY_SD if placed else _NOWHERE, _HEADING_SD)
    return replace(recording, runs=runs, truth=truth, turning=True, placed=placed)


def _turned(run: Run, *, placed: bool) -> Run:
    assert run.imu is not None
    name, since, gone = _way(run)
    times = since if placed else np.arange(run.imu.t[0], run.imu.t[-1], _APART)
    t = times[(times >= run.imu.t[0]) & (times <= run.imu.t[-1])]
    theta, way = np.interp(t, run.imu.t, heading(run.imu)), np.interp(t, since, gone)
    rows = along(np.column_stack([np.diff(way), np.diff(theta)]))
    unknown = np.flatnonzero(np.diff(run.imu.t) > _GAP)
    lost = tuple((float(run.imu.t[i]), float(run.imu.t[i + 1])) for i in unknown)
    pose = Series(t, rows, ("x", "y", "theta"))
    return replace(run, pose=pose, pose_source=_SOURCE.format(name, _CHECKS[placed]), aside=(*run.aside, *lost))


def _way(run: Run) -> tuple[str, FloatArray, FloatArray]:
    """Return by what it is known, times (n,) [s], and how far the robot had gone by then, (n,) [m]."""
    if run.odom is not None:
        arcs = rates_between(run.odom.t, run.odom.values[:, :3])[1:, 0] * np.diff(run.odom.t)
        return "the odometry", run.odom.t, np.append(0.0, np.cumsum(arcs))
    if run.command is not None:
        steps = run.command.column("v")[:-1] * np.diff(run.command.t)
        return "the commands", run.command.t, np.append(0.0, np.cumsum(steps))
    return "no odometry", np.zeros(1), np.zeros(1)

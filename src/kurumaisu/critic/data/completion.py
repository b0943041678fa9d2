# SPDX-License-Identifier: BSD-3-Clause
"""What a drive leaves unsaid: rates of odometry, headings of a reference, and the end of a command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.headings import Guide, with_headings
from kurumaisu.critic.data.odometry import COLUMNS, driven_by, rates_between
from kurumaisu.critic.imu.yaw_rate import heading, with_yaw_rate
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray


def completed(run: Run, hold: float | None, faults: Faults, axis: str | None = None) -> Run:
    """Return a run with all columns of odometry and pose; hold: for how long a command holds [s], None: until the next.

    axis: of the imu that is up, as with_yaw_rate has it. faults gets what was worked out, and what could not be.
    """
    odom = run.odom
    if odom is not None and odom.columns != COLUMNS:
        poses = np.column_stack([odom.column(name) for name in COLUMNS[:3]])
        odom = Series(odom.t, np.column_stack([poses, rates_between(odom.t, poses)]), COLUMNS)
    command = run.command if run.command is None or hold is None else _ended(run.command, hold)
    run, words = with_yaw_rate(replace(run, odom=odom, command=command), axis)
    for line in words:
        faults.add(line)
    if run.pose is None or "theta" in run.pose.columns:
        return run
    guide = _guide(run)
    try:
        pose, way = with_headings(run.pose, guide)
    except Error as error:
        faults.add(f"{run.name}: the reference {error}: not used")
        return replace(run, pose=None)
    between = "straight lines" if guide is None else guide.name
    faults.add(
        f"{run.name}: the reference has no headings: they are the directions of ways of {way:.2g} m, and follow "
        f"{between} in between; what was measured is taken to be above the middle of the axle"
    )
    return replace(run, pose=pose, courses=True)


def _ended(command: Series, hold: float) -> Series:
    """Return commands with a row of 0 wherever one has held for so long [s] and no other has come."""
    ends = np.append(command.t[1:], np.inf) - command.t > hold
    t = np.concatenate([command.t, command.t[ends] + hold])
    values = np.vstack([command.values, np.zeros((int(ends.sum()), command.values.shape[1]))])
    order = np.argsort(t, kind="stable")
    return Series(t[order], values[order], command.columns)


def _guide(run: Run) -> Guide | None:
    """Return what says best how a robot turned, and whether it drove ahead."""
    plain = _guide_without_imu(run)
    if run.imu is None or plain is None:
        return plain
    return Guide("the imu", run.imu.t, heading(run.imu), plain.speeds(run.imu.t), steady=True)


def _guide_without_imu(run: Run) -> Guide | None:
    if run.odom is not None:
        return Guide("the odometry", run.odom.t, run.odom.column("theta"), run.odom.column("v"))
    if run.command is None:
        return None
    t, rates = _held(run.command)
    return Guide("the commands", t, driven_by(t, rates)[:, 2], rates[:, 0])


def _held(command: Series) -> tuple[FloatArray, FloatArray]:
    """Return times and rates that are held until the next, as rows between which they change evenly."""
    rates = np.column_stack([command.column("v"), command.column("w")])
    t = np.repeat(command.t, 2)[1:]
    return t, np.repeat(rates, 2, axis=0)[:-1]

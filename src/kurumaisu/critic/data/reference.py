# SPDX-License-Identifier: BSD-3-Clause
"""A reference pose where nobody measured one: a particle filter's path, the wheels' odometry, or an imu's headings."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu.critic.base.drive import driven
from kurumaisu.critic.data.odometry import along, rates_between
from kurumaisu.critic.rates.yaw_rate import heading
from kurumaisu.critic.values.criticism import Progress
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.types import FloatArray

if TYPE_CHECKING:  # loading MRPT takes a third of a second, which a recording with reference poses need not pay
    from kurumaisu.slam import MappingResult, ScanLog


# Errors of such a reference: its places say nothing [m], or as much as wheels and stamps of rows do; its headings
# err by less than stamps are off [rad].
_NOWHERE, _WAY_SD, _HEADING_SD = 1.0e3, 5.0e-3, 1.0e-3
_APART = 0.02  # [s] between rows, at least
_GAP = 0.5  # [s] without a row in which a turn is not known
_SOURCE = "headings by the imu, along the way of {}, {} (no pose was measured)"
_CHECKS = {True: "in which slip of the wheels does not show", False: "which nothing checks"}


def with_reference(recording: Recording, seed: int, progress: Progress) -> Recording:
    """Return the recording with a pose for every run that somebody drove, mapping those that have none.

    Without scans an imu is the reference of how the robot turned, or else the odometry of what was asked for. A run of
    which motions are to be predicted may go without a pose.

    Raise Error for a run that was driven and has neither a pose nor odometry to find one from.
    """
    if all(run.pose is not None or run.queries is not None for run in recording.runs):
        return recording
    if turning_only(recording):
        return with_turning(recording)
    runs = tuple(
        _with_pose(recording, run, seed, progress) if run.pose is None and run.queries is None and driven(run) else run
        for run in recording.runs
    )
    return replace(recording, runs=runs)


def map_run(log: ScanLog, seed: int, progress: Progress) -> MappingResult:
    """Map a log with the settings of mapping_node. Raise Error naming the log and the scan that makes no sense."""
    slam = import_module("kurumaisu.slam")

    def say(done: int, total: int) -> None:
        if done == total or done % 200 == 0:
            progress(f"mapping {log.name}: {done} of {total} scans")

    settings = slam.load_mapping_settings(shipped("launch/mapping_node.yaml"))
    result: MappingResult = slam.map_scans(settings, log, seed, say)
    return result


def scan_log(recording: Recording, run: Run) -> ScanLog:
    """Return a run's scans with their odometry, for mapping.

    Where the laser is that of a model (the recording's, or ours for a chair driven by voltages), the model says how it
    is mounted if the recording does not, and its mean error is taken out of the readings.
    Raise Error when the run has no scans, no odometry, or nobody knows how the laser is mounted.
    """
    if run.scan is None or run.odom is None:
        raise Error(f"{run.name}: has no reference pose, and lacks scans or odometry to compute one")
    slam = import_module("kurumaisu.slam")
    ours = recording.model is not None or run.voltage is not None
    laser = load_model(recording.model or shipped("launch/md100.yaml")).laser if ours else None
    mount = recording.laser
    place = mount or (laser.mount if laser is not None else None)
    fan = run.fan or mount or laser
    if place is None or fan is None:
        raise Error(f"{run.name}: the mounting of the laser is unknown: give laser in meta.yaml")
    ranges = run.scan.values if laser is None else laser.error.range(run.scan.values)
    beams = slam.Fan(
        angle_min=fan.angle_min,
        angle_increment=fan.angle_increment,
        time_increment=run.fan.time_increment if run.fan is not None else 0.0,
        range_max=laser.range_max
        if laser is not None
        else float(np.nanmax(ranges, initial=0.0, where=ranges < np.inf)),
        base_from_laser=(place.x, place.y, place.yaw),
    )
    log: ScanLog = slam.scan_log(
        run.name, run.scan.t, ranges.astype(np.float32), beams, run.odom.t, run.odom.values[:, :3]
    )
    return log


def _with_pose(recording: Recording, run: Run, seed: int, progress: Progress) -> Run:
    if run.scan is None and run.odom is not None and (run.voltage is not None or run.command is not None):
        poses = Series(run.odom.t, run.odom.values[:, :3], ("x", "y", "theta"))
        source = "the odometry (no pose was measured): slip of the wheels does not show in it"
        return replace(run, pose=poses, pose_source=source)
    path = map_run(scan_log(recording, run), seed, progress).trajectory
    source = f"particle filter over {len(path)} scans (no pose was measured), seed {seed}"
    return replace(run, pose=Series(path[:, 0], path[:, 1:], ("x", "y", "theta")), pose_source=source)


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

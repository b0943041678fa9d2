# SPDX-License-Identifier: BSD-3-Clause
"""Bags of a chair in a known building, with the truth; and one's odometry made better, as from encoders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu import slam
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error
from kurumaisu.geometry import between, compose, interpolate
from kurumaisu.types import FloatArray

_WAY, _TURN = 0.01, 0.01  # of encoders: scale, the same for a whole drive
_NOISE = 0.02  # of every stretch [m/m, rad/rad]


def office_logs(folder: Path, mount: Sequence[float]) -> Iterator[tuple[str, slam.ScanLog, FloatArray]]:
    """Yield name, log and truth (n, 3) of every bag, and of the first once more with odometry made from the truth.

    mount: base_from_laser [m, m, rad]. Raise Error naming a bag that has not all that is needed.
    """
    paths = sorted(folder.glob("*.bag"))
    if not paths:
        raise Error(f"{folder}: has no bag")
    for path in paths:
        log, truth = _read(path, mount)
        yield path.stem, log, truth
        if path == paths[0]:
            yield f"{path.stem}, encoders made here", _with_encoders(log, truth), truth


def _read(path: Path, mount: Sequence[float]) -> tuple[slam.ScanLog, FloatArray]:
    run = read_recording(path).runs[0]
    if run.scan is None or run.odom is None or run.pose is None or run.fan is None:
        raise Error(f"{path}: needs scan, odom and ground_truth")
    fan = slam.Fan(
        angle_min=run.fan.angle_min,
        angle_increment=run.fan.angle_increment,
        time_increment=run.fan.time_increment,
        range_max=float(np.max(run.scan.values, initial=0.0, where=np.isfinite(run.scan.values))),
        base_from_laser=list(mount),
    )
    ranges = run.scan.values.astype(np.float32)
    log = slam.scan_log(path.stem, run.scan.t, ranges, fan, run.odom.t, run.odom.values[:, :3])
    return log, interpolate(run.pose.t, run.pose.values[:, :3], log.times)


def _with_encoders(log: slam.ScanLog, truth: FloatArray) -> slam.ScanLog:
    rng = np.random.default_rng(1)
    motions = between(truth[:-1], truth[1:])
    scale = np.array([1 + _WAY, 1 + _WAY, 1 - _TURN]) + rng.normal(0, _NOISE, motions.shape)
    poses = [np.zeros(3)]
    for motion in motions * scale:
        poses.append(compose(poses[-1], motion))
    odom = np.array(poses)
    ends = log.times + log.fan.time_increment * (log.ranges.shape[1] - 1)
    return replace(log, odom=odom, odom_end=interpolate(log.times, odom, np.minimum(ends, log.times[-1])))
